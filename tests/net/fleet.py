"""Many clients and one agent on a network that loses, doubles, reorders, delays and parts, in virtual time.

Real client sessions, the real agent core, the real local space; only the wires and the clock are simulated. One seed
decides everything, so that a run can be repeated. Times are milliseconds.
"""

import random
from collections.abc import Callable, Hashable
from typing import Any

from muros.agent import AgentCore, Limits, Port
from muros.agent.profiles import NamedReferences
from muros.client.link import CONNECTED, LOST
from muros.client.qos import Qos
from muros.client.session import Session
from muros.findings import Findings
from muros.links.testing import Endpoint, SimulatedNetwork
from muros.space import open_space
from muros.xrce._types import Buffer

WALL = 1_795_000_000_000_000_000
STEP = 10
"""How exactly clients and network keep their time."""
SPIN = 50
"""A client spins when something has come, and so often."""
EXPECTED = (5, 7, 8, 9, 11)
"""Problems that storms bring: no answer or no agent for a while, samples that are not taken now and written again."""
KEEP_ALL = Qos(reliable=True, keep_all=True)


class Way:
    """A client's transport over the network."""

    def __init__(self, fleet: "Fleet", address: Hashable, mtu: int) -> None:
        self.mtu = mtu
        self.fleet = fleet
        self.address = address
        self.endpoint: Endpoint | None = None

    def open(self) -> bool:
        """Takes its place on the network."""
        if self.endpoint is None:
            self.endpoint = self.fleet.network.endpoint(self.address)
        return True

    def close(self) -> None:
        """Leaves the network."""
        if self.endpoint is not None:
            self.endpoint.close()
            self.endpoint = None

    def send(self, buf: Buffer, off: int, n: int) -> None:
        """Sends to the agent."""
        assert self.endpoint is not None
        assert n <= self.mtu - 4, f"{n} B are more than the client has announced"
        self.endpoint.send(memoryview(buf)[off : off + n], "agent")

    def receive(self, deliver: Callable[[Buffer, int, int], object]) -> int:
        """Delivers what has come."""
        assert self.endpoint is not None
        taken = 0
        while taken < 16 and (got := self.endpoint.receive()) is not None:
            assert len(got[0]) <= self.mtu - 4, f"the agent sent {len(got[0])} B"
            deliver(got[0], 0, len(got[0]))
            taken += 1
        return taken

    def wait(self, timeout: int) -> None:
        """Time passes for everybody."""
        self.fleet.advance(timeout)


class Client:
    """A session that writes a list of samples to one topic, and keeps what it reads of another."""

    def __init__(self, fleet: "Fleet", number: int, **options: Any) -> None:
        self.number = number
        self.way = Way(fleet, f"c{number}", options.pop("mtu", 512))
        self.session = Session(self.way, 0x1000 + number, options.pop("session_id", 0x81), **options)
        self.participant = self.session.participant(f"node{number}")
        self.to_write: list[bytes] = []
        self.got: list[bytes] = []
        self.writer: Any = None
        self.problems: list[str] = []
        self.session.on_problem = self._on_problem

    def writes(self, topic: str, samples: list[bytes]) -> "Client":
        """Writes ``samples`` as fast as they are taken."""
        self.writer = self.session.writer(self.participant, topic, "std_msgs/msg/String", KEEP_ALL)
        self.to_write = samples
        return self

    def reads(self, topic: str) -> "Client":
        """Keeps the samples of ``topic``."""
        self.session.reader(
            self.participant,
            topic,
            "std_msgs/msg/String",
            KEEP_ALL,
            lambda buf, off, n: self.got.append(bytes(buf[off : off + n])),
        )
        return self

    def _on_problem(self, code: int, text: str) -> None:
        if code not in EXPECTED:
            self.problems.append(text)

    @property
    def ready(self) -> bool:
        """Whether everything is created and acknowledged (the agent may be out of sight again meanwhile)."""
        session = self.session
        return (
            session.state in (CONNECTED, LOST)
            and session.pending == 0
            and session.reliable.first == session.reliable.next
        )

    def spin(self, now: int, writing: bool) -> None:
        """Takes what has come, writes what it may."""
        self.session.spin_once(now)
        while writing and self.to_write and self.writer.write_bytes(self.to_write[0]):
            del self.to_write[0]


class Fleet:
    """Clients, an agent, and the weather between them."""

    def __init__(self, seed: int, *, limits: Limits | None = None, **weather: Any) -> None:
        self.seed = seed
        self.random = random.Random(seed)
        self.network = SimulatedNetwork(seed, **weather)
        self.now = 0
        self.findings = Findings()
        self.space = open_space("local:", findings=self.findings, clock=self.wall)
        self.core = AgentCore(
            self.space, NamedReferences(), self.findings, limits=limits or Limits(), wall=self.wall
        )
        self.endpoint = self.network.endpoint("agent", self._to_agent)
        self.port: Port = self.core.attach(self)
        self.clients: list[Client] = []
        self.writing = False
        self.parting = False
        self._due: int | None = 0
        self._healing: int | None = None

    # What the agent needs of a link

    name = "simulated"

    def send(self, message: bytes, address: Any) -> bool:
        """Sends a message to a client."""
        return self.endpoint.send(message, address)

    def describe(self, address: Any) -> str:
        """An address in words."""
        return str(address)

    # Time

    def wall(self) -> int:
        """The wall clock in ns."""
        return WALL + self.now * 1_000_000

    def advance(self, ms: int) -> None:
        """Time passes."""
        until = self.now + ms
        while self.now < until:
            self._step(min(until, self.now + STEP))

    def until(self, condition: Callable[[], bool], at_most: int) -> bool:
        """Time passes until the condition holds; whether it does after ``at_most``."""
        end = self.now + at_most
        while not condition():
            if self.now >= end:
                return False
            self._step(self.now + STEP)
        return True

    def leave(self) -> None:
        """Every client takes leave, one after the other; the others go on meanwhile."""
        while self.clients:
            client = self.clients.pop()
            client.session.close()

    def _step(self, now: int) -> None:
        self.now = now
        if self.parting:
            self._part()
        self.network.step(now)
        for k, client in enumerate(self.clients):
            endpoint = client.way.endpoint
            if (endpoint is not None and endpoint.inbox) or (now + k * STEP) % SPIN == 0:
                client.spin(now, self.writing)
        self.space.tick()
        if self._due is None or self._due <= now or now % SPIN == 0:
            self._due = self.core.tick(now)

    def _to_agent(self, data: bytes, sender: Hashable) -> None:
        self.port.receive(data, sender, self.now)

    def _part(self) -> None:
        """Now and then some clients lose sight of the agent for a while."""
        if self._healing is None:
            if self.random.random() < 0.02:
                gone = self.random.sample(
                    self.clients, self.random.randint(1, max(1, len(self.clients) // 3))
                )
                self.network.partition([client.way.address for client in gone])
                self._healing = self.now + self.random.randint(100, 3_000)
        elif self.now >= self._healing:
            self.network.heal()
            self._healing = None

    def heal(self) -> None:
        """The weather clears up as far as partitions go."""
        self.parting = False
        self._healing = None
        self.network.heal()

    def left_behind(self) -> dict[str, Any]:
        """What the agent still holds, by name; nothing when it is empty."""
        core, graph = self.core, self.space.graph
        held: dict[str, Any] = {
            "clients": core.clients,
            "addresses": self.port.sessions,
            "unacknowledged": core.unacknowledged,
            "fresh": core._fresh,
            "watched": core._watched,
            "attempts": core._attempts,
            "calls": len(core._calls),
            "next tick": core.tick(self.now),
            "participants": graph.participants,
            "writers": graph.writers,
            "readers": graph.readers,
            "on the way": self.network.in_flight,
        }
        return {name: value for name, value in held.items() if value}
