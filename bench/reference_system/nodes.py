"""The nodes of the reference system on rclc.

A callback stamps the sample first, then works (it counts primes), then publishes. What it missed it knows by the gap in
the sequence of the node before it.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from bench.reference_system import topology
from bench.reference_system.message import Entry, Message
from bench.reference_system.report import Measures
from muros.client import Qos

__all__ = ["Node", "System", "count_primes"]

Work = Callable[[], object]


def count_primes(limit: int) -> int:
    """The number cruncher: how many primes there are up to a limit, by trial division; 2 for limits up to 2."""
    if limit <= 2:
        return 2
    count = 1
    for number in range(3, limit + 1):
        divisor = 2
        while divisor * divisor <= number:
            if number % divisor == 0:
                break
            divisor += 1
        else:
            count += 1
    return count


@dataclass
class Input:
    """A topic that a node listens to."""

    topic: str
    sample: Message | None = None
    sequence: int = 0

    def keep(self, sample: Message) -> None:
        """Has a sample wait."""
        self.sample = sample

    def missed(self, sample: Message) -> int:
        """How many samples did not come before this one."""
        newest = sample.entries[-1].sequence
        gap = max(0, newest - self.sequence - 1)
        self.sequence = newest
        return gap


@dataclass
class Node:
    """A node: its rclc node and what an executor runs of it, its timer first."""

    name: str
    node: Any
    handles: list[Any] = field(default_factory=list)


class System:
    """All nodes, each made by `make_node(name)`; `clock()` gives the ns that samples are stamped with.

    work: what each callback does before it publishes. After `stop` nothing is counted any more.
    """

    def __init__(self, make_node: Callable[[str], Any], work: Work, clock: Callable[[], int]) -> None:
        self.measures = Measures()
        self._work = work
        self._clock = clock
        self._stopped = False
        self.nodes = {name: Node(name, make_node(name)) for name in topology.node_names()}
        for name, period in topology.SENSORS.items():
            self._sensor(name, period)
        for name, topic in topology.TRANSFORMS.items():
            self._path(name, topic, name)
        for name, topics in topology.FUSIONS.items():
            self._fusion(name, topics)
        self._cyclic(topology.CYCLIC)
        for name, paths in topology.INTERSECTION.items():
            for topic, output in paths:
                self._path(name, topic, output)
        for name, topic in topology.COMMANDS.items():
            self._command(name, topic)

    def handles(self, names: Iterable[str]) -> list[Any]:
        """What an executor runs of these nodes, in their order."""
        return [handle for name in names for handle in self.nodes[name].handles]

    def stop(self) -> None:
        """Ends the count."""
        self._stopped = True

    def _sensor(self, name: str, period: float) -> None:
        publish = self._output(name, name)

        def measure() -> None:
            if name == topology.HOT_PATH_ROOTS[0] and not self._stopped:
                self.measures.front_sent += 1
            publish(self._clock(), (), 0)

        self._timer(name, period, measure)

    def _path(self, name: str, topic: str, output: str) -> None:
        source = Input(topic)
        publish = self._output(name, output)
        estimating = output == topology.HOT_PATH_SINK

        def transform(sample: Message) -> None:
            stamp = self._clock()
            self._work()
            missed = source.missed(sample)
            publish(stamp, (sample,), missed)
            if not self._stopped:
                self.measures.missed += missed
            if estimating and not self._stopped:
                self.measures.estimated(sample)

        self._listen(name, topic, transform)

    def _fusion(self, name: str, topics: tuple[str, ...]) -> None:
        inputs = [Input(topic) for topic in topics]
        publish = self._output(name, name)

        def hear(source: Input) -> Callable[[Message], None]:
            def fuse(sample: Message) -> None:
                stamp = self._clock()
                source.keep(sample)
                samples = [other.sample for other in inputs if other.sample is not None]
                if len(samples) < len(inputs):
                    return
                self._work()
                publish(stamp, samples, sum(map(Input.missed, inputs, samples)))
                for other in inputs:
                    other.sample = None

            return fuse

        for source in inputs:
            self._listen(name, source.topic, hear(source))

    def _cyclic(self, cyclic: topology.Cyclic) -> None:
        inputs = [Input(topic) for topic in cyclic.inputs]
        publish = self._output(cyclic.name, cyclic.name)

        def plan() -> None:
            stamp = self._clock()
            self._work()
            fresh = [(source, source.sample) for source in inputs if source.sample is not None]
            missed = sum(source.missed(sample) for source, sample in fresh)
            publish(stamp, [sample for _, sample in fresh], missed)
            for source, _ in fresh:
                source.sample = None

        self._timer(cyclic.name, cyclic.period, plan)
        for source in inputs:
            self._listen(cyclic.name, source.topic, source.keep)

    def _command(self, name: str, topic: str) -> None:
        def act(sample: Message) -> None:
            if not self._stopped and sample.find(topology.PLANNER) is not None:
                self.measures.commanded(sample)

        self._listen(name, topic, act, depth=10)

    def _output(self, name: str, topic: str) -> Callable[[int, Iterable[Message], int], None]:
        """What publishes a sample with the histories of others and an entry of its own."""
        publisher = self.nodes[name].node.publisher(Message, topic, Qos(depth=1))
        sequence = 0

        def publish(stamp: int, samples: Iterable[Message], missed: int) -> None:
            nonlocal sequence
            message = Message()
            for sample in samples:
                message.merge(sample)
            message.add(Entry(name, stamp, sequence, missed))
            sequence += 1
            publisher.publish(message)

        return publish

    def _listen(self, name: str, topic: str, callback: Callable[[Message], object], depth: int = 1) -> None:
        node = self.nodes[name]
        node.handles.append(node.node.subscription(Message, topic, callback, Qos(depth=depth)))

    def _timer(self, name: str, period: float, callback: Callable[[], object]) -> None:
        node = self.nodes[name]
        node.handles.append(node.node.timer(period, callback))
