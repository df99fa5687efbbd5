"""Interfaces, their changes, and networks on them, in namespaces of their own; and on this host what any host has."""

import pytest

from muros.rtps.net._interfaces import interfaces, require
from tests.rtps_net import namespaces


def test_this_host_has_loopback() -> None:
    *_, last = interfaces()
    assert (last.name, last.loopback, last.multicast) == ("lo", True, True)
    assert "127.0.0.1" in last.addresses
    assert require(("lo", "127.0.0.1")) == ()


@pytest.mark.parametrize("what", ["listing", "watching", "polling", "coming_and_going"])
def test_in_a_namespace(what: str) -> None:
    namespaces.run(f"tests.rtps_net.hosts:{what}")
