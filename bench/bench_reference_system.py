"""The Autoware reference system on executors of muros: latency of the hot path, drops, jitter of the planner.

Run from a checkout: python bench/bench_reference_system.py [--seconds 10] [--executors single,prioritised,let]
    [--work 1.0] [--url local:] [--plots FOLDER] [--json FILE]

24 nodes of a car (see `reference_system/`) pass messages of 4096 bytes that carry the history of each sample. `--work`
is what each callback computes, in ms of this machine: with 1 ms they ask for 19 % of a processor, with 4 ms for 75 %.
Each executor runs the system in a process of its own. The lines are those of the reference system; the figures that
follow are its key performance indicators.

single       one executor, in the order of making: sensors, then the others by kind
prioritised  one executor, the hot path added first: the order of adding is the priority
let          one executor in logical execution time: inputs at each period's start, outputs at its end
groups       three threads: the hot path real-time critical, the planner soft real-time, the others best effort
"""

import argparse
import json
import resource
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from bench import _plots as plots  # noqa: E402
from bench.reference_system import HOT_PATH, PLANNER, System, count_primes, node_names  # noqa: E402
from muros.rclc import (  # noqa: E402
    BEST_EFFORT,
    LET,
    REAL_TIME_CRITICAL,
    SOFT_REAL_TIME,
    CallbackGroup,
    Context,
    Executor,
    Threads,
)

PERIOD = 0.005
"""Seconds of a period of the executor in logical execution time."""
LATE = 20.0
"""Seconds that a run may take longer than asked."""

Figures = dict[str, Any]


def main() -> int:
    """Prints a report for each executor, then all side by side."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=10.0, help="how long each runs")
    parser.add_argument("--executors", default=",".join(EXECUTORS), help="comma-separated")
    parser.add_argument("--work", type=float, default=1.0, help="ms that each callback computes")
    parser.add_argument("--url", default="local:", help="the data space")
    parser.add_argument("--plots", type=Path, help="a folder for plots as SVG")
    parser.add_argument("--json", type=Path, help="write the figures to a file")
    parser.add_argument("--run", choices=EXECUTORS, help=argparse.SUPPRESS)
    parser.add_argument("--limit", type=int, help="count primes up to so many, in place of --work")
    options = parser.parse_args()
    limit = options.limit or calibrated(options.work)
    if options.run:
        print(json.dumps(run(options.run, options.url, options.seconds, limit)))
        return 0
    names = options.executors.split(",")
    for name in names:
        if name not in EXECUTORS:
            parser.error(f"there is no executor {name!r}: choose from {', '.join(EXECUTORS)}")
    print(f"work of a callback: primes up to {limit}")
    rows: dict[str, Figures] = {}
    for name in names:
        rows[name] = _in_a_process(name, options.url, options.seconds, limit)
        print(f"\n{name}")
        print("\n".join(f"  {line}" for line in rows[name]["lines"]))
    print_indicators(rows)
    if options.plots:
        draw(rows, options.plots)
    if options.json:
        options.json.write_text(json.dumps(rows))
    return 0


def calibrated(ms: float) -> int:
    """The limit up to which counting primes takes so long here."""
    limit, spent = 64, 0.0
    while spent < ms / 1000:
        limit = limit * 5 // 4
        spent = min(_timed(limit) for _ in range(5))
    return limit


def run(name: str, url: str, seconds: float, limit: int) -> Figures:
    """Runs the system on one executor."""
    context = Context(url)
    system = System(context.node, lambda: count_primes(limit), time.monotonic_ns)
    spin = EXECUTORS[name](context, system)
    cpu, begin = time.process_time(), time.monotonic()
    spin(begin + seconds)
    system.stop()
    spent, cpu = time.monotonic() - begin, time.process_time() - cpu
    context.close()
    measures = system.measures
    return {
        "lines": measures.lines(),
        "cpu": 100.0 * cpu / spent,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "missed": measures.missed,
        "lost": measures.front_sent - measures.front_through,
        "sent": measures.front_sent,
        "worst": measures.latency.greatest,
        "mean": measures.latency.average,
        "jitter": measures.period.deviation,
        "latencies": measures.latencies,
        "periods": measures.periods,
    }


def on_one(context: Context, system: System, names: Iterable[str], **options: Any) -> Executor:
    """One executor for all nodes, in that order."""
    executor = Executor(context, **options)
    for handle in system.handles(names):
        executor.add(handle)
    return executor


def single(context: Context, system: System) -> Callable[[float], object]:
    """In the order of making."""
    return _until(on_one(context, system, node_names()))


def prioritised(context: Context, system: System) -> Callable[[float], object]:
    """The hot path first, the planner next."""
    return _until(on_one(context, system, _important_first()))


def let(context: Context, system: System) -> Callable[[float], object]:
    """The hot path first, in periods: what a callback publishes leaves at the end of the period."""
    executor = on_one(context, system, _important_first(), semantics=LET, period=PERIOD)
    return _until(executor)


def groups(context: Context, system: System) -> Callable[[float], object]:
    """A thread for each real-time class: the hot path, the planner, the others."""
    others = [name for name in node_names() if name not in HOT_PATH and name != PLANNER]
    threads = Threads(context)
    for name, urgency, names in (
        ("hot path", REAL_TIME_CRITICAL, HOT_PATH),
        ("planner", SOFT_REAL_TIME, (PLANNER,)),
        ("others", BEST_EFFORT, others),
    ):
        group = CallbackGroup(name, urgency)
        for handle in system.handles(names):
            group.add(handle)
        threads.assign(group)

    return lambda end: threads.run(end - time.monotonic())


EXECUTORS: dict[str, Callable[[Context, System], Callable[[float], object]]] = {
    "single": single,
    "prioritised": prioritised,
    "let": let,
    "groups": groups,
}


def print_indicators(rows: dict[str, Figures]) -> None:
    """The key performance indicators side by side."""
    print(
        "\nexecutor      cpu %  memory MB  missed  front lidar lost  hot path ms mean   worst  planner jitter ms"
    )
    for name, row in rows.items():
        print(
            f"{name:<12}{row['cpu']:>7.1f}{row['memory']:>11.1f}{row['missed']:>8}"
            f"{row['lost']:>10} of {row['sent']:<5}{row['mean']:>16.2f}{row['worst']:>8.2f}{row['jitter']:>19.3f}"
        )


def draw(rows: dict[str, Figures], folder: Path) -> None:
    """Latency and period over the run, and how both are distributed."""
    folder.mkdir(parents=True, exist_ok=True)
    for key, title, unit in (
        ("latencies", "Latency of the hot path", "ms"),
        ("periods", "Period of the behavior planner", "ms"),
    ):
        series = {name: row[key] for name, row in rows.items()}
        (folder / f"{key}.svg").write_text(plots.lines(title, "time in s", unit, series))
        values = {name: [value for _, value in points] for name, points in series.items()}
        (folder / f"{key}-distribution.svg").write_text(plots.distribution(title, unit, values))


def _important_first() -> list[str]:
    names = [*HOT_PATH, PLANNER]
    return names + [name for name in node_names() if name not in names]


def _until(executor: Executor) -> Callable[[float], object]:
    def spin(end: float) -> None:
        stopper = threading.Timer(end - time.monotonic(), executor.stop)
        stopper.start()
        executor.spin()
        stopper.join()

    return spin


def _timed(limit: int) -> float:
    begin = time.perf_counter()
    count_primes(limit)
    return time.perf_counter() - begin


def _in_a_process(name: str, url: str, seconds: float, limit: int) -> Figures:
    words = ["--run", name, "--url", url, "--seconds", str(seconds), "--limit", str(limit)]
    done = subprocess.run(
        [sys.executable, __file__, *words], capture_output=True, text=True, timeout=seconds + LATE
    )
    if done.returncode:
        raise SystemExit(f"{name} failed:\n{done.stderr}")
    figures: Figures = json.loads(done.stdout.splitlines()[-1])
    return figures


if __name__ == "__main__":
    sys.exit(main())
