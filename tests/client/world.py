"""A world in virtual time: clients, an agent core and a network on which messages fare badly.

Times are milliseconds. Everything is deterministic from the seed of the network.
"""

from collections.abc import Callable, Hashable
from typing import Any

from muros.agent import AgentCore, Event, Limits, Port
from muros.agent.profiles import NamedReferences
from muros.client import Session
from muros.client._types import Deliver
from muros.findings import Findings
from muros.links.testing import Endpoint, SimulatedNetwork
from muros.space import Qos, Reader, Topic, Writer, open_space
from muros.xrce._types import Buffer

WALL = 1_795_000_000_000_000_000
STRING = "std_msgs::msg::dds_::String_"
DISCARD = 100
"""Messages that wait at a client before more are dropped, as a socket's buffer does."""


class SimulatedTransport:
    """A client's way over a simulated network. ``fault``: what the next receive or send raises, once."""

    def __init__(
        self, network: SimulatedNetwork, address: Hashable, agent: Hashable = "agent", mtu: int = 512
    ) -> None:
        self.mtu = mtu
        self.address = address
        self.agent = agent
        self.network = network
        self.fault: OSError | None = None
        self.openable = True
        self.opened = 0
        self.log: list[tuple[str, bytes]] = []
        self.on_wait: Callable[[int], None] | None = None
        self._endpoint: Endpoint | None = None

    def open(self) -> bool:
        """Takes its place on the network."""
        if self._endpoint is None and self.openable:
            self._endpoint = self.network.endpoint(self.address)
            self.opened += 1
        return self._endpoint is not None

    def close(self) -> None:
        """Leaves it."""
        if self._endpoint is not None:
            self._endpoint.close()
            self._endpoint = None

    def move(self, address: Hashable) -> None:
        """The same client is seen from another address."""
        self.close()
        self.address = address
        self.open()

    def send(self, buf: Buffer, off: int, n: int) -> None:
        """Sends a message to the agent; a fault loses it and shows in the next receive."""
        if self.fault is not None:
            return
        assert n <= self.mtu - 4, f"a message of {n} B is longer than what was announced"
        assert self._endpoint is not None
        message = bytes(memoryview(buf)[off : off + n])
        self.log.append(("c>a", message))
        self._endpoint.send(message, self.agent)

    def receive(self, deliver: Deliver) -> int:
        """Delivers up to 16 messages."""
        self._fail()
        assert self._endpoint is not None
        taken = 0
        while taken < 16 and (got := self._endpoint.receive()) is not None:
            self.log.append(("a>c", got[0]))
            deliver(got[0], 0, len(got[0]))
            taken += 1
        return taken

    def wait(self, timeout: int) -> None:
        """Lets virtual time pass."""
        if self.on_wait is not None:
            self.on_wait(timeout)

    def _fail(self) -> None:
        if self.fault is not None:
            fault, self.fault = self.fault, None
            raise fault


class Outlet:
    """The agent's link on the network."""

    name = "simulated"

    def __init__(self, network: SimulatedNetwork, receive: Callable[[bytes, Hashable], None]) -> None:
        self._endpoint = network.endpoint("agent", receive)

    def send(self, message: bytes, address: Any) -> bool:
        """Sends a whole message."""
        return self._endpoint.send(message, address)

    def describe(self, address: Any) -> str:
        """An address in words."""
        return str(address)

    def close(self) -> None:
        """Leaves the network."""
        self._endpoint.close()


class World:
    """Time, a network, an agent and its space."""

    def __init__(self, seed: int = 0, **network: Any) -> None:
        network.setdefault("delay", (1, 3))
        self.network = SimulatedNetwork(seed, **network)
        self.now = 0
        self.sessions: list[Session] = []
        self.findings = Findings()
        self.events: list[Event] = []
        self.space = open_space("local:", findings=self.findings, clock=lambda: WALL + self.now * 1_000_000)
        self.participant = self.space.participant("host")
        self.start_agent()

    def start_agent(self, **limits: Any) -> None:
        """Starts an agent that knows nobody."""
        self.core = AgentCore(
            self.space,
            NamedReferences(),
            self.findings,
            limits=Limits(**limits),
            wall=lambda: WALL + self.now * 1_000_000,
        )
        self.core.on_event = self.events.append
        self.outlet = Outlet(self.network, lambda data, source: self.port.receive(data, source, self.now))
        self.port: Port = self.core.attach(self.outlet)

    def stop_agent(self) -> None:
        """The agent's process is gone: nobody says goodbye."""
        self.outlet.close()
        for session in list(self.core.clients.values()):
            session.close()

    def client(self, address: str = "client", mtu: int = 512, **arguments: Any) -> Session:
        """A session on the network; its clock is the world's."""
        transport = SimulatedTransport(self.network, address, mtu=mtu)
        transport.on_wait = self.idle
        arguments.setdefault("client_key", 0xAABBCCDD)
        session = Session(transport, **arguments)
        self.sessions.append(session)
        return session

    def run(self, ms: int, step: int = 5, every: Callable[[int], object] | None = None) -> None:
        """Lets ``ms`` pass; ``every`` is called with the time at each step."""
        end = self.now + ms
        while self.now < end:
            self.now += step
            if self.network.now < self.now:
                self.network.step(self.now)
            self.core.tick(self.now)
            self.space.tick()
            for session in self.sessions:
                session.spin_once(self.now)
            if every is not None:
                every(self.now)

    def idle(self, ms: int) -> None:
        """Lets ``ms`` pass while no client runs."""
        sessions, self.sessions = self.sessions, []
        self.run(ms)
        self.sessions = sessions

    def until(self, condition: Callable[[], object], ms: int = 10_000, step: int = 5) -> int:
        """Lets time pass until ``condition`` holds, at most ``ms``; how long that took."""
        start = self.now
        while not condition():
            assert self.now - start < ms, f"it did not come to pass within {ms} ms"
            self.run(step, step)
        return self.now - start

    def reader(self, topic: str, qos: str = "default") -> tuple[list[bytes], Reader]:
        """A reader in the space and what it gets."""
        got: list[bytes] = []

        def take(reader: Reader) -> None:
            while (sample := reader.take()) is not None:
                got.append(sample.data)

        return got, self.participant.reader(Topic(topic, STRING), Qos.preset(qos), take)

    def writer(self, topic: str, qos: str = "default") -> Writer:
        """A writer in the space."""
        return self.participant.writer(Topic(topic, STRING), Qos.preset(qos))
