"""The benchmark of execution contexts works and its figures are sane. Speed is not judged here."""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_every_measure_is_there(tmp_path: Path) -> None:
    file = tmp_path / "rows.json"
    done = subprocess.run(
        [
            sys.executable,
            "bench/bench_rtc_contexts.py",
            "--seconds",
            "0.2",
            "--runs",
            "1",
            "--json",
            str(file),
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=50,
    )
    assert (done.returncode, done.stderr) == (0, "")
    rows = {(row["rate"], row["way"]): row["runs"] for row in json.loads(file.read_text())}
    assert set(rows) == {
        (rate, way) for rate in (100, 1000) for way in ("bare", "ours", "catch up", "fifo", "idle")
    }
    for (rate, way), (row,) in rows.items():
        assert row["reached"] == 0 if way == "idle" else 0 < row["reached"] <= 1.1 * rate
        assert 0 <= row["p50"] <= row["p99"] <= row["max"]
        assert 0 <= row["cpu"] <= 250
    assert "p99 beside bare" in done.stdout
