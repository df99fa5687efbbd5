"""The benchmark of the executor works and its figures are sane. Speed is not judged here."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
COUNTED = ("timer", "10 timers", "guard condition", "message", "10 messages", "service", "calm message")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What it left."""
    path = tmp_path_factory.mktemp("bench")
    options = ["--seconds", "0.2", "--runs", "1", "--with", "local,dds", "--plots", str(path)]
    done = subprocess.run(
        [sys.executable, "bench/bench_executor.py", *options, "--json", str(path / "rows.json")],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=58,
    )
    assert (done.returncode, done.stderr) == (0, "")
    (path / "said").write_text(done.stdout)
    return path


def test_every_measure_is_there(folder: Path) -> None:
    rows: list[dict[str, Any]] = json.loads((folder / "rows.json").read_text())
    wanted = {(measure, way) for measure in (*COUNTED, "100 Hz", "1 kHz") for way in ("local", "dds")}
    assert {(row["measure"], row["way"]) for row in rows} == wanted
    for row in rows:
        if row["measure"] in COUNTED:
            assert row["rate"] > 0
            assert row["cpu"] > 0
            assert row.get("p50", 0) <= row.get("p99", 0)
        else:
            assert 0 < row["mean"] <= row["max"]
            assert row["calls"] + row["missed"] >= 19


def test_it_is_said_and_drawn(folder: Path) -> None:
    said = (folder / "said").read_text()
    for title in ("callbacks/s", "latency, us", "jitter, us"):
        assert f"\n{title}" in said
    assert "nan" not in said
    drawn = {path.name for path in folder.glob("*.svg")}
    assert drawn == {"jitter-100hz.svg", "jitter-1khz.svg", "callbacks.svg"}
