"""The ways that tests of programs go."""

from collections.abc import Iterator

import pytest

from muros.rclc import Context
from tests.dds.domains import free_domain
from tests.dds.peers import Peer, require, start
from tests.rclc_space.crew import Crew
from tests.rclc_space.ways import Direct, Stage, ThroughAgent, Way

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
def way(request: pytest.FixtureRequest) -> Way:
    """Each of the ways; a stage or a crew closes it."""
    if request.param == "agent":
        return ThroughAgent()
    return Direct("local:" if request.param == "local" else request.getfixturevalue("dds_url"))


@pytest.fixture
def stage(way: Way) -> Iterator[Stage]:
    """A stage on each of the ways."""
    made = Stage(way)
    yield made
    made.close()


@pytest.fixture
def crew(way: Way) -> Iterator[Crew]:
    """A crew on each of the ways."""
    made = Crew(way)
    yield made
    made.close()


@pytest.fixture(scope="module", params=["jazzy", "kilted"])
def ros(request: pytest.FixtureRequest) -> Iterator[Peer]:
    """A ROS 2 process."""
    require(request.param)
    with start(request.param, discovery="localhost") as peer:
        yield peer


@pytest.fixture
def context(dds_url: str, ros: Peer) -> Iterator[Context]:
    """A context in the domain of a ROS 2 process; what rclpy made goes with it."""
    made = Context(dds_url)
    yield made
    made.close()
    ros.do("reset")
