"""Contexts in virtual time for tests of executors."""

from collections.abc import Iterator

import pytest

from tests.rclc.virtual import WAYS, Bench, InSpace


@pytest.fixture(params=WAYS)
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """Two contexts, on each of the ways."""
    made = WAYS[request.param]()
    yield made
    made.close()


@pytest.fixture
def local() -> Iterator[InSpace]:
    """Two contexts in a space."""
    made = InSpace()
    yield made
    made.close()
