"""Computers with dds spaces on a simulated network, in virtual time, and peers that speak as others do."""

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

from muros.findings import Finding, Findings
from muros.rtps import (
    DomainCore,
    DomainReport,
    DomainSettings,
    EndpointQos,
    LocalReader,
    LocalWriter,
    ParticipantCore,
    ParticipantData,
    Received,
)
from muros.rtps import _domain as domain_module
from muros.space import Graph, GraphEvent, Reader, Space, open_space
from tests.rtps.domains import Process, World

MS = 10**6
SECOND = 10**9
EPOCH = 1_795_304_203 * SECOND
"""Wall clock when the world begins."""


class Computer:
    """One process with a dds space, and what it tells."""

    def __init__(self, net: "Net", **options: Any) -> None:
        self.net = net
        self.space: Space = open_space("dds:0", carrier=self._carrier, clock=net.clock, **options)
        self.graph: Graph = self.space.graph
        self.told: list[Finding] = []
        self.events: list[GraphEvent] = []
        self.space.findings.on_finding(self.told.append)
        self.due: int | None = 0
        self.space.on_wake(self._wake)
        self.is_up = True
        self._carriers: list[_Carrier]

    def _carrier(self, number: int, findings: Findings, report: Callable[[DomainReport], None]) -> "_Carrier":
        self.process = self.net.world.process(domain=number, settings=self.net.settings)
        self.process.core._report = report
        return _Carrier(self.process)

    def _wake(self) -> None:
        self.due = self.net.clock()

    def act(self, _now: float) -> float | None:
        """What is due, as an actor of `SimulatedNetwork.run`."""
        if not self.is_up:
            return None
        if self.due is not None and self.due <= self.net.clock():
            self.due = self.space.tick()
        return None if self.due is None else self.due - EPOCH

    def vanish(self) -> None:
        """It is switched off."""
        self.is_up = False
        self.process.vanish()

    @property
    def codes(self) -> list[str]:
        """Codes of what its space has told."""
        return [finding.code for finding in self.told]


class _Carrier:
    """A simulated process as what carries a domain."""

    def __init__(self, process: Process) -> None:
        self.core: DomainCore = process.core
        self._process = process

    def clock(self) -> int:
        return self._process.now

    def open(self, loop: asyncio.AbstractEventLoop) -> None:
        raise NotImplementedError

    def poke(self) -> None:
        raise NotImplementedError

    def close(self) -> None:
        self.core.close(self._process.now)


class Net:
    """A network, and time."""

    def __init__(self, seed: int = 1, settings: DomainSettings | None = None, **faults: Any) -> None:
        self.settings = settings
        self.world = World(seed, **faults)
        self.computers: list[Computer] = []
        self.strangers: list[Process] = []

    def clock(self) -> int:
        """The wall clock of all computers, ns."""
        return EPOCH + int(self.world.network.now)

    def computer(self, **options: Any) -> Computer:
        """A new computer with a space."""
        made = Computer(self, **options)
        self.computers.append(made)
        return made

    def stranger(self, monkeypatch: pytest.MonkeyPatch, vendor: bytes = b"\x01\x0f") -> "Stranger":
        """A new process of somebody else's DDS."""
        process = self.world.process()
        self.strangers.append(process)
        return Stranger(process, vendor, monkeypatch)

    def run(self, span: int = 200 * MS) -> None:
        """Let time pass."""
        actors = [computer.act for computer in self.computers] + [other.act for other in self.strangers]
        self.world.network.run(self.world.network.now + span, *actors)

    def until(self, condition: Callable[[], object], most: int = 30 * SECOND) -> None:
        """Let time pass until it is so."""
        end = self.clock() + most
        while not condition():
            assert self.clock() < end, "it did not become so"
            self.run(10 * MS)


class Stranger:
    """A participant of another vendor, on the level of RTPS."""

    def __init__(self, process: Process, vendor: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
        self.process = process
        with monkeypatch.context() as patch:
            patch.setattr(domain_module, "ParticipantData", partial(ParticipantData, vendor=vendor))
            self.participant: ParticipantCore = process.participant()

    @property
    def now(self) -> int:
        return self.process.now

    def writer(self, topic: str, type_name: str, qos: EndpointQos | None = None) -> LocalWriter:
        """A new writer."""
        return self.process.writer(self.participant, topic, qos or EndpointQos(), type_name=type_name)

    def reader(self, topic: str, type_name: str) -> tuple[LocalReader, list[Received]]:
        """A new reader, and what it gets."""
        made = self.process.reader(self.participant, topic, type_name=type_name)
        return made, self.process.got[made.guid]


def take_all(reader: Reader) -> list[bytes]:
    """The bodies of everything a reader has."""
    bodies = []
    while (sample := reader.take()) is not None:
        bodies.append(sample.data)
    return bodies
