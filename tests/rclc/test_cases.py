"""The acceptance cases of micro-ROS's client library, by id: each has a test on each way that it should go.

Tests are named after what they prove: `test_x13_spin_timer`, `test_a1_b1_a_goal_is_accepted`, `test_e6_to_e11_nulls`.
What pytest collects says which ways they go: those of `tests/board` run on MicroPython too, others by parameters.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
DATA = json.loads((TESTS / "vectors/rmw/acceptance_ids.json").read_text())
ON_BOARDS = ("tests/board/", "tests/micropython/")
WAYS = {"agent": "agent", "local": "space", "dds": "space"}
"""The way that a parameter of a test stands for."""


def spread(first: str, last: str) -> list[str]:
    """All ids from one to another: `spread("X3", "X5")` is X3, X4, X5."""
    return [f"{first[0]}{number}" for number in range(int(first[1:]), int(last[1:]) + 1)]


def ids_of(name: str) -> list[str]:
    """The ids with which the name of a test begins."""
    found: list[str] = []
    rest = name.removeprefix("test_")
    while match := re.match(r"(?:and_)?([a-z]\d+)_(?:to_([a-z]\d+)_)?", rest):
        first, last = match[1].upper(), (match[2] or match[1]).upper()
        found += spread(first, last)
        rest = rest[match.end() :]
    return found


def ways_of(path: str, parameters: str) -> set[str]:
    """The ways that a test goes."""
    ways = {WAYS[word] for word in parameters.split("-") if word in WAYS}
    return ways | {"host"} | ({"board"} if path.startswith(ON_BOARDS) else set())


@pytest.fixture(scope="module")
def proven() -> dict[str, set[str]]:
    """The ways that each id has a test on, of those that pytest collects."""
    named = re.compile(r"^def test_[a-z]\d+_", re.MULTILINE)
    files = [str(path) for path in sorted(TESTS.rglob("test_*.py")) if named.search(path.read_text())]
    words = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", *files]
    done = subprocess.run(words, cwd=TESTS.parent, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    found: dict[str, set[str]] = {}
    for path, name, parameters in re.findall(r"^(\S+)::(test_\w+)(?:\[(.*)\])?$", done.stdout, re.MULTILINE):
        for case in ids_of(name):
            found.setdefault(case, set()).update(ways_of(path, parameters))
    return found


@pytest.mark.parametrize("cases", DATA["cases"], ids=lambda cases: cases["ids"])
def test_each_case_is_proven_on_each_way(cases: dict[str, object], proven: dict[str, set[str]]) -> None:
    first, last = str(cases["ids"]).split("-")
    ways = cases["ways"]
    assert isinstance(ways, list)
    assert set(ways) <= set(DATA["ways"])
    missing = {case: sorted(set(ways) - proven.get(case, set())) for case in spread(first, last)}
    assert {case: lacks for case, lacks in missing.items() if lacks} == {}


@pytest.mark.parametrize(
    ("name", "ids"),
    [
        ("test_x13_spin_timer", ["X13"]),
        ("test_a1_b1_a_goal", ["A1", "B1"]),
        ("test_e6_to_e8_nulls", ["E6", "E7", "E8"]),
        ("test_x2_to_x3_x34_what", ["X2", "X3", "X34"]),
        ("test_r12_and_r13_and_more", ["R12", "R13"]),
        ("test_x_of_x3", []),
        ("test_several_x3_at_once", []),
    ],
)
def test_names_have_ids(name: str, ids: list[str]) -> None:
    assert ids_of(name) == ids


def test_ways_are_read_from_what_is_collected() -> None:
    assert ways_of("tests/rclc/test_x.py", "agent-order0") == {"agent", "host"}
    assert ways_of("tests/rclc_space/test_x.py", "dds") == {"space", "host"}
    assert ways_of("tests/board/test_x.py", "") == {"board", "host"}
