"""What tests with foreign peers share: a domain for each test, a peer's process for several."""

from collections.abc import Callable, Iterator

import pytest

from tests.dds.domains import Domain, free_domain
from tests.dds.peers import Peer, start
from tests.dds.rig import Rig

PeerStarter = Callable[[str], Peer]


@pytest.fixture
def domain() -> Iterator[Domain]:
    """A domain of the test's own."""
    with free_domain() as number:
        yield number


@pytest.fixture(scope="module")
def running() -> Iterator[PeerStarter]:
    """Peers by name, started when first asked for, that stay for the tests of one module."""
    peers: dict[str, Peer] = {}

    def peer(name: str) -> Peer:
        known = peers.get(name)
        if known is None or known.process.poll() is not None:
            known = peers[name] = start(name)
        return known

    yield peer
    for known in peers.values():
        with known:
            pass


@pytest.fixture
def peer(running: PeerStarter) -> Iterator[PeerStarter]:
    """Peers by name, as good as new: what a test made in them is taken away after it."""
    used: dict[str, Peer] = {}

    def fetch(name: str) -> Peer:
        used[name] = running(name)
        return used[name]

    yield fetch
    for known in used.values():
        if known.process.poll() is None:
            if known.unanswered:
                known.kill()
            else:
                known.do("reset")


@pytest.fixture
def rig() -> Iterator[Rig]:
    """Our side."""
    with Rig() as ours:
        yield ours
