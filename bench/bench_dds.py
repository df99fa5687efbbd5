"""muros in the ROS 2 graph beside rclpy and cyclonedds-python, in one run on this machine's loopback.

Run from a checkout: python bench/bench_dds.py [--seconds 2] [--only trips] [--with muros,rclpy] [--json FILE]

Every measure has two processes that talk through DDS, both of one implementation: `muros` is the space engine `dds`,
`rtps` the RTPS core with its sockets and no space, `bare` datagrams under asyncio without any protocol (round trips
only: the floor of whatever is written in Python); rclpy is ROS 2 Jazzy's, cyclone is cyclonedds-python under asyncio.
The peers are those of the tests (tools/setup.sh fetches them); what is not installed is left out. Samples are
std_msgs/String, reliable, keep all, so that every one that is written also arrives. The last column compares
muros with the others; times are of the wall clock, CPU is of the process named.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from select import select
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.dds import peers  # noqa: E402
from tests.dds.domains import free_domain  # noqa: E402

WORKER = Path(__file__).with_name("_dds_worker.py")
LIMIT = 40.0
"""Seconds that a step may take."""

OURS = ("muros", "rtps", "bare")
PEERS = {"muros": "cyclone", "rtps": "cyclone", "bare": "cyclone", "cyclone": "cyclone", "rclpy": "jazzy"}
"""Whose environment each implementation runs in."""


class Worker:
    """A process of the benchmark."""

    def __init__(self, implementation: str, role: str, domain: int, size: int, seconds: float) -> None:
        peer = PEERS[implementation]
        settings = peers.environment(peer, discovery="localhost")
        if implementation == "rclpy":
            del settings["FASTDDS_BUILTIN_TRANSPORTS"]  # as it comes: with shared memory
        else:
            settings["PYTHONPATH"] = str(ROOT / "src")
        self._what = f"{implementation} as {role}"
        words = (implementation, role, str(domain), str(size), str(seconds))
        self._process = subprocess.Popen(
            [str(peers.python_of(peer)), str(WORKER), *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL if implementation == "rclpy" else None,
            env=settings,
            text=True,
        )

    def hear(self) -> Any:
        """The next thing it says."""
        assert self._process.stdout is not None
        if not select([self._process.stdout], [], [], LIMIT)[0]:
            raise TimeoutError(f"{self._what} said nothing for {LIMIT:.0f} s")
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"{self._what} has ended")
        return json.loads(line)

    def end(self, last: object = "") -> Any:
        """Tells it something and closes its input; what it says then."""
        assert self._process.stdin is not None
        self._process.stdin.write(str(last))
        self._process.stdin.close()
        return self.hear()

    def kill(self) -> None:
        """However it fares, it is gone after this."""
        try:
            self._process.wait(3)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            pipe.close()


@contextmanager
def pair(
    implementation: str, roles: tuple[str, str], size: int, seconds: float
) -> Iterator[tuple[Worker, Worker]]:
    """Two that talk; the first is ready when the second begins."""
    with free_domain() as domain:
        first = Worker(implementation, roles[0], domain, size, seconds)
        try:
            if first.hear() != "ready":
                raise RuntimeError(f"{implementation} {roles[0]} does not begin")
            second = Worker(implementation, roles[1], domain, size, seconds)
            try:
                yield first, second
            finally:
                assert second._process.stdin is not None
                second._process.stdin.close()
                second.kill()
        finally:
            assert first._process.stdin is not None
            first._process.stdin.close()
            first.kill()


def flood(implementation: str, size: int, seconds: float) -> dict[str, float]:
    """Samples a second flat out, and what one costs on each side."""
    return _one_way(implementation, "source", size, seconds)


def trips(implementation: str, size: int, seconds: float) -> dict[str, float]:
    """Round trips, in microseconds."""
    with pair(implementation, ("echo", "ping"), size, seconds) as (_, ping):
        said: dict[str, float] = ping.hear()
    return said


def calm(implementation: str, size: int, seconds: float) -> dict[str, float]:
    """CPU of a sample on both sides at a thousand a second."""
    return _one_way(implementation, "calm", size, seconds)


def _one_way(implementation: str, role: str, size: int, seconds: float) -> dict[str, float]:
    with pair(implementation, ("sink", role), size, seconds) as (sink, source):
        sent = source.hear()["sent"]
        received = sink.end(sent)
        cpu = source.end()["cpu"]
    return {
        "rate": received["received"] / received["seconds"],
        "write": cpu / sent * 1e6,
        "read": received["cpu"] / received["received"] * 1e6,
        "lost": sent - received["received"],
    }


def many(implementation: str, size: int, seconds: float) -> dict[str, float]:
    """Two processes with 1000 endpoints each, all matched with the other's."""
    with pair(implementation, ("one_side", "other_side"), size, seconds) as (_, other):
        if other.hear() != "ready":
            raise RuntimeError(f"{implementation} does not begin")
        said: dict[str, float] = other.hear()
    return said


SECTIONS: dict[
    str, tuple[Callable[..., dict[str, float]], tuple[int, ...], dict[str, tuple[str, str, bool]]]
] = {
    "flood": (
        flood,
        (32, 512, 64_000),
        {
            "rate": ("samples a second", "{:10,.0f}", True),
            "write": ("us CPU to write", "{:10.1f}", False),
            "read": ("us CPU to read", "{:10.1f}", False),
        },
    ),
    "trips": (
        trips,
        (32, 512),
        {"p50": ("us round trip p50", "{:10.0f}", False), "p99": ("us round trip p99", "{:10.0f}", False)},
    ),
    "calm": (
        calm,
        (512,),
        {
            "write": ("us CPU to write at 1 kHz", "{:10.1f}", False),
            "read": ("us CPU to read at 1 kHz", "{:10.1f}", False),
        },
    ),
    "many": (
        many,
        (32,),
        {
            "made": ("s to make 1000 endpoints", "{:10.2f}", False),
            "matched": ("s until all are matched", "{:10.2f}", False),
            "idle": ("share of a CPU when idle", "{:10.4f}", False),
            "bytes": ("bytes of memory for them", "{:10,.0f}", False),
        },
    ),
}
"""Measure, sizes in bytes, and for each figure its name, how to print it, and whether more is better."""


def main() -> None:
    """Print one line for each figure."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=2.0, help="duration of each measure")
    parser.add_argument(
        "--runs", type=int, default=2, help="runs of each measure; the best of each figure counts"
    )
    parser.add_argument("--only", choices=SECTIONS, action="append", help="these sections")
    parser.add_argument("--with", dest="those", default=",".join(PEERS), help="these implementations")
    parser.add_argument("--json", type=Path, help="write the figures there")
    options = parser.parse_args()
    those = [name for name in options.those.split(",") if _installed(name)]
    rows = []
    print(f"{'':38}" + "".join(f"{name:>12}" for name in those) + "   muros is better by")
    for section in options.only or SECTIONS:
        measure, sizes, figures = SECTIONS[section]
        measured = [name for name in those if name != "bare" or section == "trips"]
        for size in sizes:
            runs = [
                {name: measure(name, size, options.seconds) for name in measured} for _ in range(options.runs)
            ]
            got = {name: _best([run[name] for run in runs], figures) for name in measured}
            rows += [{"section": section, "size": size, "implementation": n, **got[n]} for n in got]
            for key, (label, form, more) in figures.items():
                values = {name: got[name][key] for name in measured}
                line = "".join(f"{form.format(values[n]) if n in values else '':>12}" for n in those)
                print(f"{label + f', {size} B':38}{line}   {_compared(values, more)}", flush=True)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))


def _best(runs: list[dict[str, float]], figures: dict[str, tuple[str, str, bool]]) -> dict[str, float]:
    """The best of each figure."""
    return {
        key: (max if key in figures and figures[key][2] else min)(run[key] for run in runs) for key in runs[0]
    }


def _compared(values: dict[str, float], more: bool) -> str:
    """How muros stands beside the others."""
    own = values.get("muros")
    ratios = []
    for name, value in values.items():
        if name in OURS or not own or not value:
            continue
        ratio = own / value if more else value / own
        ratios.append(f"{ratio:.2f} x {name}")
    return ", ".join(ratios)


def _installed(name: str) -> bool:
    if name in OURS:
        return True
    lacking = peers._lacking(PEERS[name])
    if lacking:
        print(f"{name} is left out: {lacking}")
    return not lacking


if __name__ == "__main__":
    main()
