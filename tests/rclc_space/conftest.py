"""The ways that tests of programs go."""

from collections.abc import Iterator

import pytest

from tests.rclc_space.ways import Direct, Stage, ThroughAgent, Way

WAYS = ["agent", "local"]


@pytest.fixture(params=WAYS)
def stage(request: pytest.FixtureRequest) -> Iterator[Stage]:
    """A stage on each of the ways."""
    way: Way = ThroughAgent() if request.param == "agent" else Direct("local:")
    made = Stage(way)
    yield made
    made.close()
