"""bench/bench_rtc_start.py runs, and what it prints holds."""

import re
import subprocess
import sys
from pathlib import Path

from tests.rtc.manager._processes import ENVIRONMENT

BENCH = Path(__file__).parents[3] / "bench" / "bench_rtc_start.py"


def test_it_measures_all_stages() -> None:
    done = subprocess.run(
        [sys.executable, BENCH, "--rounds", "1"], capture_output=True, text=True, timeout=50, env=ENVIRONMENT
    )
    assert (done.returncode, done.stderr) == (0, "")
    lines = re.findall(r"^([^\d\n]+?) +([\d.]+)", done.stdout, re.MULTILINE)
    figures = {name: float(value) for name, value in lines}
    # How long one start takes says nothing on a machine that others load; what it keeps in memory does.
    assert all(figures[name] > 0 for name in ("interpreter", "plain omniORB", "muros"))
    assert (
        0
        < figures["interpreter MB"]
        < figures["import MB"]
        <= figures["manager MB"]
        <= figures["component MB"]
    )
    assert figures["interpreter MB"] < figures["plain omniORB, MB"] < figures["component MB"]
