"""The reference system of the benchmarks counts and connects as it must; its time is virtual here."""

import json
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.reference_system import (
    CAPACITY,
    HOT_PATH,
    Entry,
    Measures,
    Message,
    Statistic,
    System,
    count_primes,
    inputs_of,
    node_names,
    outputs_of,
    topology,
)
from muros.rclc import Context, Executor

ROOT = Path(__file__).parents[1]
FACTS: dict[str, Any] = json.loads((ROOT / "tests/vectors/rmw/reference_system.json").read_text())
MS = 1_000_000


class Running:
    """The system on one executor, in a time that only `advance` moves."""

    def __init__(self) -> None:
        self.now = 0
        self.work: list[int] = []
        self.context = Context("local:")
        self.context.clock = lambda: self.now
        self.system = System(self.context.node, lambda: self.work.append(self.now), lambda: self.now * MS)
        self.executor = Executor(self.context)
        for handle in self.system.handles(node_names()):
            self.executor.add(handle)

    def advance(self, ms: int) -> None:
        """Lets time pass, each ms until nothing is left to do."""
        for _ in range(ms):
            self.now += 1
            while self.executor.spin_some(0):
                pass


@pytest.fixture
def running() -> Iterator[Running]:
    """A system."""
    made = Running()
    yield made
    made.context.close()


@pytest.mark.parametrize(
    ("limit", "count"), [*FACTS["number_cruncher_cases"], (0, 2), (2, 2), (3, 2), (4096, 564)]
)
def test_the_number_cruncher_counts_primes(limit: int, count: int) -> None:
    assert count_primes(limit) == count


def test_statistics_of_the_reference() -> None:
    case = FACTS["stats_case"]
    statistic = Statistic()
    for value in case["values"]:
        statistic.add(value)
    assert statistic.average == case["average"]
    assert statistic.deviation == case["deviation"]
    assert (statistic.least, statistic.greatest, statistic.last) == (case["min"], case["max"], 7)
    assert statistic.line("ms") == "7ms [min=1ms, max=7ms, average=4.25ms, deviation=2.5ms]"


def test_a_statistic_of_little_says_so() -> None:
    statistic = Statistic()
    assert statistic.line() == "no samples"
    statistic.add(3.0)
    assert statistic.line() == "3 [min=3, max=3, average=3, deviation=0]"


def test_a_long_name_is_cut_and_ends_with_a_zero() -> None:
    message = Message()
    message.add(Entry("n" * 100, 1, 2, 3))
    assert message.entries[0].name == "n" * 47
    assert message.serialize()[24 : 24 + 48] == b"n" * 47 + b"\0"


def test_of_many_entries_so_many_are_kept_as_fit() -> None:
    message = Message()
    for i in range(105):
        message.add(Entry(f"node {i}", i, i, 0))
    assert len(message.entries) == CAPACITY == 63
    assert message.entries[-1].name == "node 62"


@given(
    st.lists(
        st.builds(
            Entry,
            st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=47),
            st.integers(0, 2**64 - 1),
            st.integers(0, 2**32 - 1),
            st.integers(0, 2**32 - 1),
        ),
        max_size=63,
    )
)
def test_messages_come_through_as_they_are(entries: list[Entry]) -> None:
    data = Message(entries).serialize()
    assert len(data) == FACTS["message"]["size"]
    got = Message()
    got.read(b"..." + data, 3, len(data))
    assert got.entries == entries


@given(st.binary(max_size=100) | st.binary(min_size=4096, max_size=4096))
def test_other_bytes_are_no_message(data: bytes) -> None:
    message = Message()
    try:
        message.read(data, 0, len(data))
    except ValueError:
        return
    assert len(data) >= 4096
    assert len(message.entries) <= CAPACITY


def test_histories_are_merged_without_repeating_a_node() -> None:
    one = Message([Entry("a", 1, 1, 0), Entry("b", 2, 2, 0)])
    one.merge(Message([Entry("b", 9, 9, 9), Entry("c", 3, 3, 0)]))
    assert one.entries == [Entry("a", 1, 1, 0), Entry("b", 2, 2, 0), Entry("c", 3, 3, 0)]
    assert one.find("c") == Entry("c", 3, 3, 0)
    assert one.find("d") is None


def test_the_topology_is_that_of_the_reference() -> None:
    assert {entry["node"]: entry["period_ms"] / 1000 for entry in FACTS["sensors"]} == topology.SENSORS
    assert {entry["node"]: entry["input"] for entry in FACTS["transforms"]} == topology.TRANSFORMS
    assert {entry["node"]: tuple(entry["inputs"]) for entry in FACTS["fusions"]} == topology.FUSIONS
    (cyclic,) = FACTS["cyclic"]
    assert (cyclic["node"], cyclic["period_ms"] / 1000, tuple(cyclic["inputs"])) == (
        topology.CYCLIC.name,
        topology.CYCLIC.period,
        topology.CYCLIC.inputs,
    )
    assert {
        entry["node"]: tuple(map(tuple, entry["connections"])) for entry in FACTS["intersection"]
    } == topology.INTERSECTION
    assert {entry["node"]: entry["input"] for entry in FACTS["commands"]} == topology.COMMANDS
    assert list(HOT_PATH) == FACTS["hot_path"]["nodes"]
    assert len(node_names()) == 24


def test_publishers_and_subscriptions_of_each_topic(running: Running) -> None:
    graph = running.context.middleware.ground.space.graph  # type: ignore[attr-defined]
    for topic, counts in FACTS["topic_counts"].items():
        seen = graph.topic(f"rt{topic}")
        assert [len(seen.writers), len(seen.readers)] == counts
    listened = Counter(topic for name in node_names() for topic in inputs_of(name))
    for name in node_names():
        for topic in outputs_of(name):
            seen = graph.topic(f"rt/{topic}")
            assert (len(seen.writers), len(seen.readers)) == (1, listened[topic])
            assert listened[topic] > 0, "every output is somebody's input"


def test_a_sample_carries_the_nodes_that_it_passed(running: Running) -> None:
    got: list[Message] = []
    listener = Context("local:")
    listener.node("listener").subscription(Message, "VehicleInterface", got.append)
    executor = Executor(listener)
    for _ in range(3000):
        running.advance(1)
        executor.spin_some(0)
    listener.close()
    passed: set[str] = set()
    for message in got:
        names = [entry.name for entry in message.entries]
        assert len(names) == len(set(names)), "each once"
        assert names[-1] == "VehicleInterface"
        assert all(entry.missed == 0 for entry in message.entries if entry.name in HOT_PATH)
        passed.update(names)
    assert passed == {*node_names()} - {*topology.COMMANDS, "EuclideanClusterSettings"}, "all on the way"


def test_two_runs_are_alike_and_measure_what_must_be(running: Running) -> None:
    running.advance(3000)
    measures = running.system.measures
    assert measures.latency.count > 15
    assert measures.latency.greatest == 0.0, "no time passes in a pass"
    assert (measures.period.least, measures.period.greatest) == (100.0, 100.0)
    assert measures.front_sent == 30
    assert measures.front_through == 30
    assert measures.missed == 0
    again = Running()
    again.advance(3000)
    again.context.close()
    assert again.system.measures == measures
    assert again.work == running.work


def test_what_is_missed_and_late_is_seen() -> None:
    measures = Measures()
    for i in range(20):
        entries = [
            Entry("FrontLidarDriver", i * 100 * MS, i, 0),
            Entry("RearLidarDriver", i * 100 * MS + 2 * MS, i, 0),
            Entry("PointCloudFusion", i * 100 * MS + 3 * MS, i, 1 if i == 15 else 0),
            Entry("ObjectCollisionEstimator", i * 100 * MS + 7 * MS, i, 0),
            Entry("BehaviorPlanner", i * 100 * MS + 10 * MS, 2 * i, 0),
            Entry("LanePlanner", i * 100 * MS + 10 * MS, i, 5),
        ]
        measures.commanded(Message(entries))
    assert measures.lines() == [
        "hot path: FrontLidarDriver -> RearLidarDriver -> PointsTransformerFront -> PointsTransformerRear -> "
        "PointCloudFusion -> RayGroundFilter -> EuclideanClusterDetector -> ObjectCollisionEstimator",
        "hot path latency: 5ms [min=5ms, max=5ms, average=5ms, deviation=0ms]",
        "hot path drops: 0 [min=0, max=1, average=0.091, deviation=0.302]",
        "behavior planner period: 50ms [min=50ms, max=50ms, average=50ms, deviation=0ms]",
    ]
    assert measures.latency.count == 11, "the first 9 do not count"


def test_the_benchmark_reports_and_draws(tmp_path: Path) -> None:
    words = [
        "--seconds",
        "2",
        "--limit",
        "50",
        "--plots",
        str(tmp_path),
        "--json",
        str(tmp_path / "rows.json"),
    ]
    done = subprocess.run(
        [sys.executable, "bench/bench_reference_system.py", *words],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=50,
    )
    assert (done.returncode, done.stderr) == (0, "")
    rows = json.loads((tmp_path / "rows.json").read_text())
    assert list(rows) == ["single", "prioritised", "let", "groups"]
    for name, row in rows.items():
        assert f"\n{name}\n" in done.stdout
        assert any(line.startswith("hot path latency: ") and "ms [min=" in line for line in row["lines"])
        assert row["sent"] > 0
    drawn = {path.name for path in tmp_path.glob("*.svg")}
    assert drawn == {"latencies.svg", "latencies-distribution.svg", "periods.svg", "periods-distribution.svg"}
