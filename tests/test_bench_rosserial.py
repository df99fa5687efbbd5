"""The benchmark of the rosserial server works and its figures are sane. Speed is not judged here."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="uses pseudoterminals")
def test_every_measure_has_its_row(tmp_path: Path) -> None:
    file = tmp_path / "rows.json"
    command = [sys.executable, "bench/bench_rosserial.py", "--quick", "--json", str(file)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=55, check=False)
    assert done.returncode == 0, done.stderr
    rows = json.loads(file.read_text())
    assert len(rows) == 2 * 15 + 3
    for row in rows:
        if row["what"].endswith(" up") and "delivered" in row:
            assert row["delivered"] == 1
        if "p50 ms" in row:
            assert 0 < row["p50 ms"] <= row.get("p99 ms", row.get("worst ms"))
        if "frames/s" in row:
            assert row["frames/s"] > 0
