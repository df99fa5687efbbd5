"""A domain on the network: the sockets of one process, and the core they feed, on an asyncio loop.

The loop watches three sockets: what is sent to this process about discovery, samples for it, and the multicast group
where others announce themselves. Readiness empties a socket in a run of up to `NetworkSettings.drain` datagrams.
There is one timer; it is never put back, only brought forward: when it fires early it looks at the core's deadline
and is set again. So a call of the core costs no timer as long as it wants nothing sooner.
"""

import asyncio
import os
import socket
import time
import weakref
from collections.abc import Callable
from typing import Final

from muros.findings import Findings
from muros.rtps._constants import Ports
from muros.rtps._domain import DomainCore
from muros.rtps._domain_settings import DOMAIN_DEFAULTS, NOWHERE, Addresses, DomainSettings
from muros.rtps._news import DomainReport
from muros.rtps._values import Locator, udp4
from muros.rtps.net._environment import NetworkError, NetworkSettings, Range
from muros.rtps.net._interfaces import Interface, Watch, chosen, interfaces, require
from muros.rtps.net._outlets import NetworkCounters, Notice, Sender
from muros.rtps.net._peers import Peers, ports_of
from muros.rtps.net._sockets import Pair, bind_multicast, bind_pair, granted, join, leave, overflown

__all__ = ["Network"]

DATAGRAM: Final = 65536
"""Bytes: more than any UDP datagram has."""
SOURCES: Final = 4096
"""Senders whose locator is remembered."""
ADDRESSES: Final = 16
"""Addresses of this host that peers are told of."""
LOOK_PERIOD: Final = 200_000_000
"""ns between two looks at what the kernel had to throw away, while anything comes."""
ANYWHERE: Final = "0.0.0.0"
LOOPBACK: Final = "127.0.0.1"


class Network:
    """All participants of this process in one domain, on the network.

    Make participants with `core`, passing `clock()` as `now`, and call `poke` after each call of the core. `findings`
    is where it tells what went wrong, at the times of `wall` in seconds; `report` and `domain_settings` are the
    core's. `fault` is for tests: it is asked with each datagram that is received or sent, and True loses it.
    """

    def __init__(
        self,
        settings: NetworkSettings | None = None,
        *,
        clock: Callable[[], int] = time.monotonic_ns,
        wall: Callable[[], float] = time.time,
        findings: Findings | None = None,
        domain_settings: DomainSettings = DOMAIN_DEFAULTS,
        report: Callable[[DomainReport], object] | None = None,
        fault: Callable[[bytes], bool] | None = None,
    ) -> None:
        self.settings: Final = NetworkSettings() if settings is None else settings
        self.clock: Final = clock
        self.findings: Final = Findings() if findings is None else findings
        self.counters: Final = NetworkCounters()
        self._wall = wall
        self._sender = Sender(self.settings, self.counters, self._tell)
        self._peers = Peers(self.settings, self._refresh, self._tell)
        transmit = self._sender.transmit
        self._fault = fault
        if fault is not None:
            lossless = transmit

            def transmit(datagram: bytes, locator: Locator) -> None:
                if not fault(datagram):
                    lossless(datagram, locator)

        self.core: Final = DomainCore(
            self.settings.domain, transmit, NOWHERE, settings=domain_settings, report=report
        )
        self._loop: asyncio.AbstractEventLoop | None = None
        self._closed = False
        self._users = 1
        self._process = os.getpid()
        self._pair: Pair | None = None
        self._multicast: socket.socket | None = None
        self._interfaces: tuple[Interface, ...] = ()
        self._joined: set[int] = set()
        self._watch: Watch | None = None
        self._sources: dict[tuple[str, int], Locator] = {}
        self._overflown: dict[socket.socket, int] = {}
        self._timer: asyncio.TimerHandle | None = None
        self._due = 0
        self._look_at = 0

    @classmethod
    def shared(
        cls, settings: NetworkSettings, loop: asyncio.AbstractEventLoop, *, findings: Findings | None = None
    ) -> "Network":
        """The open network of this process with these settings on `loop`; opened if there is none yet.

        It closes with its last user: each who has got it calls `close` once. Raises `NetworkError`.
        """
        for network in _open:
            if network.settings == settings and network._loop is loop and not network._closed:
                network._users += 1
                return network
        network = cls(settings, findings=findings)
        network.open(loop)
        return network

    @property
    def index(self) -> int | None:
        """The participant index whose ports this process has; None while it has none."""
        return None if self._pair is None else self._pair.index

    @property
    def interfaces(self) -> tuple[Interface, ...]:
        """The network interfaces in use now."""
        return self._interfaces

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        """Binds the sockets and serves them on `loop` from now on; `NetworkError` when that cannot be.

        What was made in the core before is announced now. Opening again on the same loop does nothing; when that
        was closed, another one may follow, and the ports may be other ones then.
        """
        self._check()
        if self._closed:
            raise NetworkError(self._who, "it is closed", "Open a new one.")
        if self._loop is loop:
            return
        if self._loop is not None and self._loop.is_closed():
            self._release()
        if self._loop is not None:
            raise NetworkError(self._who, "it is served by another loop", "Open another one for this loop.")
        if self.settings.range is not Range.OFF:
            missing = require(self.settings.interfaces)
            self._bind(loop)
            for name in missing:
                self._tell(_INTERFACE_MISSING, name, 1)
        self._loop = loop
        _open.add(self)
        if self._pair is not None:
            self._watch = Watch(loop, self._refresh)
            self._use(self._meant())
            self._refresh()
            self._peers.open(loop)
        self.poke()

    def poke(self) -> None:
        """Sees to it that the core gets its time: to be called after every call of it."""
        deadline = self.core.deadline
        if deadline is None or self._loop is None:
            return
        if self._timer is not None:
            if self._due <= deadline:
                return
            self._timer.cancel()
        self._set_timer(deadline)

    def close(self) -> None:
        """Closes the core, which tells everybody, and the sockets; when it is shared, with the last user.

        Closing twice is allowed.
        """
        if self._closed:
            return
        self._users -= 1
        if self._users:
            return
        self._closed = True
        _open.discard(self)
        if self._process != os.getpid():
            return
        self.core.close(self.clock())
        self._release()

    def _release(self) -> None:
        """Lets go of the loop and the sockets."""
        if self._loop is None:
            return
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._watch is not None:
            self._watch.close()
        self._peers.close()
        for sock in self._sockets():
            self._count_overflow(sock)
            if not self._loop.is_closed():
                self._loop.remove_reader(sock)
        self._sender.close()
        for sock in self._sockets():
            sock.close()
        self._pair = self._multicast = self._loop = None
        self._interfaces = ()
        self._joined.clear()
        self._overflown.clear()

    @property
    def _who(self) -> str:
        return f"dds domain {self.settings.domain}"

    def _check(self) -> None:
        if self._process != os.getpid():
            why = f"it belongs to process {self._process}, of which this one is a fork"
            raise NetworkError(
                self._who, why, "Open a network after the fork, or start processes by spawning."
            )

    def _sockets(self) -> tuple[socket.socket, ...]:
        pair = () if self._pair is None else (self._pair.metatraffic, self._pair.user)
        return pair if self._multicast is None else (*pair, self._multicast)

    def _bind(self, loop: asyncio.AbstractEventLoop) -> None:
        settings = self.settings
        ports = Ports(settings.domain)
        meant = self._meant() if settings.interfaces else ()
        inward = settings.secluded or (bool(meant) and all(interface.loopback for interface in meant))
        host = LOOPBACK if inward else ANYWHERE
        self._multicast = bind_multicast(settings.group, ports.multicast)
        try:
            self._pair = bind_pair(ports, host, settings.indices)
        except NetworkError:
            self._multicast.close()
            self._multicast = None
            raise
        for sock in self._sockets():
            got = granted(sock, settings.receive_buffer)
            if got * 4 < settings.receive_buffer:
                self._tell(_small_buffer(got, settings.receive_buffer), "", 1)
            self._overflown[sock] = 0
            loop.add_reader(sock, self._readable, sock, sock.recvfrom)
        self._sender.open(loop, self._pair.user)

    def _meant(self) -> tuple[Interface, ...]:
        return chosen(interfaces(), self.settings.interfaces, secluded=self.settings.secluded)

    def _refresh(self) -> None:
        """Goes by the interfaces and peers as they are now."""
        if self._loop is None:  # closed while a name was looked up
            return
        meant = self._meant()
        if meant != self._interfaces:
            self._use(meant)
        addresses = self._addresses()
        if addresses != self.core.addresses:
            self.core.set_addresses(addresses, self.clock())
            self.poke()

    def _use(self, meant: tuple[Interface, ...]) -> None:
        loop, multicast = self._loop, self._multicast
        assert loop is not None
        assert multicast is not None
        self._interfaces = meant
        inward = self.settings.range is Range.LOCALHOST
        group = [
            interface for interface in meant if interface.multicast and (interface.loopback or not inward)
        ]
        present = {interface.index for interface in group}
        for index in self._joined - present:
            leave(multicast, self.settings.group, index)
        self._joined &= present
        for interface in group:
            if interface.index in self._joined:
                continue
            if join(multicast, self.settings.group, interface):
                self._joined.add(interface.index)
            else:
                self._tell(_NO_MULTICAST, interface.name, 1)
        self._sender.set_interfaces(loop, group)
        if not meant:
            self._tell(_NO_INTERFACE, "", 1)

    def _addresses(self) -> Addresses:
        """Where peers reach this process, and where it looks for them.

        Loopback is given to others only where nothing else is: on another host it would lead them astray, and on
        this host every address of it is reached as quickly. No multicast address is given: announcements come
        through the group of the domain anyway, and the rest comes surer by unicast.
        """
        assert self._pair is not None
        settings = self.settings
        ports = Ports(settings.domain)
        outward = [interface for interface in self._interfaces if not interface.loopback] or self._interfaces
        hosts = [address for interface in outward for address in interface.addresses][:ADDRESSES]
        announce_to = [udp4(settings.group, ports.multicast)]
        if any(interface.loopback for interface in self._interfaces):
            known = ports_of(ports, settings.known_indices)
            own = ports.unicast(self._pair.index)
            announce_to += [udp4(LOOPBACK, port) for port in known if port != own]
        return Addresses(
            metatraffic_unicast=tuple(udp4(host, ports.unicast(self._pair.index)) for host in hosts),
            default_unicast=tuple(udp4(host, ports.user_unicast(self._pair.index)) for host in hosts),
            announce_to=tuple(dict.fromkeys((*announce_to, *self._peers.locators()))),
        )

    def _readable(
        self, sock: socket.socket, recvfrom: Callable[[int], tuple[bytes, tuple[str, int]]]
    ) -> None:
        receive = self.core.receive
        sources = self._sources
        counters = self.counters
        clock = self.clock
        fault = self._fault
        for _ in range(self.settings.drain):
            try:
                datagram, address = recvfrom(DATAGRAM)
            except OSError:  # nothing more, or left over from something sent: then what has come is read next
                break
            counters.received += 1
            counters.received_bytes += len(datagram)
            source = sources.get(address)
            if source is None:
                source = self._source(address)
            if fault is None or not fault(datagram):
                receive(datagram, source, clock())
            if self._closed:
                return
        now = clock()
        if now >= self._look_at:
            self._look_at = now + LOOK_PERIOD
            for each in self._overflown:
                self._count_overflow(each)
        self.poke()

    def _source(self, address: tuple[str, int]) -> Locator:
        if len(self._sources) >= SOURCES:
            self._sources.clear()
        source = self._sources[address] = udp4(*address)
        return source

    def _count_overflow(self, sock: socket.socket) -> None:
        total = overflown(sock)
        new = (total - self._overflown[sock]) & 0xFFFF_FFFF
        if new:
            self._overflown[sock] = total
            self.counters.overflown += new
            self._tell(_OVERFLOW, "", new)

    def _set_timer(self, deadline: int) -> None:
        assert self._loop is not None
        self._due = deadline
        self._timer = self._loop.call_later(max(0, deadline - self.clock()) / 1e9, self._tick)

    def _tick(self) -> None:
        self._timer = None
        now = self.clock()
        deadline = self.core.deadline
        if deadline is not None and deadline <= now:
            self.core.tick(now)
        self.poke()

    def _tell(self, notice: Notice, subject: str, n: int) -> None:
        now = self._wall()
        if not self.findings.again(notice.code, who=self._who, subject=subject, now=now, n=n):
            self.findings.report(
                notice.code,
                who=self._who,
                what=notice.what.replace("{subject}", subject),
                why=notice.why,
                remedy=notice.remedy.replace("{subject}", subject),
                subject=subject,
                n=n,
                now=now,
            )

    def _abandon(self) -> None:
        """In a forked child: lets go of the parent's sockets, without touching the loop's selector, which is shared."""
        for sock in self._sockets():
            sock.close()
        if self._watch is not None:
            self._watch.abandon()
        self._sender.abandon()
        self._loop = None


_open: "weakref.WeakSet[Network]" = weakref.WeakSet()


def _after_fork() -> None:
    for network in list(_open):
        network._abandon()
    _open.clear()


os.register_at_fork(after_in_child=_after_fork)

_OVERFLOW: Final = Notice(
    "dds-receive-buffer-full",
    "{n} datagram{s} lost on arrival",
    "they came faster than they could be handled, and the socket's buffer was full",
    "Allow a larger buffer: sudo sysctl net.core.rmem_max=8388608; or send less often.",
)
_NO_INTERFACE: Final = Notice(
    "dds-no-interface",
    "no network interface to meet others through",
    "none of those that are meant is up",
    "Nothing if one comes up later; else check `ip address` and the names given.",
)
_NO_MULTICAST: Final = Notice(
    "dds-no-multicast",
    "nobody is found by multicast through {subject}",
    "the interface cannot join the group of the domain",
    "Name the hosts to be found in ROS_STATIC_PEERS, or try `ip link set {subject} multicast on`.",
)
_INTERFACE_MISSING: Final = Notice(
    "dds-interface-missing",
    "{subject} is not used",
    "it is not up, has no IPv4 address, or does not exist",
    "Nothing if it comes up later; else check `ip address` and the name given.",
)


def _small_buffer(got: int, wanted: int) -> Notice:
    return Notice(
        "dds-receive-buffer-small",
        "large samples may get lost on arrival",
        f"this system grants a receive buffer of {got // 1024} kB, {wanted // 1024} kB were wanted",
        f"Allow more: sudo sysctl net.core.rmem_max={wanted}.",
    )
