"""The benchmark of data ports works and its figures are sane. Speed is not judged here."""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_every_measure_has_its_row(tmp_path: Path) -> None:
    file = tmp_path / "rows.json"
    command = [sys.executable, "bench/bench_rtc_data.py", "--quick", "--json", str(file)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=55, check=False)
    assert done.returncode == 0, done.stderr
    rows = json.loads(file.read_text())
    assert {(row["where"], row["way"], row["value"]) for row in rows} == {
        (where, way, value)
        for where, ways in (
            ("one process", ("flush", "new", "direct")),
            ("two processes", ("flush", "new", "shared_memory")),
        )
        for way in ways
        for value in ("TimedLong", "64 KiB")
    }
    for row in rows:
        for name in ("ours", "floor"):
            assert 0 < row[f"{name} p50 us"] <= row[f"{name} p99 us"]
            assert row[f"{name} values/s"] > 0
