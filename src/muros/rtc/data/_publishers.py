"""When an OutPort's values are sent: in the call of write, in a thread at once, in a thread at a rate.

A thread takes what its push policy selects out of the sender's buffer. A value is removed only after it was sent; what
could not be sent stays and is tried again with the next write (`new`) or the next period (`periodic`).

    last send       the next write answers
    PORT_OK         what the buffer answers
    SEND_FULL       BUFFER_FULL: not taken; the thread tries the one that waits
    CONNECTION_LOST CONNECTION_LOST: not taken; the port drops the connection
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Final, Protocol

from muros.rtc.codes import BufferStatus, DataPortStatus
from muros.rtc.data._buffer import Buffer
from muros.rtc.data._listeners import ConnectorEvent, DataEvent
from muros.rtc.data._options import DataOptions, Subscription
from muros.rtc.data._policies import PushPolicy, Selector
from muros.rtc.data._samples import Sample

__all__ = ["STORED", "Publisher", "SendingEnd", "make_publisher"]

JOIN_TIME: Final = 1.0
"""Seconds that closing waits for a thread that is sending."""

STORED: Final = {
    BufferStatus.OK: DataPortStatus.PORT_OK,
    BufferStatus.FULL: DataPortStatus.BUFFER_FULL,
    BufferStatus.EMPTY: DataPortStatus.BUFFER_EMPTY,
    BufferStatus.TIMEOUT: DataPortStatus.BUFFER_TIMEOUT,
    BufferStatus.NOT_SUPPORTED: DataPortStatus.BUFFER_ERROR,
    BufferStatus.ERROR: DataPortStatus.BUFFER_ERROR,
    BufferStatus.PRECONDITION_NOT_MET: DataPortStatus.PRECONDITION_NOT_MET,
}
"""What a buffer's answer means to who wrote to the port, or read from it."""


class SendingEnd(Protocol):
    """What a publisher sends through: its connector."""

    def send(self, sample: Sample) -> DataPortStatus:
        """Send; never raises."""

    def tell(self, event: DataEvent, sample: Sample) -> None:
        """Tell the listeners of a value."""

    def tell_connector(self, event: ConnectorEvent) -> None:
        """Tell the listeners of a moment without a value."""

    def overwrote(self) -> None:
        """A value that had not been sent was lost for a newer one."""


class Publisher(Protocol):
    """Takes what is written."""

    def write(self, sample: Sample) -> DataPortStatus:
        """Take it; what became of it so far."""

    def close(self) -> None:
        """Send nothing more. Closing twice is allowed."""


def make_publisher(
    options: DataOptions, end: SendingEnd, *, name: str, clock: Callable[[], float] = time.monotonic
) -> Publisher:
    """The publisher that the connection asks for. `name`: of its thread, if it has one."""
    if options.subscription is Subscription.FLUSH:
        return _Flush(end)
    return _Threaded(options, end, name=name, clock=clock)


class _Flush:
    """Sends in the thread of who writes."""

    def __init__(self, end: SendingEnd) -> None:
        self.write: Final = end.send

    def close(self) -> None: ...


class _Threaded:
    """Sends in a thread of its own: woken by writes, or at a rate that begins with the first write."""

    def __init__(
        self, options: DataOptions, end: SendingEnd, *, name: str, clock: Callable[[], float]
    ) -> None:
        self._end: Final = end
        self._buffer: Final[Buffer[Sample]] = Buffer(options.buffer, clock=clock)
        self._selector: Final = Selector(options.push_policy, options.skip_count)
        self._period: Final = (
            1.0 / options.push_rate if options.subscription is Subscription.PERIODIC else None
        )
        self._clock: Final = clock
        self._last = DataPortStatus.PORT_OK
        self._signals = 0
        self._wake: Final = threading.Condition(threading.Lock())
        self._closed = False
        self._thread: Final = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def write(self, sample: Sample) -> DataPortStatus:
        last = self._last
        if last is DataPortStatus.CONNECTION_LOST:
            return last
        if last is DataPortStatus.SEND_FULL:
            self._signal()
            return DataPortStatus.BUFFER_FULL
        status, overwrote = self._buffer.write(sample)
        end = self._end
        if status is BufferStatus.OK:
            end.tell(DataEvent.ON_BUFFER_WRITE, sample)
            if overwrote:
                end.overwrote()
                end.tell(DataEvent.ON_BUFFER_OVERWRITE, sample)
        elif status is BufferStatus.FULL:
            end.tell(DataEvent.ON_BUFFER_FULL, sample)
        elif status is BufferStatus.TIMEOUT:
            end.tell(DataEvent.ON_BUFFER_WRITE_TIMEOUT, sample)
        self._signal()
        return STORED[status]

    def close(self) -> None:
        with self._wake:
            self._closed = True
            self._wake.notify()
        self._buffer.close()
        if self._thread is not threading.current_thread():
            self._thread.join(JOIN_TIME)

    def _signal(self) -> None:
        with self._wake:
            self._signals += 1
            if self._signals == 1:
                self._wake.notify()

    def _run(self) -> None:
        if self._period is None:
            self._run_on_writes()
        else:
            self._run_at_rate(self._period)

    def _run_on_writes(self) -> None:
        """One pass a wake-up, one a write with `fifo`: each write lets one value go."""
        each = self._selector.policy is PushPolicy.FIFO
        while True:
            with self._wake:
                while not self._signals and not self._closed:
                    self._wake.wait()
                passes = min(self._signals, self._buffer.options.length) if each else 1
                self._signals = 0
            for _ in range(passes):
                if self._closed:
                    return
                self._pass()
            if self._closed:
                return

    def _run_at_rate(self, period: float) -> None:
        """Deadlines on the clock; a pass that took longer than its period skips those it missed."""
        with self._wake:
            while not self._signals and not self._closed:
                self._wake.wait()
        deadline = self._clock()
        while not self._closed:
            if self._pass() is None and not self._closed:
                self._end.tell_connector(ConnectorEvent.ON_BUFFER_EMPTY)
                self._end.tell_connector(ConnectorEvent.ON_SENDER_EMPTY)
            now = self._clock()
            deadline = max(deadline + period, now - (now - deadline) % period)
            with self._wake:
                while not self._closed and (left := deadline - self._clock()) > 0:
                    self._wake.wait(min(left, threading.TIMEOUT_MAX))

    def _pass(self) -> DataPortStatus | None:
        """Send what the policy selects; what came of the last one, None if there was nothing."""
        status: DataPortStatus | None = None
        while not self._closed:
            chosen = self._next(again=status is None)
            if chosen is None:
                break
            number, sample = chosen
            self._end.tell(DataEvent.ON_BUFFER_READ, sample)
            self._last = status = self._end.send(sample)
            if status is not DataPortStatus.PORT_OK:
                break
            with self._buffer.condition:
                self._selector.sent()
                self._buffer.ring.drop_through(number)
                self._buffer.condition.notify_all()
            if not self._selector.goes_on:
                break
        return status

    def _next(self, again: bool) -> tuple[int, Sample] | None:
        """What to send, with its number. A periodic connection that sends the newest repeats it: `again`."""
        ring = self._buffer.ring
        with self._buffer.condition:
            step = self._selector.step(len(ring))
            if step.drop:
                ring.drop(step.drop)
                self._buffer.condition.notify_all()
            if step.send:
                return ring.peek()
            if again and self._period is not None and self._selector.policy is PushPolicy.NEW:
                return (-1, ring.last) if ring.last is not None else None
            return None
