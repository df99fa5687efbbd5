"""The programs of the guides to topics and services do what is said of them."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.test_guides import Guided, programs

LINES = {
    ("docs/topics.md", 0): ["True", "0.5 0.0"],
    ("docs/topics.md", 1): ["hello True"],
    ("docs/services.md", 0): ["66"],
    ("docs/services.md", 1): ["ordered 1", "ordered 2", "['coffee', 'coffee']"],
}


@pytest.fixture
def run(tmp_path: Path) -> Iterator[Callable[[str, int], Guided]]:
    """Runs a program of a document."""
    started: list[Guided] = []

    def start(document: str, number: int) -> Guided:
        started.append(Guided(programs(document)[number], 0, tmp_path))
        return started[-1]

    yield start
    for running in started:
        running.stop()


@pytest.mark.parametrize(("document", "number"), LINES)
def test_it_prints_what_it_must(run: Callable[[str, int], Guided], document: str, number: int) -> None:
    running = run(document, number)
    assert running.end() == (0, "")
    assert running.lines == LINES[document, number]


@pytest.mark.parametrize("document", sorted({document for document, _ in LINES}))
def test_no_program_goes_untested(document: str) -> None:
    assert len(programs(document)) == sum(name == document for name, _ in LINES)
