"""The rosserial server in an asyncio program: its core, its lines and one timer.

server = Server("dds:")
server.add_serial("/dev/ttyACM0", 57600)
server.add_tcp(11411)
server.on_event(lambda event: print(event.text()))
server.on_finding(lambda finding: print(finding.format()))
await server.run()
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from muros.findings import Finding, Findings
from muros.links import LineAddress, Link, LinkError
from muros.rosserial.server._board import Board
from muros.rosserial.server._core import ServerCore
from muros.rosserial.server._door import RefusedError, World
from muros.rosserial.server._limits import Limits
from muros.rosserial.server._lines import BAUD, BAUDS, TCP_PORT, identify, serial_line, tcp_line
from muros.rosserial.server._space_world import SpaceWorld
from muros.rosserial.server._worlds import Worlds
from muros.rosserial.server.events import Event, LineDown
from muros.space import Space, open_space

__all__ = ["NODE_NAME", "Server"]

NODE_NAME = "/serial_node"
"""What boards are called when nothing else is said, as the node of the ROS 1 servers was."""

_NS_PER_MS = 1_000_000
_AFTER_FAILURE = 100
"""When timers are looked at again after one has failed, in ms."""
_GOODBYE_S = 0.05
"""How long lines are kept open for the last frames to leave."""


class Server:
    """A rosserial server. Everything it does happens on the thread of the loop that runs it.

    ``space``: a URL (``"dds:"``, the ROS 2 graph; ``"local:"``, only this process), a space to share with others, or
    None if boards shall only be in ``worlds``, which are such places besides and before the space. Boards are called
    ``node_name`` and their line's name, where their link gives them no name. ``remap`` gives topics and services of the
    space other names. ``parameters(node)`` gives the first parameters of the node with that full name.
    ``limits`` are those of the server; single ``fields`` of `Limits` may be given by name instead.
    """

    def __init__(
        self,
        space: str | Space | None = "dds:",
        *,
        worlds: Sequence[World] = (),
        findings: Findings | None = None,
        domain: int | None = None,
        node_name: str = NODE_NAME,
        remap: Mapping[str, str] | None = None,
        parameters: Callable[[str], Mapping[str, Any]] | None = None,
        limits: Limits | None = None,
        **fields: Any,
    ) -> None:
        self._owns_space = isinstance(space, str)
        if isinstance(space, str):
            findings = findings or Findings()
            space = open_space(space, findings=findings)
        self.space = space
        self.findings = findings or (Findings() if space is None else space.findings)
        self.node_name = "/" + node_name.strip("/")
        made = replace(limits or Limits(), **fields)
        self._in_space: SpaceWorld | None = None
        places = list(worlds)
        if space is not None:
            self._in_space = SpaceWorld(
                space,
                wall=time.time_ns,
                later=self._later,
                remap=remap,
                parameters=parameters,
                depth=made.depth,
                domain=domain,
            )
            places.append(self._in_space)
        if not places:
            raise ValueError("a rosserial server needs a space or a world for its boards")
        world = places[0] if len(places) == 1 else Worlds(places, self._refused_somewhere)
        self.core = ServerCore(world, self.findings, limits=made, wall=time.time_ns, clock=_now)
        self.core.on_event = self._tell
        self.core.on_wake = self._arm
        self.core.on_unanswered = self._next_baud
        self._finding_baud: set[object] = set()
        self.links: list[Link] = []
        self._adapters: dict[Link, _LinkAdapter] = {}
        self._watchers: list[Callable[[Event], object]] = []
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._timer_at = 0
        self._ticking = False
        self._closed: asyncio.Event | None = None
        self._ended = False
        self._told = False

    def add_serial(
        self, devices: str | Sequence[str], baud: int | None = BAUD, *, name: str | None = None
    ) -> Link:
        """Adds serial ports, by path, by-id name or pattern; ``baud`` None: the rate is found out. See `add_link`."""
        return self.add_link(serial_line(devices, baud or BAUD), name=name, find_baud=baud is None)

    def add_tcp(self, port: int = TCP_PORT, host: str | None = None, *, name: str | None = None) -> Link:
        """Adds a port where boards dial in; see `add_link`."""
        return self.add_link(tcp_line(port, host), name=name)

    def add_link(self, link: Link, *, name: str | None = None, find_baud: bool = False) -> Link:
        """Adds a link without framing (`RawFraming`); it opens when the server runs, or now if it does.

        ``name`` is the full name of the board's node; without one boards are called after their lines. With
        ``find_baud`` other rates are tried on serial lines whose boards do not answer. Raises LinkError if it cannot
        open now.
        """
        if find_baud:
            self._finding_baud.add(link)
        adapter = _LinkAdapter(self, link, name)
        link.on_peer = adapter.on_peer
        link.on_room = adapter.on_room
        if self._loop is not None:
            link.open(adapter)
        self.links.append(link)
        self._adapters[link] = adapter
        return link

    def remove_link(self, link: Link) -> None:
        """Closes a link; its boards count as lost."""
        self.links.remove(link)
        adapter = self._adapters.pop(link)
        for board in adapter.port.boards.values():
            board.stop()
        link.close()
        for address in list(adapter.port.boards):
            adapter.port.down(address, "its link was removed", _now())

    def on_event(self, callback: Callable[[Event], object]) -> Callable[[], None]:
        """Calls ``callback`` with every event from now on; returns a function that ends it."""
        self._watchers.append(callback)
        return lambda: self._watchers.remove(callback)

    def on_finding(self, callback: Callable[[Finding], object]) -> Callable[[], None]:
        """Calls ``callback`` with every new finding and with summaries; returns a function that ends it."""
        return self.findings.on_finding(callback)

    async def start(self) -> None:
        """Opens the lines and serves in the background. Raises LinkError; no line is open then, and one may try again.

        Raises RuntimeError for a server that serves already or was closed: make a new one.
        """
        if self._loop is not None or self._ended:
            raise RuntimeError(
                "this server was closed: make a new one" if self._ended else "this server runs already"
            )
        self._loop = asyncio.get_running_loop()
        self._closed = asyncio.Event()
        try:
            if self._in_space is not None:
                self._in_space.warm()
            if self.space is not None:
                self.space.attach(self._loop)
            for link in self.links:
                link.open(self._adapters[link])
        except BaseException:
            self._stop()
            raise
        self._arm(_now())

    async def run(self) -> None:
        """Opens the lines and serves until `close` is called or the task is cancelled. Raises LinkError."""
        await self.start()
        assert self._closed is not None
        try:
            await self._closed.wait()
        finally:
            await self.stop()

    async def stop(self) -> None:
        """Tells every board that nobody listens any more, waits until that has left, and closes."""
        if not self._ended and self._loop is not None:
            self.core.stop()
            self._told = True
            with suppress(asyncio.CancelledError):
                await asyncio.sleep(_GOODBYE_S)
        self.close()

    def close(self) -> None:
        """Closes every line and removes every board, for good. Closing twice is harmless."""
        if self._ended:
            return
        self._ended = True
        if not self._told:
            self.core.stop()
        self._stop()
        for board in list(self.core.boards):
            self.core.remove(board, "the server stops")
        if self._in_space is not None:
            self._in_space.close()
        self.findings.flush()
        if self._owns_space and self.space is not None:
            self.space.close()
        if self._closed is not None:
            self._closed.set()

    def _stop(self) -> None:
        self._loop = None
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        for link in self.links:
            link.close()

    def _next_baud(self, board: Board) -> bool:
        """Tries another rate with a board that does not answer, if its line has none of its own."""
        link, address = board.output.link, board.output.address
        if link not in self._finding_baud or not isinstance(address, LineAddress):
            return False
        serial: Any = link
        baud = serial.baud_of(address.device)
        at = BAUDS.index(baud) + 1 if baud in BAUDS else 0
        for other in (*BAUDS[at:], *BAUDS[:at]):
            with suppress(LinkError):  # this port may not have all of them
                serial.set_baud(address.device, other)
                break
        board.set_baud(self._adapters[serial].port.identify(address).baud)
        return True

    def _refused_somewhere(self, owner: str, what: str, error: RefusedError) -> None:
        self.core.report(
            "refused-in-one-world",
            who=owner,
            subject=what,
            what=f"{what} of {owner} is in one graph and not in another",
            why=error.why,
            remedy=error.remedy,
        )

    def _later(self, call: Callable[[], object]) -> None:
        if self._loop is not None:
            self._loop.call_soon(call)

    def _tell(self, event: Event) -> None:
        for callback in list(self._watchers):
            try:
                callback(event)
            except Exception as error:  # whoever watches must not harm those who are watched
                self.core.report(
                    "watcher-failed",
                    who=getattr(callback, "__qualname__", repr(callback)),
                    what="{n} event{s} not taken by a watcher of the server",
                    why=f"it raised {type(error).__name__}: {error}",
                    remedy="Mend the callback given to on_event.",
                )

    def _arm(self, tick: int) -> None:
        """Sees to a call of `_tick` at ``tick`` (ms) at the latest."""
        if self._loop is None or self._ticking or (self._timer is not None and self._timer_at <= tick):
            return
        if self._timer is not None:
            self._timer.cancel()
        self._timer_at = tick
        self._timer = self._loop.call_later(max(0, tick - _now()) / 1000, self._tick)

    def _tick(self) -> None:
        self._timer = None
        self._ticking = True  # what wants to be called is asked for at the end
        now = _now()
        try:
            due = self.core.tick(now)
        except Exception as error:  # said loudly, yet the server goes on, and with it everybody else's boards
            due = now + _AFTER_FAILURE
            context = {"message": "the rosserial server has failed at a timer", "exception": error}
            asyncio.get_running_loop().call_exception_handler(context)
        finally:
            self._ticking = False
        waits = [] if due is None else [due]
        seconds = time.time()
        findings_due = self.findings.tick(seconds)
        if findings_due is not None:
            waits.append(now + max(0, int((findings_due - seconds) * 1000)) + 1)
        if waits:
            self._arm(min(waits))


class _LinkAdapter:
    """What one link tells the server: the events of a link, turned into calls of the core."""

    def __init__(self, server: Server, link: Link, name: str | None) -> None:
        self._server = server
        self._link = link
        alone = name is not None
        full = "/" + (name or server.node_name).strip("/")
        self.port = server.core.attach(link, lambda address: identify(link, address, full, alone))

    def on_peer(self, address: Hashable) -> None:
        """Somebody can be spoken to."""
        self.port.up(address, _now())

    def on_room(self, address: Hashable) -> None:
        """What waited for a peer has left."""
        self.port.room(address, _now())

    def on_message(self, link: Link, data: bytes, address: Hashable) -> None:
        """Bytes came."""
        self.port.receive(data, address, time.monotonic_ns() // _NS_PER_MS)

    def on_up(self, link: Link, detail: str) -> None:
        """The link or a port of it has become usable: `on_peer` says who is there."""

    def on_down(self, link: Link, reason: str) -> None:
        """The link or a port of it has gone."""
        self._server._tell(LineDown(link.name, reason))

    def on_gone(self, link: Link, address: Hashable, reason: str) -> None:
        """A peer cannot be reached any more."""
        self.port.down(address, reason, _now())

    def on_problem(self, link: Link, code: str, what: str, why: str, remedy: str, n: int) -> None:
        """Something was dropped, refused or does not work."""
        self._server.core.report(code, who=link.name, what=what, why=why, remedy=remedy, n=n)


def _now() -> int:
    return time.monotonic_ns() // _NS_PER_MS
