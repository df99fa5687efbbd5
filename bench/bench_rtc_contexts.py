"""A periodic execution context beside a bare thread with absolute deadlines: rate, lateness, processor time.

Run from a checkout: python bench/bench_rtc_contexts.py [--seconds 3] [--runs 5] [--json FILE]

Both call an empty function at 100 Hz and at 1 kHz; "ours" is a component's on_execute in a PeriodicExecutionContext,
"catch up" the same with `catch_up: 50`, "fifo" with `scheduling: fifo:50` where the system permits it. Every measure is
a process of its own; they take turns, so that each meets the same machine. The medians of all runs are shown, and the
best run in brackets. Lateness is how far behind its deadline a call began; what is missed is left out without a
`catch_up`.
Aims: 1000.0 Hz, p99 under 200 us on an idle machine.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, Final

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src"))

RATES: Final = (100, 1000)
WAYS: Final = ("bare", "ours", "catch up", "fifo", "idle")
"""`idle`: ours with nobody active."""
LIMIT: Final = 30.0
"""Seconds that a measure may take beyond its own time."""
COLUMNS: Final = ("p50", "p99", "max")

Row = dict[str, Any]


def main() -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=3.0, help="how long each measure lasts")
    parser.add_argument("--runs", type=int, default=5, help="of each measure")
    parser.add_argument("--json", type=Path, help="write the figures to a file")
    parser.add_argument("--measure", nargs=2, metavar=("WAY", "RATE"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        way, rate = options.measure
        print(json.dumps(measure(way, float(rate), options.seconds)))
        return 0
    rows: dict[tuple[int, str], list[Row]] = {(rate, way): [] for rate in RATES for way in WAYS}
    for _ in range(options.runs):
        for rate, way in rows:
            rows[rate, way].append(run(way, rate, options.seconds))
    show(rows)
    if options.json:
        flat = [{"rate": rate, "way": way, "runs": runs} for (rate, way), runs in rows.items()]
        options.json.write_text(json.dumps(flat))
    return 0


def run(way: str, rate: int, seconds: float) -> Row:
    """One measure in a process of its own."""
    words = [sys.executable, __file__, "--measure", way, str(rate), "--seconds", str(seconds)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=seconds + LIMIT)
    if done.returncode:
        raise SystemExit(f"{way} at {rate} Hz failed:\n{done.stderr}")
    row: Row = json.loads(done.stdout.splitlines()[-1])
    return row


def measure(way: str, rate: float, seconds: float) -> Row:
    """Rate reached, lateness in us, missed calls, and processor time in percent of one processor."""
    return measure_bare(rate, seconds) if way == "bare" else measure_context(way, rate, seconds)


def measure_bare(rate: float, seconds: float) -> Row:
    """What a loop with absolute deadlines can do here."""
    late: list[float] = []

    def loop() -> None:
        start = time.monotonic()
        for number in range(round(rate * seconds)):
            deadline = start + number / rate
            time.sleep(max(0.0, deadline - time.monotonic()))
            late.append(time.monotonic() - deadline)

    begin, cpu = time.monotonic(), time.process_time()
    thread = threading.Thread(target=loop)
    thread.start()
    thread.join()
    cpu, took = time.process_time() - cpu, time.monotonic() - begin
    late.sort()
    last = len(late) - 1
    return {
        "reached": len(late) / seconds,
        "p50": 1e6 * late[last // 2],
        "p99": 1e6 * late[round(last * 0.99)],
        "max": 1e6 * late[-1],
        "missed": 0,
        "cpu": 100 * cpu / took,
    }


def measure_context(way: str, rate: float, seconds: float) -> Row:
    """The same in an execution context, as it measures itself."""
    from muros.rtc.component import Component
    from muros.rtc.contexts import ContextOptions, PeriodicExecutionContext

    class Empty(Component):
        """Does nothing."""

        def on_execute(self, context: int) -> None:
            pass

    component = Empty()
    options = ContextOptions(
        catch_up=50 if way == "catch up" else 0,
        policy="FIFO" if way == "fifo" else "",
        priority=50 if way == "fifo" else 0,
    )
    refused: list[str] = []
    context = PeriodicExecutionContext(
        rate=rate, options=options, report=lambda finding: refused.append(finding.why)
    )
    component.initialize([context])
    begin, cpu = time.monotonic(), time.process_time()
    if way != "idle":
        context.activate_component(component.participation)
    time.sleep(seconds - 0.5 / rate)
    cpu, took = time.process_time() - cpu, time.monotonic() - begin
    found = context.statistics
    component.exit()
    return {
        "reached": found.passes / seconds,
        **{name: 1e6 * getattr(found.deviation, name) for name in COLUMNS},
        "missed": found.missed,
        "refused": refused,
        "cpu": 100 * cpu / took,
    }


def show(rows: dict[tuple[int, str], list[Row]]) -> None:
    """The table: medians of the runs, the best run in brackets."""
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")
    print(
        f"{'rate':>8} {'':<9}{'reached, Hz':>20}" + "".join(f"{name + ', us':>20}" for name in COLUMNS),
        end="",
    )
    print(f"{'cpu, %':>18}{'missed':>8}{'p99 beside bare':>18}")
    for (rate, way), runs in rows.items():
        line = f"{rate:>5} Hz {way:<9}"
        for key, best in (("reached", max), *((name, min) for name in COLUMNS), ("cpu", min)):
            values = [row[key] for row in runs]
            if way == "idle" and key != "cpu":
                line += f"{'-':>20}"
                continue
            digits = 1 if key in ("reached", "cpu") else 0
            shown = f"{statistics.median(values):.{digits}f} ({best(values):.{digits}f})"
            line += f"{shown:>{18 if key == 'cpu' else 20}}"
        line += f"{statistics.median(row['missed'] for row in runs):>8.0f}"
        if way in ("ours", "catch up", "fifo"):
            ours, bare = (statistics.median(row["p99"] for row in rows[rate, one]) for one in (way, "bare"))
            line += f"{ours / bare:>18.2f}"
        print(line)
        for why in sorted({why for row in runs for why in row.get("refused", ())}):
            print(f"{'':>8} {why}")


if __name__ == "__main__":
    sys.exit(main())
