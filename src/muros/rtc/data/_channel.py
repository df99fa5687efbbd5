"""Duplex connections (`csp_channel`): a value goes over when its writer and a reader meet. Nothing is buffered.

Both sides offer an object and call the other's, so that whoever comes second finds the first:

    writer first   `put` is refused, nobody reads; the value stands there until the reader's `get` takes it
    reader first   `get` finds nothing; the reader stands there until the writer's `put` brings a value

A value goes by `put` or by `get`, never by both. While the writer's `put` is under way, `get` waits for what becomes of
it; while the reader's `get` is under way, `put` is refused, and the reader, who is told so, asks again before it stands
and waits. So none of the two can miss the other, values keep their order, and `put` is answered at once: no circle of
calls comes about. Who waits asks again every `ASK_AGAIN` seconds, to see a peer that has gone without a word.
Communicating sequential processes have such channels (Hoare, 1978).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Final

from muros.rtc.codes import DataPortStatus, PeerLostError, PortStatus
from muros.rtc.data._buffer import BufferOptions
from muros.rtc.data._links import LinkSetup, PushReceiver, PushSender
from muros.rtc.data._ring import FullPolicy
from muros.rtc.data._transports import ChannelInlet, ChannelOutlet

__all__ = ["ASK_AGAIN", "ChannelReceiver", "ChannelSender", "Demand"]

ASK_AGAIN: Final = 1.0
"""Seconds after which who waits looks whether the other side is still there."""

PUT_TIME: Final = 1.0
"""Seconds that a `get` waits for what becomes of a `put` under way."""


class Writer:
    """The writer's end of a channel: an inlet whose `put` comes back when the value was taken, or was not."""

    def __init__(self, options: BufferOptions, clock: Callable[[], float]) -> None:
        self._waits: Final = options.full_policy is not FullPolicy.DO_NOTHING
        self._timeout: Final = options.write_timeout
        self._clock: Final = clock
        self._inlet: ChannelInlet | None = None
        self._condition: Final = threading.Condition(threading.Lock())
        self._busy = False
        """Somebody writes: others wait for their turn."""
        self._octets: bytes | None = None
        """What a reader can get. None: nothing, or taken."""
        self._putting = False
        self._closed = False

    def reach(self, inlet: ChannelInlet) -> None:
        """Here is the reader."""
        self._inlet = inlet

    def put(self, octets: bytes) -> PortStatus:
        """Meet a reader. BUFFER_FULL: nobody reads, and this side does not wait; BUFFER_TIMEOUT: nobody came.

        PORT_ERROR: the connection ended. PeerLostError: the other side has gone.
        """
        inlet = self._inlet
        deadline = self._clock() + self._timeout if self._waits and self._timeout > 0 else None
        with self._condition:
            while self._busy and not self._closed:
                if not self._wait(deadline):
                    return PortStatus.BUFFER_TIMEOUT if self._waits else PortStatus.BUFFER_FULL
            if self._closed or inlet is None:
                return PortStatus.PORT_ERROR
            self._busy = True
        try:
            return self._meet(inlet, octets, deadline)
        finally:
            with self._condition:
                self._busy = self._putting = False
                self._octets = None
                self._condition.notify_all()

    def get(self) -> tuple[PortStatus, bytes]:
        """For the reader: the value that stands here, or BUFFER_EMPTY. Never raises."""
        with self._condition:
            self._condition.wait_for(lambda: not self._putting, PUT_TIME)
            octets = self._octets
            if octets is None or self._putting:
                return PortStatus.BUFFER_EMPTY, b""
            self._octets = None
            self._condition.notify_all()
            return PortStatus.PORT_OK, octets

    def is_readable(self) -> bool:
        """For the reader: whether a value stands here."""
        with self._condition:
            return self._octets is not None

    def close(self) -> None:
        """Let nobody wait any longer. Closing twice is allowed."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()
        if self._inlet is not None:
            self._inlet.close()

    def _meet(self, inlet: ChannelInlet, octets: bytes, deadline: float | None) -> PortStatus:
        with self._condition:
            self._octets = octets
        while True:
            with self._condition:
                if self._octets is None:
                    return PortStatus.PORT_OK
                self._putting = True
            answer = inlet.put(octets)
            with self._condition:
                self._putting = False
                self._condition.notify_all()
                if answer is not PortStatus.BUFFER_FULL or not self._waits:
                    self._octets = None
                    return answer
            while True:
                with self._condition:
                    in_time = self._octets is None or self._wait(deadline)
                    if self._octets is None:
                        return PortStatus.PORT_OK
                    if self._closed:
                        return PortStatus.PORT_ERROR
                    if not in_time:
                        self._octets = None
                        return PortStatus.BUFFER_TIMEOUT
                if inlet.is_writable(True):
                    break

    def _wait(self, deadline: float | None) -> bool:
        """With the condition held: until something happens, for `ASK_AGAIN` seconds at most. False: it is over."""
        if not self._waits or self._closed:
            return False
        left = ASK_AGAIN if deadline is None else deadline - self._clock()
        if left > 0:
            self._condition.wait(min(left, ASK_AGAIN))
        return left > 0


class ChannelSender(PushSender):
    """Meets readers in the call of write."""

    def __init__(self, setup: LinkSetup) -> None:
        self.writer: Final = Writer(setup.options.buffer, setup.clock)
        super().__init__(setup, self.writer)


class Demand:
    """What the readers of a port wish for, from whichever of its channels. Under the port's condition."""

    def __init__(self) -> None:
        self.refused = 0
        """Values that came when nobody stood and waited, so far."""
        self._wishes: list[object] = []

    def __bool__(self) -> bool:
        return bool(self._wishes)

    def wish(self) -> object:
        """A reader stands and waits for one value."""
        wish = object()
        self._wishes.append(wish)
        return wish

    def withdraw(self, wish: object) -> None:
        """It waits no longer, whether or not the wish was granted."""
        if wish in self._wishes:
            self._wishes.remove(wish)

    def grant(self) -> bool:
        """A value has come: whether somebody waits for it, who then has it."""
        if self._wishes:
            del self._wishes[0]
            return True
        self.refused += 1
        return False


class ChannelReceiver(PushReceiver):
    """Takes a value when somebody reads. Its buffer holds one only between its coming and the reader's waking.

    `drop` ends a connection, given by its id, whose other side has gone.
    """

    def __init__(
        self,
        setup: LinkSetup,
        condition: threading.Condition,
        arrivals: Iterator[int],
        demand: Demand,
        drop: Callable[[str], None],
    ) -> None:
        super().__init__(setup, condition, arrivals)
        self._condition: Final = condition
        self._demand: Final = demand
        self._drop: Final = drop
        self._outlet: ChannelOutlet | None = None

    def reach(self, outlet: ChannelOutlet) -> None:
        """Here is the writer."""
        self._outlet = outlet

    def put(self, octets: bytes) -> PortStatus:
        """For the writer: take a value if somebody reads, else BUFFER_FULL. Never raises."""
        with self._condition:
            if not self.closed and not self._demand.grant():
                return PortStatus.BUFFER_FULL
        return super().put(octets)

    def is_writable(self) -> bool:
        """For the writer: whether somebody reads."""
        with self._condition:
            return bool(self._demand) and not self.closed

    def is_new(self) -> bool:
        """Whether a value is there, or a writer waits with one. The other side is asked."""
        if self.buffer.ring:
            return True
        if self._outlet is None or self.closed:
            return False
        try:
            return self._outlet.is_readable(False)
        except PeerLostError as error:
            self._lost(error)
            return False

    def ask(self) -> DataPortStatus:
        """Look for a writer who waits, and take its value. CONNECTION_LOST: it has gone, and so has the connection."""
        if self._outlet is None or self.closed:
            return DataPortStatus.PRECONDITION_NOT_MET
        try:
            answer, octets = self._outlet.get()
        except PeerLostError as error:
            self._lost(error)
            return DataPortStatus.CONNECTION_LOST
        if answer is not PortStatus.PORT_OK:
            return DataPortStatus.BUFFER_EMPTY
        super().put(octets)
        return DataPortStatus.PORT_OK

    def _lost(self, error: Exception) -> None:
        if not self.closed:
            self.lost_sight(error)
            self._drop(self.info.connector_id)

    def _end(self) -> None:
        super()._end()
        if self._outlet is not None:
            self._outlet.close()
