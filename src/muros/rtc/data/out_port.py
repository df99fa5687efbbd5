"""OutPorts: values that go, to however many InPorts."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import ClassVar, TypeVar, cast

from muros.findings import Finding
from muros.rtc.codes import DataPortStatus, PortType, ReturnCode
from muros.rtc.data._channel import ChannelSender
from muros.rtc.data._links import Link, OutLink, PullSource, PushReceiver, PushSender
from muros.rtc.data._options import Dataflow, DataOptions, OptionError, Side, Stamp
from muros.rtc.data._port import DIRECT, DataPort
from muros.rtc.data._samples import Outgoing, stamp
from muros.rtc.data._transports import TRANSPORTS, Connection, Inlet, each_offer
from muros.rtc.data._types import DataType
from muros.rtc.ports import PortOwner

__all__ = ["DataOutPort"]

T = TypeVar("T")


class DataOutPort(DataPort[T]):
    """Values of one data type that go to other components.

    A value is encoded once for all connections that want it in the same form. After `write` it may be changed
    and written again: nobody else holds it.
    """

    side: ClassVar[Side] = Side.OUT
    calls: ClassVar[Dataflow] = Dataflow.PUSH
    _kind: ClassVar[PortType] = PortType.DATA_OUT

    def __init__(
        self,
        name: str,
        data_type: DataType[T],
        properties: Mapping[str, str] = {},
        *,
        owner: PortOwner | None = None,
        report: Callable[[Finding], object] | None = None,
        clock: Callable[[], float] = time.monotonic,
        wall: Callable[[], int] = time.time_ns,
    ) -> None:
        super().__init__(name, data_type, properties, owner=owner, report=report, clock=clock, wall=wall)
        self.on_write: Callable[[T], object] | None = None
        """Called with every value before it is sent."""
        self.on_write_convert: Callable[[T], T] | None = None
        """Changes every value before it is sent."""
        self.value: T | None = None
        """What `write_after` writes."""
        self.status: list[DataPortStatus] = []
        """What became of the value written last, by connection (`connector_infos`)."""
        self._out_links: tuple[OutLink, ...] = ()
        self._straight: tuple[Callable[[T], DataPortStatus], OutLink] | None = None
        self._stamps = False

    def write(self, value: T) -> bool:
        """Send `value` to all connections. True: there are some, and each has taken it; `status` tells more.

        DataError where the data type cannot hold the value. Nothing that a receiver does raises here.
        """
        straight = self._straight
        if straight is not None and self.on_write is None and self.on_write_convert is None:
            send, link = straight
            one = send(value)
            self.status = [one]
            if one is DataPortStatus.CONNECTION_LOST:
                self._drop(link.info.connector_id)
            return one is DataPortStatus.PORT_OK
        return self._write(value)

    def write_after(self) -> bool:
        """Write `value`, if there is one. For components that write all ports after they ran."""
        return self.value is not None and self.write(self.value)

    # ---- inside

    def _write(self, value: T) -> bool:
        """Every other way."""
        if self.on_write is not None:
            self._call_back("on_write", self.on_write, value)
        if self.on_write_convert is not None:
            returned, converted = self._call_back("on_write_convert", self.on_write_convert, value)
            if not returned:
                self.status = [DataPortStatus.INVALID_ARGS] * len(self._out_links)
                return False
            value = cast("T", converted)
        links = self._out_links
        if self._stamps:
            stamp(value, self._wall)
        outgoing = Outgoing(value)
        status: list[DataPortStatus] = []
        good = bool(links)
        for link in links:
            one = link.write(outgoing)
            status.append(one)
            if one is not DataPortStatus.PORT_OK:
                good = False
        self.status = status
        if not good:
            self._drop_lost(links, status)
        return good

    def _drop_lost(self, links: tuple[OutLink, ...], status: list[DataPortStatus]) -> None:
        for one, link in zip(status, links, strict=True):
            if one is DataPortStatus.CONNECTION_LOST:
                self._drop(link.info.connector_id)

    def _receiving_link(self, connection: Connection, options: DataOptions) -> Link:
        link = PullSource(self._setup(connection, options))
        if options.interface_type != DIRECT:
            link.offer = TRANSPORTS.pull[options.interface_type].offer_outlet(connection, link.get)
        return link

    def _calling_links(self, connection: Connection, options: DataOptions) -> tuple[Link, ...]:
        """Each InPort of the connection has a connector of its own."""
        if options.interface_type == DIRECT:
            inlets: list[Inlet | PushReceiver] = [*self._links_here(connection.profile, PushReceiver)]
            if not inlets:
                raise OptionError(ReturnCode.RTC_ERROR, "direct: the InPort is in another process")
        else:
            transport = TRANSPORTS.push[options.interface_type]
            inlets = [
                transport.reach_inlet(replace(connection, profile=profile))
                for profile in each_offer(connection.profile)
            ]
        return tuple(PushSender(self._setup(connection, options), inlet) for inlet in inlets)

    def _channel_link(self, connection: Connection, options: DataOptions) -> Link:
        link = ChannelSender(self._setup(connection, options))
        transport = TRANSPORTS.duplex[options.interface_type]
        link.offer = transport.offer_outlet(connection, link.writer.get, link.writer.is_readable)
        return link

    def _reach_channel(self, connection: Connection, options: DataOptions) -> None:
        inlet = TRANSPORTS.duplex[options.interface_type].reach_inlet(connection)
        if isinstance(link := self.link(connection.profile.connector_id), ChannelSender):
            link.writer.reach(inlet)

    def _links_changed(self) -> None:
        links = self._all_links()
        self._out_links = tuple(link for link in links if isinstance(link, (PushSender, PullSource)))
        self._stamps = any(Stamp.ON_WRITE in link.options.stamps for link in self._out_links)
        self._straight = None
        if len(links) == 1 and not self._stamps:
            (only,) = links
            if isinstance(only, PushSender) and (way := only.straight_way()) is not None:
                self._straight = (way, only)
