"""The ways that tests of programs go."""

from collections.abc import Iterator

import pytest

from tests.dds.domains import free_domain
from tests.rclc_space.ways import Direct, Stage, ThroughAgent

WAYS = ["agent", "local", "dds"]


@pytest.fixture
def dds_url(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The URL of a DDS domain that is the test's own, on this machine only."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with free_domain() as domain:
        yield f"dds:{domain}"


@pytest.fixture(params=["local", "dds"])
def url(request: pytest.FixtureRequest) -> str:
    """The URL of a space that is the test's own."""
    if request.param == "local":
        return "local:"
    found: str = request.getfixturevalue("dds_url")
    return found


@pytest.fixture(params=WAYS)
def stage(request: pytest.FixtureRequest) -> Iterator[Stage]:
    """A stage on each of the ways."""
    if request.param == "agent":
        made = Stage(ThroughAgent())
    elif request.param == "local":
        made = Stage(Direct("local:"))
    else:
        made = Stage(Direct(request.getfixturevalue("dds_url")))
    yield made
    made.close()
