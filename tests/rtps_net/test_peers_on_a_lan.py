"""Other people's DDS on another host, or on one that has a network: each side as it comes out of the box."""

import pytest

from tests.dds import peers
from tests.rtps_net import namespaces


@pytest.mark.parametrize("what", ["subnet", "static_peer", "known_by_the_peer"])
@pytest.mark.parametrize("peer", ["jazzy", "kilted"])
def test_ros_on_another_host(peer: str, what: str) -> None:
    peers.require(peer)
    namespaces.run(f"tests.rtps_net.peer_hosts:{what}", peer)


def test_cyclone_on_another_host() -> None:
    peers.require("cyclone")
    namespaces.run("tests.rtps_net.peer_hosts:subnet", "cyclone")


@pytest.mark.parametrize("what", ["same_host_subnet", "same_host_localhost", "same_host_mixed"])
@pytest.mark.parametrize("peer", ["jazzy", "kilted"])
def test_ros_on_the_same_host_with_a_network(peer: str, what: str) -> None:
    peers.require(peer)
    namespaces.run(f"tests.rtps_net.peer_hosts:{what}", peer)
