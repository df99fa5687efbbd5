"""The benchmark of service ports works and its figures are sane. Speed is not judged here."""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_every_way_is_there(tmp_path: Path) -> None:
    file = tmp_path / "rows.json"
    done = subprocess.run(
        [sys.executable, "bench/bench_rtc_services.py", "--quick", "--json", str(file)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=50,
    )
    assert (done.returncode, done.stderr) == (0, "")
    rows = {row["way"]: row for row in json.loads(file.read_text())}
    assert set(rows) == {"plain", "servant", "methods"}
    assert rows["plain"]["ratio"] == 1
    for row in rows.values():
        assert 0 < row["best"] <= row["median"] <= row["p99"]
    assert "beside plain" in done.stdout
