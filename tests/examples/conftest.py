"""A stage for each test."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from muros.interfaces import board as boards
from tests.dds.domains import free_domain
from tests.examples.stage import TYPES, Stage
from tests.micropython.runtimes import require


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The message classes that a board has."""
    folder = tmp_path_factory.mktemp("board")
    boards.generate(list(TYPES), folder, shapes=True)
    return folder


@pytest.fixture
def stage(board: Path) -> Iterator[Stage]:
    """A stage."""
    with free_domain() as domain:
        made = Stage(board, domain)
        yield made
        made.close()


@pytest.fixture(params=["python", "micropython"])
def on(request: pytest.FixtureRequest) -> str:
    """An interpreter."""
    if request.param == "micropython":
        require("unix")
    name: str = request.param
    return name
