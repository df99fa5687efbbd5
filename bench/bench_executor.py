"""The executor beside rclpy's SingleThreadedExecutor, in one run: callbacks per second, latency, jitter of timers.

Run from a checkout: python bench/bench_executor.py [--seconds 2] [--runs 3] [--only jitter] [--plots FOLDER]

Each measure is a process of its own; both implementations do the same work, see `_executor_worker.py`. Ours runs
twice: `local:`, within the process, and `dds:`, in the ROS 2 graph. rclpy has no way within the process in Python: its
messages go through its DDS. They take turns, and the best run of each counts. Aim: five times the rate of rclpy.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from bench import _plots as plots  # noqa: E402
from tests.dds import peers  # noqa: E402
from tests.dds.domains import free_domain  # noqa: E402

WORKER = Path(__file__).with_name("_executor_worker.py")
LIMIT = 60.0
"""Seconds that one measure may take."""
AIM = 5.0

RATES = ("timer", "10 timers", "guard condition", "message", "10 messages", "service")
LATENCIES = ("message", "service", "calm message")
JITTERS = ("100 Hz", "1 kHz")
WAYS = {"local": ("muros", "local:"), "dds": ("muros", "dds:{}"), "rclpy": ("rclpy", "dds:{}")}

Row = dict[str, Any]


def main() -> int:
    """Prints the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=2.0, help="how long each measure lasts")
    parser.add_argument("--runs", type=int, default=3, help="of which the best counts")
    parser.add_argument("--only", choices=("rates", "latency", "jitter"), help="one table alone")
    parser.add_argument(
        "--with", dest="ways", default=",".join(WAYS), help="comma-separated: " + ", ".join(WAYS)
    )
    parser.add_argument("--plots", type=Path, help="a folder for the distributions of jitter as SVG")
    parser.add_argument("--json", type=Path, help="write the figures to a file")
    options = parser.parse_args()
    ways = [way for way in options.ways.split(",") if way in WAYS]
    if "rclpy" in ways and (lacking := peers._lacking("jazzy")):
        print(f"without rclpy: {lacking} (tools/setup.sh installs it)")
        ways.remove("rclpy")
    wanted = [
        measure
        for name, table in (("rates", RATES), ("latency", LATENCIES), ("jitter", JITTERS))
        for measure in table
        if options.only in (None, name)
    ]
    rows = measure_all(list(dict.fromkeys(wanted)), ways, options.seconds, options.runs)
    if options.only in (None, "rates"):
        print_rates(rows, ways)
    if options.only in (None, "latency"):
        print_latencies(rows, ways)
    if options.only in (None, "jitter"):
        print_jitter(rows, ways)
    if options.plots:
        draw(rows, ways, options.plots)
    if options.json:
        options.json.write_text(json.dumps([{"measure": m, "way": w, **row} for (m, w), row in rows.items()]))
    return 0


def measure_all(
    measures: list[str], ways: list[str], seconds: float, runs: int
) -> dict[tuple[str, str], Row]:
    """The best run of each measure by each way; the ways take turns."""
    rows: dict[tuple[str, str], Row] = {}
    for measure in measures:
        for _ in range(runs):
            for way in ways:
                row = run(measure, way, seconds)
                best = rows.get((measure, way))
                better = _calmer if measure in JITTERS else _faster
                if best is None or better(row, best):
                    rows[measure, way] = row
    return rows


def run(measure: str, way: str, seconds: float) -> Row:
    """One measure in a process of its own."""
    implementation, url = WAYS[way]
    peer = "jazzy" if implementation == "rclpy" else "cyclone"
    settings = peers.environment(peer, discovery="localhost")
    if implementation == "rclpy":
        del settings["FASTDDS_BUILTIN_TRANSPORTS"]  # as it comes: with shared memory
    else:
        settings["PYTHONPATH"] = str(ROOT / "src")
    with free_domain() as domain:
        words = [implementation, measure, str(seconds), url.format(domain)]
        done = subprocess.run(
            [str(peers.python_of(peer)), str(WORKER), *words],
            env=settings,
            capture_output=True,
            text=True,
            timeout=LIMIT + seconds,
        )
    if done.returncode:
        raise SystemExit(f"{measure} by {way} failed:\n{done.stderr}")
    row: Row = json.loads(done.stdout.splitlines()[-1])
    return row


def print_rates(rows: dict[tuple[str, str], Row], ways: list[str]) -> None:
    """Callbacks per second, and how many times rclpy's that is."""
    print(f"\n{'callbacks/s':<18}" + "".join(f"{way:>12}{'cpu':>9}" for way in ways) + "   beside rclpy")
    for measure in RATES:
        line = f"{measure:<18}"
        for way in ways:
            line += f"{rows[measure, way]['rate']:>12,.0f}{rows[measure, way]['cpu']:>6.1f} us"
        print(line + _ratios(rows, ways, measure, "cpu"))
    print(
        "cpu: microseconds of processor time a callback. Beside rclpy: how many times less of it, which is the rate "
        f"of an\nexecutor that has enough to do. Aim: {AIM:.0f}. In '10 messages' a timer of 1 ms sets the rate."
    )


def print_latencies(rows: dict[tuple[str, str], Row], ways: list[str]) -> None:
    """From publishing to the callback, and from a request to its reply."""
    print(
        f"\n{'latency, us':<18}"
        + "".join(f"{way + ' p50':>12}{'p99':>8}" for way in ways)
        + "   beside rclpy"
    )
    for measure in LATENCIES:
        line = f"{measure:<18}"
        for way in ways:
            line += f"{rows[measure, way]['p50']:>12.0f}{rows[measure, way]['p99']:>8.0f}"
        print(line + _ratios(rows, ways, measure, "p50"))


def print_jitter(rows: dict[tuple[str, str], Row], ways: list[str]) -> None:
    """By how much the time between two calls of a timer differs from its period."""
    print(f"\n{'jitter, us':<10}{'':>8}{'mean':>10}{'p99':>10}{'max':>10}{'missed':>14}")
    for measure in JITTERS:
        for way in ways:
            row = rows[measure, way]
            missed = f"{row['missed']} of {row['calls'] + row['missed']}"
            print(
                f"{measure:<10}{way:>8}{row['mean']:>10.1f}{row['p99']:>10.1f}{row['max']:>10.1f}{missed:>14}"
            )


def draw(rows: dict[tuple[str, str], Row], ways: list[str], folder: Path) -> None:
    """Distributions of jitter, and the rates."""
    folder.mkdir(parents=True, exist_ok=True)
    for measure in JITTERS:
        samples = {way: rows[measure, way]["off"] for way in ways if (measure, way) in rows}
        if samples:
            name = f"jitter-{measure.replace(' ', '').lower()}.svg"
            title = f"Timer at {measure}: deviation from the period"
            (folder / name).write_text(plots.distribution(title, "us", samples, log=True))
    measured = [
        measure for measure in RATES if (measure, ways[0]) in rows and "cpu" in rows[measure, ways[0]]
    ]
    if measured:
        series = {way: [rows[measure, way]["cpu"] for measure in measured] for way in ways}
        svg = plots.bars("Processor time of a callback", "us", measured, series)
        (folder / "callbacks.svg").write_text(svg)


def _ratios(rows: dict[tuple[str, str], Row], ways: list[str], measure: str, key: str) -> str:
    if "rclpy" not in ways:
        return ""
    theirs = rows[measure, "rclpy"][key]
    return "".join(f"   {way} x {theirs / rows[measure, way][key]:.1f}" for way in ways if way != "rclpy")


def _faster(row: Row, best: Row) -> bool:
    return bool(row["rate"] > best["rate"])


def _calmer(row: Row, best: Row) -> bool:
    return bool(row["p99"] < best["p99"])


if __name__ == "__main__":
    sys.exit(main())
