"""The ping-pong bench of callback groups: its report has upstream's form, and it runs."""

import subprocess
import sys
from pathlib import Path

from bench.bench_groups import Ping, Result, Setting

ROOT = Path(__file__).parents[1]


def test_i1_the_report_has_the_form_of_the_test_bench() -> None:
    pings = [
        Ping(0.01 * number, {"high": 0.01 * number + (0.012 + 0.004 * (number % 2))}) for number in range(950)
    ]
    high = [ping.received["high"] - ping.sent for ping in pings[:940]]
    result = Result(
        Setting(), pings, {"high": high, "low": []}, {"high": 9.5424, "low": 0.0004}, ["no priorities"]
    )
    assert result.lines() == [
        "[ping_node]: Both paths: Sent out 950 of configured 1000 pings, i.e. 95%.",
        "[ping_node]: High prio path: Received 940 pongs, i.e. for 98% of the pings.",
        "[ping_node]: High prio path: Average RTT is 14.0ms.",
        "[ping_node]: High prio path: Jitter of RTT is 2.000ms.",
        "[ping_node]: Low prio path: Received 0 pongs, i.e. for 0% of the pings.",
        "[pong_node]: High priority executor thread ran for 9542ms.",
        "[pong_node]: Low priority executor thread ran for 0ms.",
        "[pong_node]: no priorities",
    ]


def test_i1_the_bench_runs_and_draws(tmp_path: Path) -> None:
    words = "--seconds 0.5 --ping-period 0.02 --high-busyloop 0.001 --low-busyloop 0.001".split()
    done = subprocess.run(
        [sys.executable, "bench/bench_groups.py", *words, "--plots", str(tmp_path)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=50,
        check=True,
    )
    lines = done.stdout.splitlines()
    assert lines[0] == "[pong_node]: Running experiment from now on for 0.5 seconds ..."
    assert lines[1].startswith("[ping_node]: Both paths: Sent out ")
    assert " of configured 25 pings, i.e. " in lines[1]
    assert [line.split(" for ")[0] for line in lines if "thread ran" in line] == [
        "[pong_node]: High priority executor thread ran",
        "[pong_node]: Low priority executor thread ran",
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["groups_distribution.svg", "groups_rtt.svg"]
