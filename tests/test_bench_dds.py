"""The benchmark of the dds engine works and its figures are sane: everything arrives. Speed is not judged here."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    path = tmp_path_factory.mktemp("bench") / "rows.json"
    options = ["--seconds", "0.2", "--runs", "1", "--with", "muros,rtps", "--json", str(path)]
    command = [sys.executable, "bench/bench_dds.py", *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=58, check=False)
    assert done.returncode == 0, done.stderr
    read: list[dict[str, Any]] = json.loads(path.read_text())
    return read


def test_every_measure_is_there(rows: list[dict[str, Any]]) -> None:
    measured = [(row["section"], row["size"], row["implementation"]) for row in rows]
    sizes = {"flood": (32, 512, 64_000), "trips": (32, 512), "calm": (512,), "many": (32,)}
    assert measured == [
        (section, size, implementation)
        for section in sizes
        for size in sizes[section]
        for implementation in ("muros", "rtps")
    ]


def test_everything_arrives(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        if row["section"] == "flood":
            assert row["lost"] == 0
            assert row["rate"] > 0


def test_times_are_times(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        if row["section"] == "trips":
            assert 0 < row["p50"] <= row["p99"] < 5_000_000
            assert row["round_trips"] > 0
        if row["section"] == "many":
            assert 0 < row["made"] <= row["matched"]
            assert row["bytes"] > 0
