"""A link made of the user's own functions: for transports that muros does not know.

The functions are called on the loop's thread and must not block. When one raises, the link is closed through the
user's ``close`` and opened again every ``retry`` seconds, as with a serial port that went away.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import ClassVar, TypeAlias

from muros.links._datagram import DRAIN
from muros.links._door import PORT_GONE, QUEUE_FULL, Address, Cause, Link, LinkError
from muros.links._framing import MESSAGE_BYTES, NOT_FRAMES, Cutter, MakeFraming, SerialFraming

POLL_S = 0.005
"""How often ``read`` is asked when there is no descriptor to watch, in seconds."""
RETRY_S = 0.5
"""How long a link that failed waits before it is opened again, in seconds."""
PEER = "peer"
"""The address of the one peer of a link whose functions do not deal in addresses."""

OpenFunction: TypeAlias = Callable[[], object]
CloseFunction: TypeAlias = Callable[[], object]
ReadFunction: TypeAlias = Callable[[], "bytes | tuple[bytes, Address] | None"]
WriteFunction: TypeAlias = Callable[..., object]


class CustomLink(Link):
    """Messages through four functions.

    ``open()`` prepares the transport. If it returns a descriptor (an int, or an object with ``fileno()``), that is
    watched and ``read`` called when it is readable; if it returns None, ``read`` is called every ``poll`` seconds.
    ``read()`` returns bytes that have come, or None when there are none now; ``b""`` means the same when polled, and
    the end of a watched descriptor. ``write(data)`` sends; it answers False when it could not. ``close()`` undoes
    ``open``.

    With ``framing``, the functions move a byte stream in any pieces, cut as on serial lines, and an address is the
    peer's number in its frames. Without, each piece is a whole message; ``addressed`` functions then deal in
    ``(data, address)``: read returns such a pair and write takes both. Else there is one peer, `PEER`.
    """

    kind: ClassVar[str] = "custom"

    def __init__(
        self,
        open: OpenFunction | None,
        close: CloseFunction | None,
        read: ReadFunction,
        write: WriteFunction,
        *,
        framing: bool = False,
        addressed: bool = False,
        name: str = "custom",
        mtu: int = MESSAGE_BYTES,
        poll: float = POLL_S,
        retry: float = RETRY_S,
        drain: int = DRAIN,
        make_framing: MakeFraming = SerialFraming,
    ) -> None:
        if framing and addressed:
            raise ValueError("CustomLink: framing has its own addresses; leave out addressed or framing")
        super().__init__()
        self.mtu = mtu
        self._name = name
        self._functions = (open, close, read, write)
        self._framed = framing
        self._addressed = addressed
        self._poll = poll
        self._retry = retry
        self._drain = drain
        self._make_framing = make_framing
        self._cutter: Cutter | None = None
        self._watched: int | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._ready = False
        self._generation = 0

    @property
    def name(self) -> str:
        return self._name

    def describe(self, address: Address) -> str:
        return f"{self._name}#{address}" if self._framed else str(address)

    def _send(self, message: bytes, address: Address) -> Cause | None:
        if not self._ready:
            return PORT_GONE
        write = self._functions[3]
        try:
            if self._cutter is not None:
                done = write(self._cutter.framing.frame(message, int(address)))  # type: ignore[call-overload]
            elif self._addressed:
                done = write(message, address)
            else:
                done = write(message)
        except Exception as error:  # the user's code: whatever it raises must not reach the other links
            asyncio.get_running_loop().call_soon(self._failed, "write", error, self._generation)
            return PORT_GONE
        return QUEUE_FULL if done is False else None

    def _open(self) -> None:
        try:
            self._connect()
        except LinkError:
            raise
        except Exception as error:
            raise LinkError(self._name, f"open failed ({_words(error)})", "See the function open.") from error

    def _close(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._disconnect()

    def _connect(self) -> None:
        open_ = self._functions[0]
        handle = open_() if open_ is not None else None
        self._ready = True
        self._generation += 1
        if self._framed:
            self._cutter = Cutter(self._make_framing())
        loop = asyncio.get_running_loop()
        if handle is None:
            self._timer = loop.call_later(self._poll, self._polled)
        else:
            self._watched = handle if isinstance(handle, int) else int(handle.fileno())  # type: ignore[attr-defined]
            loop.add_reader(self._watched, self._drained)
        self._up(self._name)

    def _disconnect(self) -> None:
        if not self._ready:
            return
        self._ready = False
        if self._watched is not None:
            asyncio.get_running_loop().remove_reader(self._watched)
            self._watched = None
        close = self._functions[1]
        if close is not None:
            try:
                close()
            except Exception as error:  # as in send
                self._problem(_raised("close", error), f"{self._name} may not be closed properly")

    def _polled(self) -> None:
        self._timer = None
        generation = self._generation
        more = self._drained()
        if self._ready and generation == self._generation:
            self._timer = asyncio.get_running_loop().call_later(0 if more else self._poll, self._polled)

    def _drained(self) -> bool:
        """Reads until there is nothing, or others must have their turn: then True."""
        read = self._functions[2]
        generation = self._generation
        for _ in range(self._drain):
            try:
                got = read()
                if got == b"" and self._watched is not None:
                    raise EOFError("closed by the far end")  # else it would stay readable for ever
            except (BlockingIOError, InterruptedError):
                return False
            except Exception as error:  # as in send
                self._failed("read", error, generation)
                return False
            if not got:
                return False
            self._take(got)
            if not self._ready or generation != self._generation:
                return False
            if self._watched is not None:
                return True  # it tells again by itself; a read that can block must not be asked twice
        return True

    def _take(self, got: bytes | tuple[bytes, Address]) -> None:
        if isinstance(got, tuple):
            self._deliver(*got)
        elif self._cutter is None:
            self._deliver(got, PEER)
        else:
            messages = self._cutter.framing.feed_untrusted(got)
            errors = self._cutter.fresh_errors()
            if errors:
                self._damaged(errors)
            for message, peer in messages:
                self._deliver(message, peer)

    def _damaged(self, errors: dict[str, int]) -> None:
        self.counters.framing.update(errors)
        bad = sum(n for kind, n in errors.items() if kind not in NOT_FRAMES)
        if bad:
            cause = Cause("line-noise", "the stream is damaged", "Check that read gives every byte, once.")
            self._problem(cause, f"bad frames on {self._name} dropped", bad)

    def _failed(self, function: str, error: Exception, generation: int) -> None:
        if not self._ready or generation != self._generation:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._disconnect()
        self._timer = asyncio.get_running_loop().call_later(self._retry, self._reconnect)
        self._down(f"{self._name}: {function} failed ({_words(error)})")

    def _reconnect(self) -> None:
        self._timer = None
        try:
            self._connect()
        except Exception as error:  # as in send
            self._disconnect()
            self._problem(_raised("open", error), f"{self._name} is not open")
            if self.is_open:
                self._timer = asyncio.get_running_loop().call_later(self._retry, self._reconnect)


def _raised(function: str, error: Exception) -> Cause:
    return Cause(
        "custom-function-failed", f"{function} failed ({_words(error)})", f"See the function {function}."
    )


def _words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
