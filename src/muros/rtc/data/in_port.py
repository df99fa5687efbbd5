"""InPorts: values that come, from however many OutPorts."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar, Final, TypeVar

from muros.findings import Finding
from muros.rtc.codes import BufferStatus, DataPortStatus, PortStatus, PortType, ReturnCode
from muros.rtc.data._channel import ASK_AGAIN, ChannelReceiver, Demand
from muros.rtc.data._links import InLink, Link, PullFetcher, PullSource, PushReceiver
from muros.rtc.data._listeners import ConnectorEvent, DataEvent
from muros.rtc.data._options import Dataflow, DataOptions, OptionError, Side
from muros.rtc.data._port import DIRECT, DataPort
from muros.rtc.data._ring import EmptyPolicy, FullPolicy
from muros.rtc.data._samples import Sample, copy_value
from muros.rtc.data._transports import TRANSPORTS, Connection
from muros.rtc.data._types import DataError, DataType
from muros.rtc.ports import PortOwner

__all__ = ["DataInPort"]

ENDED: Final = 8
"""Connections that have ended whose values wait to be read, at most; the oldest go first."""

T = TypeVar("T")


class DataInPort(DataPort[T]):
    """Values of one data type that come from other components.

    Each connection has a buffer of its own with policies of its own. Read without a connector's name, the port gives
    the value that came first of all that wait. Every value read belongs to the reader.

    `initial` is what `read` returns before anything came, else a value of zeros.
    """

    side: ClassVar[Side] = Side.IN
    calls: ClassVar[Dataflow] = Dataflow.PULL
    _kind: ClassVar[PortType] = PortType.DATA_IN

    def __init__(
        self,
        name: str,
        data_type: DataType[T],
        properties: Mapping[str, str] = {},
        *,
        initial: T | None = None,
        owner: PortOwner | None = None,
        report: Callable[[Finding], object] | None = None,
        clock: Callable[[], float] = time.monotonic,
        wall: Callable[[], int] = time.time_ns,
    ) -> None:
        super().__init__(name, data_type, properties, owner=owner, report=report, clock=clock, wall=wall)
        self.on_read: Callable[[], object] | None = None
        """Called before every read."""
        self.on_read_convert: Callable[[T], T] | None = None
        """Changes every value that is read."""
        self.value: T | None = initial
        """What `read_before` read last."""
        self._initial: Final = initial
        self._condition: Final = threading.Condition(threading.Lock())
        self._arrivals: Final = itertools.count(1)
        self._pushed: tuple[PushReceiver, ...] = ()
        self._channels: tuple[ChannelReceiver, ...] = ()
        """Those of `_pushed` that are."""
        self._demand: Final = Demand()
        self._pulled: tuple[PullFetcher, ...] = ()
        self._last: tuple[InLink, Sample] | None = None

    # ---- reading

    def read(self, connector: str = "") -> T:
        """The next value; where there is none, the previous one again. `try_read` also tells which.

        `connector`: name or id of the connection to read from, else all. Never raises: octets that are no value of
        the data type are counted and reported, and the previous value is given.
        """
        return self.try_read(connector)[1]

    def try_read(self, connector: str = "") -> tuple[DataPortStatus, T]:
        """As `read`, with what became of it.

        PORT_OK: a new value, or the previous one where the empty policy is `readback`. BUFFER_EMPTY, BUFFER_TIMEOUT,
        and of a pulled connection RECV_EMPTY, RECV_TIMEOUT: nothing there. PORT_ERROR: malformed octets.
        CONNECTION_LOST: the sender has gone, its connection is dropped. PRECONDITION_NOT_MET: not connected.
        """
        if self.on_read is not None:
            self._call_back("on_read", self.on_read)
        pushed, pulled = self._chosen(connector) if connector else (self._pushed, self._pulled)
        status, link, sample = self._take(pushed, pulled)
        value: Any = None
        if link is not None and sample is not None:
            try:
                value = link.hand_out(sample)
                self._last = (link, sample)
            except DataError:
                with self._condition:
                    link.buffer.ring.forget_last()
                status, sample = DataPortStatus.PORT_ERROR, None
        if sample is None:
            value = self._previous()
        if self.on_read_convert is not None:
            returned, converted = self._call_back("on_read_convert", self.on_read_convert, value)
            value = converted if returned else value
        return status, value

    def is_new(self, names: str | Iterable[str] | None = None) -> bool:
        """Whether a value waits that was not read: at any connection, or at those of these names or ids.

        Pulled connections whose sender is in another process are not asked: False, just read. Those of `csp_channel`
        are: True while a writer waits.
        """
        if names is None:
            for link in self._pushed:
                if link.buffer.ring:
                    return True
            return any(link.is_new() for link in (*self._channels, *self._pulled))
        wanted = (names,) if isinstance(names, str) else tuple(names)
        return any(link.is_new() for name in wanted for kind in self._chosen(name) for link in kind)

    def is_empty(self, names: str | Iterable[str] | None = None) -> bool:
        """Whether no value waits."""
        return not self.is_new(names)

    def new_connectors(self) -> list[str]:
        """Names of the connections at which a value waits."""
        return [link.info.name for link in (*self._pushed, *self._pulled) if link.is_new()]

    def read_before(self) -> bool:
        """Read into `value`; whether it was a new one. For components that read all ports before they run."""
        fresh = self.is_new() or bool(self._pulled or self._channels)
        status, value = self.try_read()
        if fresh and status is DataPortStatus.PORT_OK:
            self.value = value
            return True
        return False

    # ---- inside

    def _chosen(self, name: str) -> tuple[tuple[PushReceiver, ...], tuple[PullFetcher, ...]]:
        if not name:
            return self._pushed, self._pulled
        return (
            tuple(one for one in self._pushed if name in (one.info.name, one.info.connector_id)),
            tuple(one for one in self._pulled if name in (one.info.name, one.info.connector_id)),
        )

    def _take(
        self, pushed: tuple[PushReceiver, ...], pulled: tuple[PullFetcher, ...]
    ) -> tuple[DataPortStatus, InLink | None, Sample | None]:
        """The next value: the oldest that was pushed, else what a sender has that can be asked."""
        if pushed:
            with self._condition:
                taken = self._take_oldest(pushed)
            if taken is not None:
                link = taken[0]
                link.tell(DataEvent.ON_BUFFER_READ, taken[1])
                if link.closed and not link.buffer.ring:
                    with self._links_lock:
                        self._links_changed()
                return DataPortStatus.PORT_OK, *taken
        status = DataPortStatus.PRECONDITION_NOT_MET
        for puller in pulled:
            status, sample = puller.fetch()
            if sample is not None:
                return status, puller, sample
            if status is DataPortStatus.CONNECTION_LOST:
                self._drop(puller.info.connector_id)
        return self._take_of_empty(pushed) if pushed else (status, None, None)

    def _take_of_empty(
        self, pushed: tuple[PushReceiver, ...]
    ) -> tuple[DataPortStatus, InLink | None, Sample | None]:
        """Nothing waits: wait, or read back, as the connection says that was read last."""
        last = self._last[0] if self._last is not None else None
        lead = next((link for link in pushed if link is last), pushed[0])
        channels = [link for link in pushed if isinstance(link, ChannelReceiver)]
        if channels:
            return self._meet(lead, pushed, channels)
        with self._condition:
            buffer = lead.buffer
            if buffer.options.empty_policy is EmptyPolicy.BLOCK:
                waited = buffer.wait(
                    lambda: any(link.buffer.ring for link in pushed), buffer.options.read_timeout
                )
                taken = self._take_oldest(pushed)
                status = (
                    DataPortStatus.BUFFER_TIMEOUT
                    if waited is BufferStatus.TIMEOUT
                    else DataPortStatus.BUFFER_EMPTY
                )
            else:
                status, sample = lead.read_back()
                taken = None if sample is None else (lead, sample)
        return self._told(lead, status, taken)

    def _meet(
        self, lead: PushReceiver, pushed: tuple[PushReceiver, ...], channels: list[ChannelReceiver]
    ) -> tuple[DataPortStatus, InLink | None, Sample | None]:
        """Nothing waits here: see whether a writer does, or wait until one comes, as `lead` says."""
        options = lead.buffer.options
        deadline = self._clock() + options.read_timeout if options.read_timeout > 0 else None
        while True:
            refused = self._demand.refused
            for channel in tuple(channels):
                status = channel.ask()
                if status is DataPortStatus.PORT_OK:
                    break
                if status is not DataPortStatus.BUFFER_EMPTY:
                    channels.remove(channel)
            with self._condition:
                left = ASK_AGAIN if deadline is None else deadline - self._clock()
                waits = options.empty_policy is EmptyPolicy.BLOCK and left > 0 and bool(channels)
                if waits and refused == self._demand.refused and not any(link.buffer.ring for link in pushed):
                    wish = self._demand.wish()
                    self._condition.wait(min(left, ASK_AGAIN))
                    self._demand.withdraw(wish)
                taken = self._take_oldest(pushed)
                if taken is not None or not waits:
                    break
        if taken is None and channels:
            if options.empty_policy is EmptyPolicy.BLOCK:
                status = DataPortStatus.BUFFER_TIMEOUT
            else:
                with self._condition:
                    status, sample = lead.read_back()
                taken = None if sample is None else (lead, sample)
        return self._told(lead, status, taken)

    def _told(
        self, lead: PushReceiver, status: DataPortStatus, taken: tuple[InLink, Sample] | None
    ) -> tuple[DataPortStatus, InLink | None, Sample | None]:
        """What was taken, or `status` why nothing was; the listeners hear of it."""
        if taken is not None:
            taken[0].tell(DataEvent.ON_BUFFER_READ, taken[1])
            return DataPortStatus.PORT_OK, *taken
        timeout = status is DataPortStatus.BUFFER_TIMEOUT
        lead.tell_connector(
            ConnectorEvent.ON_BUFFER_READ_TIMEOUT if timeout else ConnectorEvent.ON_BUFFER_EMPTY
        )
        return status, None, None

    def _take_oldest(self, pushed: tuple[PushReceiver, ...]) -> tuple[InLink, Sample] | None:
        """With the condition held."""
        if len(pushed) == 1:
            oldest = pushed[0]
        else:
            waiting = [(first[1].order, link) for link in pushed if (first := link.buffer.ring.peek())]
            if not waiting:
                return None
            oldest = min(waiting, key=_by_order)[1]
        ring = oldest.buffer.ring
        if not ring:
            return None
        _, sample = ring.take()
        assert sample is not None
        if ring.full_policy is FullPolicy.BLOCK:
            self._condition.notify_all()
        return oldest, sample

    def _previous(self) -> object:
        if self._last is not None:
            link, sample = self._last
            return link.hand_out(sample)
        return copy_value(self._initial) if self._initial is not None else self.data_type.default()

    def _receiving_link(self, connection: Connection, options: DataOptions) -> Link:
        link = PushReceiver(self._setup(connection, options), self._condition, self._arrivals)
        if options.interface_type != DIRECT:
            link.offer = TRANSPORTS.push[options.interface_type].offer_inlet(connection, link.put)
        return link

    def _calling_link(self, connection: Connection, options: DataOptions) -> Link:
        sources = self._links_here(connection.profile, PullSource)
        source = sources[0] if sources else None
        if options.interface_type != DIRECT:
            outlet = TRANSPORTS.pull[options.interface_type].reach_outlet(connection)
        elif source is not None:
            outlet = _DirectOutlet(source)
        else:
            raise OptionError(ReturnCode.RTC_ERROR, "direct: the OutPort is in another process")
        waiting = None if source is None else lambda: source.waiting
        return PullFetcher(self._setup(connection, options), self._condition, self._arrivals, outlet, waiting)

    def _channel_link(self, connection: Connection, options: DataOptions) -> Link:
        link = ChannelReceiver(
            self._setup(connection, options), self._condition, self._arrivals, self._demand, self._drop
        )
        transport = TRANSPORTS.duplex[options.interface_type]
        link.offer = transport.offer_inlet(connection, link.put, link.is_writable)
        return link

    def _reach_channel(self, connection: Connection, options: DataOptions) -> None:
        outlet = TRANSPORTS.duplex[options.interface_type].reach_outlet(connection)
        if isinstance(link := self.link(connection.profile.connector_id), ChannelReceiver):
            link.reach(outlet)

    def _links_changed(self) -> None:
        links = self._all_links()
        # What came before its connection ended can still be read: a sender may write and leave.
        ended = tuple(link for link in self._pushed if link not in links and link.buffer.ring)
        for link in ended[:-ENDED]:
            link.forgotten()
        self._pushed = (*ended[-ENDED:], *(link for link in links if isinstance(link, PushReceiver)))
        self._channels = tuple(link for link in self._pushed if isinstance(link, ChannelReceiver))
        self._pulled = tuple(link for link in links if isinstance(link, PullFetcher))


def _by_order(waiting: tuple[int, PushReceiver]) -> int:
    return waiting[0]


class _DirectOutlet:
    """The way to an OutPort of this process."""

    def __init__(self, source: PullSource) -> None:
        self.get: Final[Callable[[], tuple[PortStatus, bytes]]] = source.get

    def close(self) -> None: ...
