"""Domains on a simulated network, in virtual time: what processes of several computers will be, for tests."""

from typing import Any, TypeVar

from muros.links.testing import Datagram, SimulatedNetwork
from muros.rtps import (
    Addresses,
    DomainCore,
    DomainReport,
    DomainSettings,
    EndpointQos,
    LocalReader,
    LocalWriter,
    Locator,
    ParticipantCore,
    ParticipantEvent,
    Received,
    Reliability,
    udp4,
)

Kind = TypeVar("Kind")

MS = 10**6
SECOND = 10**9

RELIABLE = EndpointQos()
BEST_EFFORT = EndpointQos(reliability=Reliability.BEST_EFFORT)

GROUP = udp4("239.255.0.1", 7400)

TYPE = "std_msgs::msg::dds_::String_"


class Process:
    """One computer with one process, with one domain core. Multicast reaches all others of `world`."""

    def __init__(
        self,
        world: "World",
        number: int,
        *,
        domain: int = 0,
        settings: DomainSettings | None = None,
        addresses: Addresses | None = None,
    ) -> None:
        self.world = world
        self.host = f"10.0.0.{number}"
        self.number = number
        self.meta = udp4(self.host, 7410)
        self.user = udp4(self.host, 7411)
        self.endpoints = [
            world.network.endpoint(at, self._receive) for at in (self.meta, self.user, (number, GROUP))
        ]
        self.addresses = addresses or Addresses(
            metatraffic_unicast=(self.meta,),
            metatraffic_multicast=(GROUP,),
            default_unicast=(self.user,),
            announce_to=(GROUP,),
        )
        self.reports: list[DomainReport] = []
        self.core = DomainCore(
            domain,
            self._transmit,
            self.addresses,
            settings=settings or DomainSettings(),
            report=self.reports.append,
        )
        self.events: dict[bytes, list[ParticipantEvent]] = {}
        self.got: dict[bytes, list[Received]] = {}
        self.is_up = True
        self._made = 0

    @property
    def now(self) -> int:
        return int(self.world.network.now)

    def participant(self, **options: Any) -> ParticipantCore:
        """A new participant. Its events are kept in `events` by its prefix."""
        self._made += 1
        prefix = options.pop(
            "prefix", bytes((self.number, self._made & 0xFF)) + b"prefix%04d" % (self._made >> 8)
        )
        kept = self.events[prefix] = []
        return self.core.participant(prefix, now=self.now, on_event=kept.append, **options)

    def writer(
        self, participant: ParticipantCore, topic: str = "rt/a", qos: EndpointQos = RELIABLE, **options: Any
    ) -> LocalWriter:
        """A new writer."""
        return participant.writer(topic, options.pop("type_name", TYPE), qos, now=self.now, **options)

    def reader(
        self, participant: ParticipantCore, topic: str = "rt/a", qos: EndpointQos = RELIABLE, **options: Any
    ) -> LocalReader:
        """A new reader. What it gets is kept in `got` by its GUID."""
        kept: list[Received] = []
        on_sample = options.pop("on_sample", kept.append)
        made = participant.reader(
            topic, options.pop("type_name", TYPE), qos, on_sample, now=self.now, **options
        )
        self.got[made.guid] = kept
        return made

    def vanish(self) -> None:
        """The computer is switched off."""
        self.is_up = False
        for endpoint in self.endpoints:
            endpoint.close()

    def act(self, _now: float) -> float | None:
        """What is due, as an actor of `SimulatedNetwork.run`."""
        if not self.is_up:
            return None
        deadline = self.core.deadline
        if deadline is not None and deadline <= self.now:
            deadline = self.core.tick(self.now)
        return deadline

    def _transmit(self, datagram: bytes, locator: Locator) -> None:
        if not self.is_up:
            return
        if locator == GROUP:
            for process in self.world.processes:
                self.endpoints[0].send(datagram, (process.number, GROUP))
        else:
            self.endpoints[0].send(datagram, locator)

    def _receive(self, datagram: bytes, sender: Any) -> None:
        self.core.receive(datagram, sender, self.now)


class World:
    """Processes on one network."""

    def __init__(
        self, seed: int = 0, *, delay: tuple[float, float] = (0.1 * MS, 0.5 * MS), **faults: Any
    ) -> None:
        self.network = SimulatedNetwork(seed, delay=delay, **faults)
        self.processes: list[Process] = []

    def process(self, **options: Any) -> Process:
        """A new process."""
        made = Process(self, len(self.processes) + 1, **options)
        self.processes.append(made)
        return made

    def record(self) -> list[Datagram]:
        """Everything that is sent from now on."""
        sent: list[Datagram] = []

        def tap(datagram: Datagram) -> bool:
            sent.append(datagram)
            return True

        self.network.tap = tap
        return sent

    def run(self, span: float) -> None:
        """Let `span` ns pass."""
        self.network.run(self.network.now + span, *[process.act for process in self.processes])


def payload(number: int, size: int = 16) -> bytes:
    """A recognizable payload, encapsulation included; `size` a multiple of 4, since DATA is padded to that."""
    head = b"\0\1\0\0" + number.to_bytes(8, "little")
    return (head * (size // len(head) + 1))[:size]


def of(events: list[Any], kind: type[Kind]) -> list[Kind]:
    """The events of one kind."""
    return [event for event in events if isinstance(event, kind)]
