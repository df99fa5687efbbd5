"""Links without a network, for tests: in memory, in virtual time, deterministic from a seed.

`SimulatedNetwork` loses, duplicates, reorders and delays messages between its endpoints, and can be partitioned. It
owns no clock and needs no asyncio: time is the number given to `SimulatedNetwork.step`, in any one unit (the delays
are in the same). `SimulatedLink` puts a `Link` on such a network, `PairLink` is a link whose peers are plain objects in
the test, and `Recorder` is a `LinkEvents` that keeps what a link tells.

    network = SimulatedNetwork(seed=1, loss=0.1, delay=(0.001, 0.020))
    client = network.endpoint("client")
    agent = network.endpoint("agent", lambda data, sender: agent.send(data.upper(), sender))
    client.send(b"hello", "agent")
    while (now := network.next_event()) is not None:
        network.step(now)
    assert client.receive() == (b"HELLO", "agent")
"""

from __future__ import annotations

import random
from collections import Counter, deque
from collections.abc import Callable, Collection, Hashable
from dataclasses import dataclass, field
from heapq import heapify, heappop, heappush
from typing import ClassVar, TypeAlias

from muros.links._door import NO_PEER, Address, Cause, Link, LinkEvents, Locator

__all__ = [
    "Datagram",
    "Endpoint",
    "PairLink",
    "Peer",
    "Recorder",
    "SimulatedLink",
    "SimulatedNetwork",
]

Receive: TypeAlias = Callable[[bytes, Hashable], None]
Actor: TypeAlias = Callable[[float], "float | None"]

_EVENTS_AT_MOST = 1_000_000
_STUCK_AT_MOST = 10_000
_HELD_BACK_MOST = 4


@dataclass(frozen=True, slots=True)
class Datagram:
    """One message on its way, as `SimulatedNetwork.tap` sees it."""

    sender: Hashable
    receiver: Hashable
    data: bytes
    sent_at: float


class SimulatedNetwork:
    """A network of named endpoints on which messages fare badly, the same way for the same seed.

    Each is a probability for every message: ``loss`` that it never arrives, ``duplicate`` that a second copy
    arrives, ``reorder`` that it is held back, so that others on the way overtake it. ``delay`` is the least and the
    most time on the way; the messages from one endpoint to another keep their order except for reordered ones and
    second copies. ``mtu`` in bytes is the longest message taken. The probabilities and the delay may be changed at
    any time. Every message draws the same number of random values, so that changing one setting leaves the other
    decisions of a seed alone.

    ``tap``, when set, is asked about every message that would leave: False loses it. `counters` counts messages:
    ``sent``, ``delivered``, and by fate ``lost``, ``duplicated``, ``reordered``, ``tapped``, ``parted`` (by a
    partition), ``nowhere`` (no such endpoint), ``too-long``.
    """

    def __init__(
        self,
        seed: int = 0,
        *,
        loss: float = 0.0,
        duplicate: float = 0.0,
        reorder: float = 0.0,
        delay: tuple[float, float] = (0.0, 0.0),
        mtu: int = 65507,
    ) -> None:
        self.loss = loss
        self.duplicate = duplicate
        self.reorder = reorder
        self.delay = delay
        self.mtu = mtu
        self.tap: Callable[[Datagram], bool] | None = None
        self.counters: Counter[str] = Counter()
        self._random = random.Random(seed)
        self._now: float = 0
        self._endpoints: dict[Hashable, Endpoint] = {}
        self._queue: list[tuple[float, float, int, Datagram]] = []
        self._number = 0
        self._latest: dict[tuple[Hashable, Hashable], float] = {}
        self._groups: list[frozenset[Hashable]] = []

    @property
    def now(self) -> float:
        """The time of the last event or step."""
        return self._now

    @property
    def in_flight(self) -> int:
        """Messages on their way."""
        return len(self._queue)

    def endpoint(self, address: Hashable, on_receive: Receive | None = None) -> Endpoint:
        """A new endpoint at ``address``. Its messages go to ``on_receive(data, sender)`` or wait in its inbox.

        Raises ValueError when the address is taken.
        """
        if address in self._endpoints:
            raise ValueError(f"there is an endpoint {address!r} already: close it first")
        made = self._endpoints[address] = Endpoint(self, address, on_receive)
        return made

    def next_event(self) -> float | None:
        """When the next message arrives; None when nothing is on its way."""
        return self._queue[0][0] if self._queue else None

    def step(self, now: float) -> int:
        """Delivers, in order, what arrives until ``now``; returns how many messages did.

        What receivers send meanwhile and would arrive in time is delivered too. Time does not go back: raises
        ValueError.
        """
        if now < self._now:
            raise ValueError(f"time does not go back: step({now}) after {self._now}")
        delivered = 0
        for _ in range(_EVENTS_AT_MOST):
            if not self._queue or self._queue[0][0] > now:
                self._now = now
                return delivered
            self._now, _, _, datagram = heappop(self._queue)
            delivered += self._arrive(datagram)
        raise RuntimeError(f"messages answer each other for ever at {self._now}: give the network a delay")

    def run(self, until: float, *actors: Actor) -> None:
        """Runs the network and ``actors`` in virtual time until ``until``.

        An actor is called with the time whenever something may have changed for it, and returns the time of its next
        deadline or None. Raises RuntimeError when an actor's deadline stays in the past.
        """
        stuck = 0
        while stuck < _STUCK_AT_MOST:
            times = [deadline for actor in actors if (deadline := actor(self._now)) is not None]
            if self._queue:
                times.append(self._queue[0][0])
            if not times or min(times) > until:
                self.step(until)
                return
            stuck = stuck + 1 if min(times) <= self._now else 0
            self.step(max(min(times), self._now))
        raise RuntimeError(f"no progress at {self._now}: an actor's deadline stays in the past")

    def partition(self, *groups: Collection[Hashable]) -> None:
        """Parts the network: endpoints reach only their own group; all that are not named form one more.

        What is on its way across a border is lost. A new partition replaces the last one.
        """
        self._groups = [frozenset(group) for group in groups]
        kept = [entry for entry in self._queue if self.reachable(entry[3].sender, entry[3].receiver)]
        self.counters["parted"] += len(self._queue) - len(kept)
        heapify(kept)
        self._queue = kept

    def heal(self) -> None:
        """Ends the partition."""
        self._groups = []

    def reachable(self, sender: Hashable, receiver: Hashable) -> bool:
        """Whether no partition stands between the two."""
        return self._group(sender) == self._group(receiver)

    def _group(self, address: Hashable) -> int:
        for number, group in enumerate(self._groups):
            if address in group:
                return number
        return -1

    def _send(self, sender: Hashable, receiver: Hashable, data: bytes) -> None:
        draw = self._random.random
        lost, doubled, held = draw() < self.loss, draw() < self.duplicate, draw() < self.reorder
        first, second, back = self._on_the_way(draw()), self._on_the_way(draw()), draw()
        self.counters["sent"] += 1
        datagram = Datagram(sender, receiver, data, self._now)
        fate = self._fate(datagram, lost)
        if fate is not None:
            self.counters[fate] += 1
            return
        rank = 0.0
        arrival = self._now + first
        if held:
            self.counters["reordered"] += 1
            rank = 1.5 + int(back * _HELD_BACK_MOST)
            arrival += second
        else:
            arrival = max(arrival, self._latest.get((sender, receiver), arrival))
            self._latest[sender, receiver] = arrival
        self._schedule(arrival, rank, datagram)
        if doubled:
            self.counters["duplicated"] += 1
            self._schedule(arrival + second, rank, datagram)

    def _fate(self, datagram: Datagram, lost: bool) -> str | None:
        if len(datagram.data) > self.mtu:
            return "too-long"
        if not self.reachable(datagram.sender, datagram.receiver):
            return "parted"
        if self.tap is not None and not self.tap(datagram):
            return "tapped"
        return "lost" if lost else None

    def _on_the_way(self, share: float) -> float:
        least, most = self.delay
        return least + (most - least) * share

    def _schedule(self, arrival: float, rank: float, datagram: Datagram) -> None:
        self._number += 1
        heappush(self._queue, (arrival, self._number + rank, self._number, datagram))

    def _arrive(self, datagram: Datagram) -> int:
        receiver = self._endpoints.get(datagram.receiver)
        if receiver is None:
            self.counters["nowhere"] += 1
            return 0
        self.counters["delivered"] += 1
        receiver._take(datagram.data, datagram.sender)
        return 1


class Endpoint:
    """A place on a `SimulatedNetwork`. Made by `SimulatedNetwork.endpoint`."""

    def __init__(self, network: SimulatedNetwork, address: Hashable, on_receive: Receive | None) -> None:
        self.network = network
        self.address = address
        self.on_receive = on_receive
        self.inbox: deque[tuple[bytes, Hashable]] = deque()

    def send(self, data: bytes | bytearray | memoryview, receiver: Hashable) -> bool:
        """Sends a copy of ``data`` at the network's present time. False when longer than its MTU or closed."""
        if self.network._endpoints.get(self.address) is not self:
            return False
        self.network._send(self.address, receiver, bytes(data))
        return len(data) <= self.network.mtu

    def receive(self) -> tuple[bytes, Hashable] | None:
        """The oldest (data, sender) of the inbox, or None."""
        return self.inbox.popleft() if self.inbox else None

    def close(self) -> None:
        """Leaves the network: what is on its way here goes nowhere. The address is free again."""
        if self.network._endpoints.get(self.address) is self:
            del self.network._endpoints[self.address]

    def _take(self, data: bytes, sender: Hashable) -> None:
        if self.on_receive is not None:
            self.on_receive(data, sender)
        else:
            self.inbox.append((data, sender))


class _TestLink(Link):
    """What a handler raises reaches the test that caused it."""

    def _owner_failed(self, error: Exception) -> None:
        raise error


class SimulatedLink(_TestLink):
    """A link at ``address`` of a simulated network; its peers are the other endpoints. Needs no asyncio."""

    kind: ClassVar[str] = "simulated"

    def __init__(self, network: SimulatedNetwork, address: Hashable = "agent") -> None:
        super().__init__()
        self.network = network
        self.address = address
        self.mtu = network.mtu
        self._endpoint: Endpoint | None = None

    @property
    def name(self) -> str:
        return f"{self.kind} {self.address}"

    def _send(self, message: bytes, address: Address) -> Cause | None:
        if self._endpoint is not None:
            self._endpoint.send(message, address)
        return None

    def _open(self) -> None:
        self._endpoint = self.network.endpoint(self.address, self._deliver)
        self._up(self.name)

    def _close(self) -> None:
        if self._endpoint is not None:
            self._endpoint.close()
            self._endpoint = None


class PairLink(_TestLink):
    """A link in memory: the test makes its peers and moves messages by calls. Nothing is lost, nothing waits.

    ``locators`` is what the link answers for discovery.
    """

    kind: ClassVar[str] = "pair"

    def __init__(self, name: str = "pair", *, mtu: int = 65535, locators: Collection[Locator] = ()) -> None:
        super().__init__()
        self.mtu = mtu
        self._name = name
        self._locators = list(locators)
        self._peers: dict[Address, Peer] = {}

    @property
    def name(self) -> str:
        return self._name

    def locators(self) -> list[Locator]:
        return list(self._locators)

    def peer(self, address: Address = "peer") -> Peer:
        """The peer at ``address``, made at the first call."""
        if address not in self._peers:
            self._peers[address] = Peer(self, address)
        return self._peers[address]

    def _send(self, message: bytes, address: Address) -> Cause | None:
        peer = self._peers.get(address)
        if peer is None:
            return NO_PEER
        peer.received.append(bytes(message))
        return None

    def _open(self) -> None:
        self._up(self.name)

    def _close(self) -> None:
        """Nothing to free: the peers stay, as hosts on a network would."""


class Peer:
    """The other side of a `PairLink`; ``received`` keeps what the link has sent here, oldest first."""

    def __init__(self, link: PairLink, address: Address) -> None:
        self.link = link
        self.address = address
        self.received: deque[bytes] = deque()

    def send(self, message: bytes) -> None:
        """Brings a message to the link; its owner has handled it when this returns."""
        self.link._deliver(bytes(message), self.address)

    def receive(self) -> bytes | None:
        """The oldest message received, or None."""
        return self.received.popleft() if self.received else None

    def leave(self, reason: str = "connection closed by the far end") -> None:
        """Goes away as a closed connection does: the link's owner is told, sending here fails."""
        self.link._peers.pop(self.address, None)
        self.link._gone(self.address, reason)


@dataclass
class Recorder(LinkEvents):
    """Keeps what links tell. ``on_any``, when set, is called after each event, for a test to wake up."""

    messages: list[tuple[bytes, Address]] = field(default_factory=list)
    up: list[str] = field(default_factory=list)
    down: list[str] = field(default_factory=list)
    gone: list[tuple[Address, str]] = field(default_factory=list)
    problems: list[tuple[str, str, str, str, int]] = field(default_factory=list)
    """(code, what, why, remedy, n)."""
    on_any: Callable[[], None] | None = None

    def on_message(self, link: Link, data: bytes, address: Address) -> None:
        self.messages.append((data, address))
        self._woken()

    def on_up(self, link: Link, detail: str) -> None:
        self.up.append(detail)
        self._woken()

    def on_down(self, link: Link, reason: str) -> None:
        self.down.append(reason)
        self._woken()

    def on_gone(self, link: Link, address: Address, reason: str) -> None:
        self.gone.append((address, reason))
        self._woken()

    def on_problem(self, link: Link, code: str, what: str, why: str, remedy: str, n: int) -> None:
        self.problems.append((code, what, why, remedy, n))
        self._woken()

    def _woken(self) -> None:
        if self.on_any is not None:
            self.on_any()
