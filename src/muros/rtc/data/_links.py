"""Connectors: what one port keeps of one connection. Four kinds: pushed or pulled, at the InPort or at the OutPort.

    pushed   OutPort `PushSender`   publisher -> send ..........> `PushReceiver` at the InPort: put -> buffer <- read
    pulled   OutPort `PullSource`   write -> buffer -> get <..... `PullFetcher` at the InPort: fetch <- read

Nobody decodes for listeners that are not there: a received value stays octets until it is read, and a `direct`
connection carries values, copied once, that never become octets at all.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final, Protocol, TypeAlias

from muros.findings import Finding, Severity
from muros.rtc.codes import BufferStatus, DataPortStatus, PeerLostError, PortStatus
from muros.rtc.data._buffer import Buffer
from muros.rtc.data._listeners import ConnectorEvent, ConnectorInfo, DataEvent, DataListeners, changed_by
from muros.rtc.data._options import DataOptions, Stamp, Subscription
from muros.rtc.data._publishers import STORED, make_publisher
from muros.rtc.data._ring import EmptyPolicy
from muros.rtc.data._samples import Outgoing, Sample, copy_value, stamp
from muros.rtc.data._transports import Inlet, Offer, Outlet
from muros.rtc.data._types import AnyDataType, DataError

__all__ = [
    "InLink",
    "Link",
    "LinkSetup",
    "OutLink",
    "PullFetcher",
    "PullSource",
    "PushReceiver",
    "PushSender",
]

SENT: Final = {
    PortStatus.PORT_OK: DataPortStatus.PORT_OK,
    PortStatus.PORT_ERROR: DataPortStatus.PORT_ERROR,
    PortStatus.BUFFER_FULL: DataPortStatus.SEND_FULL,
    PortStatus.BUFFER_EMPTY: DataPortStatus.UNKNOWN_ERROR,
    PortStatus.BUFFER_TIMEOUT: DataPortStatus.SEND_TIMEOUT,
    PortStatus.UNKNOWN_ERROR: DataPortStatus.UNKNOWN_ERROR,
}
"""What an InPort's answer means to who wrote to the OutPort."""

REFUSED_EVENTS: Final = {
    PortStatus.BUFFER_FULL: DataEvent.ON_RECEIVER_FULL,
    PortStatus.BUFFER_TIMEOUT: DataEvent.ON_RECEIVER_TIMEOUT,
}
"""What the OutPort's listeners hear of a refusal; all others are ON_RECEIVER_ERROR."""

NOT_TAKEN: Final = {
    BufferStatus.FULL: (PortStatus.BUFFER_FULL, DataEvent.ON_BUFFER_FULL, DataEvent.ON_RECEIVER_FULL),
    BufferStatus.TIMEOUT: (
        PortStatus.BUFFER_TIMEOUT,
        DataEvent.ON_BUFFER_WRITE_TIMEOUT,
        DataEvent.ON_RECEIVER_TIMEOUT,
    ),
}
"""What an InPort answers, and its listeners hear, when its buffer did not take a value; else PORT_ERROR."""

FETCHED: Final = {
    PortStatus.BUFFER_EMPTY: (DataPortStatus.RECV_EMPTY, ConnectorEvent.ON_SENDER_EMPTY),
    PortStatus.BUFFER_TIMEOUT: (DataPortStatus.RECV_TIMEOUT, ConnectorEvent.ON_SENDER_TIMEOUT),
}
"""What an OutPort's answer without a value means; all others are ON_SENDER_ERROR."""

Report: TypeAlias = "Callable[[Finding], object]"


@dataclass(frozen=True, slots=True)
class LinkSetup:
    """What all connectors are made with."""

    info: ConnectorInfo
    options: DataOptions
    codec: AnyDataType
    listeners: DataListeners
    who: str
    """The port, for findings."""
    report: Report
    wall: Callable[[], int] = time.time_ns
    """The time of day, ns since the epoch, for `timestamp_policy`."""
    clock: Callable[[], float] = time.monotonic


class Link:
    """What the four kinds share."""

    def __init__(self, setup: LinkSetup) -> None:
        self.info: Final = setup.info
        self.options: Final = setup.options
        self.offer: Offer | None = None
        """What this side offers to the other one."""
        self.malformed = 0
        """Values whose octets were none of the data type."""
        self.overwritten = 0
        """Values lost for newer ones before anybody took them."""
        self.refused = 0
        """Values that the buffer, or the other side, did not take."""
        self.closed = False
        self._told: dict[str, tuple[int, Finding]] = {}
        self._setup: Final = setup
        self._codec: Final = setup.codec
        self._little: Final = setup.options.little
        self._listeners: Final = setup.listeners

    def connected(self) -> None:
        """It stands."""
        self.tell_connector(ConnectorEvent.ON_CONNECT)

    def close(self) -> None:
        """End it. Closing twice is allowed."""
        if self.closed:
            return
        self.closed = True
        self._end()
        if self.offer is not None:
            self.offer.close()
        self._tell_the_rest()
        self.tell_connector(ConnectorEvent.ON_DISCONNECT)

    def tell(self, event: DataEvent, sample: Sample) -> None:
        """Tell who listens; what they change counts for the sample. Nobody: nothing is decoded."""
        callbacks = self._listeners.callbacks.get(event)
        if callbacks is None:
            return
        try:
            value = sample.value
        except DataError:
            return  # it is told when it is read
        for callback in callbacks:
            try:
                answer = callback(self.info, value)
            except Exception as error:
                self._listeners.failed(event, error)
                continue
            if answer is not None:
                changed, now = changed_by(answer, value)
                if changed:
                    value = now
                    sample.replace(value)

    def tell_connector(self, event: ConnectorEvent) -> None:
        """Tell who listens."""
        self._listeners.tell(event, self.info)

    def overwrote(self) -> None:
        """Count a value lost for a newer one."""
        self.overwritten += 1
        if self.options.buffer.length == 1:  # the newest value is all that is wanted
            return
        if _is_power_of_ten(self.overwritten):
            self._tell_of(
                "values-overwritten",
                self.overwritten,
                "overwritten before they were taken",
                f"they come faster than they are taken, and the buffer holds {self.options.buffer.length}",
                "read oftener, or connect with a longer buffer.length",
                Severity.INFO,
            )

    def lost_sight(self, error: Exception) -> None:
        """The other side has gone."""
        self._find(
            "connection-lost",
            f"connection {self._label} lost",
            str(error),
            "start the peer again and connect again",
        )

    def _end(self) -> None:
        """Stop what runs for it."""

    @property
    def _label(self) -> str:
        return self.info.name or self.info.connector_id

    def _find(
        self,
        code: str,
        what: str,
        why: str,
        remedy: str = "",
        severity: Severity = Severity.WARNING,
        new: int = 1,
    ) -> Finding:
        finding = Finding(code, self._setup.who, what, why, remedy, severity, self._label, new=new)
        self._setup.report(finding)
        return finding

    def _tell_of(
        self, code: str, total: int, what: str, why: str, remedy: str, severity: Severity = Severity.WARNING
    ) -> None:
        """Values were lost, `total` so far. Told at the first, the tenth, the hundredth, ..., and at the end."""
        before = self._told[code][0] if code in self._told else 0
        finding = self._find(
            code,
            f"{{n}} value{{s}} of connection {self._label} {what}",
            why,
            remedy,
            severity,
            new=total - before,
        )
        self._told[code] = total, finding

    def _tell_the_rest(self) -> None:
        """Of the values lost since they were told of."""
        totals = {
            "values-overwritten": self.overwritten,
            "values-refused": self.refused,
            "malformed-data": self.malformed,
        }
        for code, (told, finding) in self._told.items():
            if totals[code] > told:
                self._setup.report(replace(finding, new=totals[code] - told))

    def _stamp(self, sample: Sample) -> None:
        try:
            value = sample.value
        except DataError:
            return
        if stamp(value, self._setup.wall):
            sample.replace(value)

    def _sample(self, octets: bytes) -> Sample:
        return Sample(self._codec, self._little, octets)


# ---- at the OutPort


class OutLink(Protocol):
    """A connector of an OutPort."""

    @property
    def info(self) -> ConnectorInfo: ...

    @property
    def options(self) -> DataOptions: ...

    def write(self, outgoing: Outgoing) -> DataPortStatus:
        """Take a value; what became of it so far. DataError where its type cannot hold it."""

    def close(self) -> None:
        """End it. Closing twice is allowed."""


class PushSender(Link):
    """Sends through `inlet`, or straight to the InPort's connector (`direct`)."""

    def __init__(self, setup: LinkSetup, inlet: Inlet | PushReceiver) -> None:
        super().__init__(setup)
        self._direct: Final = inlet if isinstance(inlet, PushReceiver) else None
        self._inlet: Final = inlet
        self._put: Final = inlet.put
        self._buffered: Final = setup.options.subscription is not Subscription.FLUSH
        self._stamps_sent: Final = Stamp.ON_SEND in setup.options.stamps
        self._publisher: Final = make_publisher(
            setup.options, self, name=f"{setup.who} {self._label}", clock=setup.clock
        )

    def write(self, outgoing: Outgoing) -> DataPortStatus:
        if self.closed:
            return DataPortStatus.PRECONDITION_NOT_MET
        codec, little = self._codec, self._little
        if self._direct is not None:
            sample = Sample(codec, little, None, copy_value(outgoing.value))
        elif self._buffered:
            sample = Sample(codec, little, outgoing.octets(codec, little))
        else:
            sample = Sample(codec, little, outgoing.octets(codec, little), outgoing.value)
        return self._publisher.write(sample)

    def straight_way(self) -> Callable[[Any], DataPortStatus] | None:
        """`write` of a value in one step, where there is nothing to do but to encode and to bring it; else None.

        After a pause each function that is called anew costs microseconds: this is most of a port's latency.
        """
        if self._direct is not None or self._buffered or self._stamps_sent:
            return None
        encode, little, put, listeners = self._codec.encode, self._little, self._put, self._listeners

        def write(value: Any) -> DataPortStatus:
            if listeners.hears_values or self.closed:
                return self.write(Outgoing(value))
            octets = encode(value, little)
            try:
                answer = put(octets)
            except Exception as error:
                return self._unsent(error, self._sample(octets))
            if answer is PortStatus.PORT_OK:
                return DataPortStatus.PORT_OK
            return self._answered(answer, self._sample(octets))

        return write

    def send(self, sample: Sample) -> DataPortStatus:
        """Bring it to the InPort. Never raises."""
        if self._stamps_sent:
            self._stamp(sample)
        self.tell(DataEvent.ON_SEND, sample)
        try:
            answer = self._bring(sample)
        except Exception as error:
            return self._unsent(error, sample)
        return self._answered(answer, sample)

    def _answered(self, answer: PortStatus, sample: Sample) -> DataPortStatus:
        """What the InPort's answer means."""
        if answer is PortStatus.PORT_OK:
            self.tell(DataEvent.ON_RECEIVED, sample)
            return DataPortStatus.PORT_OK
        self.refused += 1
        if _is_power_of_ten(self.refused):
            self._tell_of(
                "values-refused",
                self.refused,
                "not taken by the receiver",
                "it did not answer, or have room, in time"
                if answer is PortStatus.BUFFER_TIMEOUT
                else f"it answered {answer.name}",
                "have it read oftener, or connect with a longer buffer or another full_policy",
            )
        self.tell(REFUSED_EVENTS.get(answer, DataEvent.ON_RECEIVER_ERROR), sample)
        return SENT[answer]

    def _unsent(self, error: Exception, sample: Sample) -> DataPortStatus:
        """It could not be brought to the InPort."""
        if isinstance(error, PeerLostError):
            self.lost_sight(error)
            return DataPortStatus.CONNECTION_LOST
        self._find(
            "send-failed", f"a value of connection {self._label} not sent", f"{type(error).__name__}: {error}"
        )
        self.tell(DataEvent.ON_RECEIVER_ERROR, sample)
        return DataPortStatus.UNKNOWN_ERROR

    def _bring(self, sample: Sample) -> PortStatus:
        if self._direct is None:
            return self._put(sample.octets)
        if self._direct.closed:
            raise PeerLostError("the InPort of this process has let go of the connection")
        # A publisher with a buffer may send a value again: what the receiver gets is its own.
        value = sample.hand_out() if self._buffered else sample.value
        return self._direct.receive(Sample(self._codec, self._little, None, value))

    def _end(self) -> None:
        self._publisher.close()
        if not isinstance(self._inlet, PushReceiver):
            self._inlet.close()


class PullSource(Link):
    """Keeps what is written until the InPort asks for it."""

    def __init__(self, setup: LinkSetup) -> None:
        super().__init__(setup)
        self._buffer: Final[Buffer[Sample]] = Buffer(setup.options.buffer, clock=setup.clock)

    @property
    def waiting(self) -> int:
        """Values that can be fetched."""
        return len(self._buffer.ring)

    def write(self, outgoing: Outgoing) -> DataPortStatus:
        if self.closed:
            return DataPortStatus.PRECONDITION_NOT_MET
        sample = self._sample(outgoing.octets(self._codec, self._little))
        status, overwrote = self._buffer.write(sample)
        if overwrote:
            self.overwrote()
            self.tell(DataEvent.ON_BUFFER_OVERWRITE, sample)
        elif status is BufferStatus.FULL:
            self.tell(DataEvent.ON_BUFFER_FULL, sample)
        elif status is BufferStatus.TIMEOUT:
            self.tell(DataEvent.ON_BUFFER_WRITE_TIMEOUT, sample)
        return STORED[status]

    def get(self) -> tuple[PortStatus, bytes]:
        """The next value's octets, for the InPort. Never raises."""
        status, sample = self._buffer.read()
        if sample is None:
            timeout = status is BufferStatus.TIMEOUT
            self.tell_connector(
                ConnectorEvent.ON_BUFFER_READ_TIMEOUT if timeout else ConnectorEvent.ON_BUFFER_EMPTY
            )
            self.tell_connector(
                ConnectorEvent.ON_SENDER_TIMEOUT if timeout else ConnectorEvent.ON_SENDER_EMPTY
            )
            return (PortStatus.BUFFER_TIMEOUT if timeout else PortStatus.BUFFER_EMPTY), b""
        self.tell(DataEvent.ON_BUFFER_READ, sample)
        if Stamp.ON_SEND in self.options.stamps:
            self._stamp(sample)
        self.tell(DataEvent.ON_SEND, sample)
        try:
            return PortStatus.PORT_OK, sample.octets
        except DataError as error:  # a listener has put something else in its place
            self._find("send-failed", f"a value of connection {self._label} not sent", str(error))
            return PortStatus.PORT_ERROR, b""

    def _end(self) -> None:
        self._buffer.close()


# ---- at the InPort


class InLink(Link):
    """A connector of an InPort. Its buffer shares the port's condition, so that a reader waits for all at once."""

    def __init__(self, setup: LinkSetup, condition: threading.Condition, arrivals: Iterator[int]) -> None:
        super().__init__(setup)
        self.buffer: Final[Buffer[Sample]] = Buffer(
            setup.options.buffer, condition=condition, clock=setup.clock
        )
        self._arrivals: Final = arrivals
        self._stamps_received: Final = Stamp.ON_RECEIVED in setup.options.stamps
        self._stamps_read: Final = Stamp.ON_READ in setup.options.stamps

    def is_new(self) -> bool:
        """Whether a value can be read that was not read before."""
        return len(self.buffer.ring) > 0

    def read_back(self) -> tuple[DataPortStatus, Sample | None]:
        """Nothing new is there: what this connector's policy gives then. With the condition held."""
        if self.options.buffer.empty_policy is EmptyPolicy.READBACK and (last := self.buffer.ring.last):
            return DataPortStatus.PORT_OK, last
        return DataPortStatus.BUFFER_EMPTY, None

    def hand_out(self, sample: Sample) -> object:
        """The value, for the user. DataError, counted and told, for malformed octets."""
        try:
            if self._stamps_read:
                self._stamp(sample)
            return sample.hand_out()
        except DataError as error:
            self.malformed += 1
            if _is_power_of_ten(self.malformed):
                self._tell_of(
                    "malformed-data",
                    self.malformed,
                    "not readable",
                    str(error),
                    f"see that the sender writes {self._codec.repository_id}",
                    Severity.ERROR,
                )
            raise

    def _end(self) -> None:
        self.buffer.close()


class PushReceiver(InLink):
    """Stores what the OutPort brings."""

    def put(self, octets: bytes) -> PortStatus:
        """Store octets, whatever they are. Never raises."""
        return self.receive(Sample(self._codec, self._little, octets))

    def receive(self, sample: Sample) -> PortStatus:
        """Store a value. Never raises."""
        if self.closed:
            return PortStatus.PORT_ERROR
        heard = self._listeners.hears_values
        if self._stamps_received:
            self._stamp(sample)
        if heard:
            self.tell(DataEvent.ON_RECEIVED, sample)
        sample.order = next(self._arrivals)
        stored, overwrote = self.buffer.write(sample)
        if stored is BufferStatus.OK:
            if heard:
                self.tell(DataEvent.ON_BUFFER_WRITE, sample)
            if overwrote:
                self.overwrote()
                self.tell(DataEvent.ON_BUFFER_OVERWRITE, sample)
            return PortStatus.PORT_OK
        if stored not in NOT_TAKEN:
            return PortStatus.PORT_ERROR
        self.refused += 1
        answer, *events = NOT_TAKEN[stored]
        for event in events:
            self.tell(event, sample)
        return answer

    def forgotten(self) -> None:
        """Its values are not kept any longer: it ended, and nobody read them."""
        self._find(
            "values-unread",
            f"{{n}} value{{s}} of connection {self._label} not read",
            "the connection ended, and many after it",
            "read the port oftener",
            Severity.INFO,
            new=len(self.buffer.ring),
        )


class PullFetcher(InLink):
    """Asks the OutPort when it is read. `waiting`: how many values an OutPort of this process has, else None."""

    def __init__(
        self,
        setup: LinkSetup,
        condition: threading.Condition,
        arrivals: Iterator[int],
        outlet: Outlet,
        waiting: Callable[[], int] | None = None,
    ) -> None:
        super().__init__(setup, condition, arrivals)
        self._outlet: Final = outlet
        self._waiting: Final = waiting

    def is_new(self) -> bool:
        """Whether the OutPort has a value; False where it is in another process: nobody is asked for that."""
        return self._waiting is not None and self._waiting() > 0

    def fetch(self) -> tuple[DataPortStatus, Sample | None]:
        """Ask for a value. CONNECTION_LOST: the port drops the connection. Never raises."""
        try:
            answer, octets = self._outlet.get()
        except PeerLostError as error:
            self.lost_sight(error)
            return DataPortStatus.CONNECTION_LOST, None
        except Exception as error:
            self._find(
                "fetch-failed",
                f"connection {self._label}: nothing fetched",
                f"{type(error).__name__}: {error}",
            )
            self.tell_connector(ConnectorEvent.ON_SENDER_ERROR)
            return DataPortStatus.UNKNOWN_ERROR, None
        if answer is not PortStatus.PORT_OK:
            status, event = FETCHED.get(answer, (DataPortStatus.PORT_ERROR, ConnectorEvent.ON_SENDER_ERROR))
            self.tell_connector(event)
            return status, None
        sample = self._sample(octets)
        if self._stamps_received:
            self._stamp(sample)
        self.tell(DataEvent.ON_RECEIVED, sample)
        self.tell(DataEvent.ON_BUFFER_WRITE, sample)
        return DataPortStatus.PORT_OK, sample

    def _end(self) -> None:
        super()._end()
        self._outlet.close()


def _is_power_of_ten(number: int) -> bool:
    """1, 10, 100, ..."""
    while number and number % 10 == 0:
        number //= 10
    return number == 1
