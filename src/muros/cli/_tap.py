"""A link with a listener: every message that passes is shown, then handed on."""

from collections.abc import Callable
from typing import Any, TypeAlias

from muros.links import Address, Link, LinkEvents, Locator

OnMessage: TypeAlias = Callable[[Link, bool, bytes, Address], object]
"""Gets the link, whether the message came in, the message, and the peer's address."""


class Tap(Link):
    """`inner` as it is, but `on_message` sees its messages. Used only when somebody wants to look."""

    def __init__(self, inner: Link, on_message: OnMessage) -> None:
        super().__init__()
        self.inner = inner
        self.counters = inner.counters
        self.mtu = inner.mtu
        self.discovery_only = inner.discovery_only
        self._on_message = on_message

    @property
    def name(self) -> str:
        """The name of the link inside."""
        return self.inner.name

    @property
    def is_open(self) -> bool:
        """Whether the link inside is open."""
        return self.inner.is_open

    def open(self, events: LinkEvents) -> None:
        """Opens the link inside; its events come through here."""
        if self.on_peer is not None:
            self.inner.on_peer = self.on_peer
            self.inner.on_room = self.on_room
        self.inner.open(_Listener(self, events, self._on_message))

    def close(self) -> None:
        """Closes the link inside."""
        self.inner.close()

    def send(self, message: bytes, address: Address) -> bool:
        """Shows the message and sends it."""
        self._on_message(self.inner, False, bytes(message), address)
        return self.inner.send(message, address)

    def backlog(self, address: Address) -> int:
        """What waits in the link inside."""
        return self.inner.backlog(address)

    def describe(self, address: Address) -> str:
        """As the link inside says it."""
        return self.inner.describe(address)

    def locators(self) -> list[Locator]:
        """Those of the link inside."""
        return self.inner.locators()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)

    def _open(self) -> None:
        raise AssertionError("open() is the way in")

    _close = _open


class _Listener:
    """Passes events on as those of the tap, because the owner knows no other link."""

    def __init__(self, tap: Tap, events: LinkEvents, on_message: OnMessage) -> None:
        self._tap = tap
        self._events = events
        self._show = on_message

    def on_message(self, link: Link, data: bytes, address: Address) -> None:
        self._show(link, True, data, address)
        self._events.on_message(self._tap, data, address)

    def on_up(self, _link: Link, detail: str) -> None:
        self._events.on_up(self._tap, detail)

    def on_down(self, _link: Link, reason: str) -> None:
        self._events.on_down(self._tap, reason)

    def on_gone(self, _link: Link, address: Address, reason: str) -> None:
        self._events.on_gone(self._tap, address, reason)

    def on_problem(self, _link: Link, code: str, what: str, why: str, remedy: str, n: int) -> None:
        self._events.on_problem(self._tap, code, what, why, remedy, n)
