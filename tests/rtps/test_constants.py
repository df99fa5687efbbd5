"""Ports, entity ids and names of vendors."""

import pytest

from muros.rtps import _constants as c


def test_ports_of_the_specification() -> None:
    """DDSI-RTPS 2.3, 9.6.1.1."""
    ports = c.Ports(0)
    assert (ports.multicast, ports.user_multicast, ports.unicast(0), ports.user_unicast(0)) == (
        7400,
        7401,
        7410,
        7411,
    )
    ports = c.Ports(77)
    assert (ports.multicast, ports.unicast(1), ports.user_unicast(1)) == (26650, 26662, 26663)
    assert c.Ports(c.MAX_DOMAIN).multicast == 65400


@pytest.mark.parametrize("domain", [-1, 233])
def test_domains_that_have_no_ports(domain: int) -> None:
    with pytest.raises(ValueError, match="is not from 0 to 232"):
        c.Ports(domain)


@pytest.mark.parametrize(
    ("domain", "index", "free"),
    [(0, -1, False), (0, 119, True), (0, 120, False), (232, 62, True), (232, 63, False)],
)
def test_indexes_that_have_no_port(domain: int, index: int, free: bool) -> None:
    ports = c.Ports(domain)
    if free:
        assert ports.user_unicast(index) == ports.unicast(index) + 1 <= 65535
    else:
        with pytest.raises(ValueError, match=f"no port for participant {index} in domain {domain}"):
            ports.unicast(index)


def test_entity_ids() -> None:
    assert c.is_builtin(c.ENTITYID_SPDP_WRITER)
    assert c.is_builtin(c.ENTITYID_PARTICIPANT)
    assert not c.is_builtin(0x00000103)
    kinds = {
        0x02: "wk",
        0x03: "w",
        0x04: "r",
        0x07: "rk",
        0xC2: "wk",
        0xC3: "w",
        0xC4: "r",
        0xC7: "rk",
        0xC1: "",
        0: "",
    }
    for kind, what in kinds.items():
        assert (c.is_writer(kind), c.is_reader(kind), c.keyed(kind)) == (
            "w" in what,
            "r" in what,
            "k" in what,
        )
    assert c.entity_kind(c.ENTITYID_PARTICIPANT) == c.EntityKind.PARTICIPANT


def test_vendors() -> None:
    assert c.vendor_name(b"\x01\x0f") == "Fast DDS"
    assert c.vendor_name(b"\x01\x10") == "Cyclone DDS"
    assert c.vendor_name(b"\x01\x2a") == "vendor 01 2a"
    assert c.VENDOR_OURS not in (c.VENDOR_EPROSIMA, c.VENDOR_CYCLONE)
