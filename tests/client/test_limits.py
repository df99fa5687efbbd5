"""What a session, its QoS and its entities take, and how they say what they do not."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.agent.xml import parse_document_untrusted
from muros.client import CONNECTED, Qos, Session, Tcp, Udp
from muros.client.hosts import _unused
from muros.xrce import create_text
from muros.xrce.constants import DELETE
from muros.xrce.representation import Kind
from tests.client.replay import Wire, submessages
from tests.client.test_session import Device
from tests.client.world import STRING, World


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"depth": 70000}, "depth is 70000: it must be an integer from 0 to 65535"),
        ({"depth": -1}, "depth is -1: it must be an integer from 0 to 65535"),
        ({"deadline": 2**32}, "deadline is 4294967296: it must be an integer from 0 to 4294967295"),
        ({"deadline": 0.5}, "deadline is 0.5: it must be an integer from 0 to 4294967295"),
        ({"lifespan": -5}, "lifespan is -5: it must be an integer from 0 to 4294967295"),
    ],
)
def test_qos_that_cannot_be(arguments: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Qos(**arguments)


@pytest.mark.parametrize("domain", [-1, 256, 40000, "0"])
def test_a_domain_that_cannot_be(domain: Any) -> None:
    session = Session(Wire(), 1)
    with pytest.raises(ValueError, match=f"domain is {domain!r}: it must be an integer from 0 to 255"):
        session.participant("node", domain)
    assert not session.entities
    assert session.pending == 0
    session.participant("node", 255)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"history": 3}, "history is 3: it must be a power of two"),
        ({"mtu": 20}, "mtu is 20: it must be from 64"),
        ({"session_id": 300}, "session_id is 300"),
        ({"creation": "json"}, "creation is 'json': it must be one of binary, xml, reference"),
    ],
)
def test_a_session_that_cannot_be(arguments: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Session(Wire(), 1, **arguments)


@pytest.mark.parametrize("port", [0, 70000, "8888"])
@pytest.mark.parametrize("way", [Udp, Tcp])
def test_a_port_that_cannot_be(way: Any, port: Any) -> None:
    with pytest.raises(
        ValueError, match=f"the agent's port is {port!r}: it must be an integer from 1 to 65535"
    ):
        Session(way("127.0.0.1", port))


@given(
    st.booleans(),
    st.integers(0, 0xFFFF),
    st.sampled_from(["volatile", "transient_local", "transient", "persistent"]),
    st.booleans(),
    st.integers(0, 0xFFFFFFFF),
    st.integers(0, 0xFFFFFFFF),
)
def test_the_agent_reads_every_qos_from_xml(
    reliable: bool, depth: int, durability: str, keep_all: bool, deadline: int, lifespan: int
) -> None:
    asked = Qos(reliable, depth, durability, keep_all, deadline, lifespan).asked
    for kind in (5, 6):
        variant = create_text.Xml().of_endpoint(kind, 0x12, asked, 0x13, "rt/a", STRING)
        text = variant[8:].split(b"\0")[0].decode()
        entity: Any = parse_document_untrusted(Kind(kind), text).entity
        qos = entity.qos
        assert (qos.reliable, qos.keep_last) == (reliable, not keep_all)
        assert qos.durability.name == durability.upper()
        assert qos.depth == (None if keep_all or not depth else depth)
        assert (qos.deadline_ms, qos.lifespan_ms) == (deadline or None, lifespan or None)


@pytest.mark.parametrize("creation", ["binary", "xml"])
def test_the_agent_makes_the_qos_that_was_asked_for(creation: str) -> None:
    world = World()
    device = Device(world, creation=creation)
    writer = device.session.writer(
        device.participant, "rt/timed", STRING, Qos(deadline=100, lifespan=2500, durability="transient_local")
    )
    device.connect()
    (session,) = world.core.clients.values()
    made: Any = session.objects[writer.object_id(1)]
    assert (made.writer.qos.deadline, made.writer.qos.lifespan) == (100_000_000, 2_500_000_000)
    assert made.writer.qos.durability.name == "TRANSIENT_LOCAL"


def test_entities_come_and_go_for_ever() -> None:
    world = World()
    device = Device(world).connect()
    session = device.session
    for i in range(300):
        made = session.writer(device.participant, f"rt/t{i}", STRING)
        world.run(15)
        assert made.todo == made.status == 0
        made.destroy()
        world.run(5)
    assert session.state == CONNECTED


def unused(session: Session) -> int:
    """The index that the next writer would have if all were used."""
    return _unused(session, 5)[0] >> 4


def test_the_indices_of_deleted_objects_are_used_again_once_they_are_deleted() -> None:
    world = World()
    device = Device(world).connect()
    session = device.session
    held = session.writer(device.participant, "rt/held", STRING)
    world.run(50)
    for kind in range(1, 9):
        session.counts[kind] = 4096
    held.destroy()
    assert unused(session) == 2, "its DELETE has not gone out"
    session.spin_once(world.now)
    assert session.backlog is None
    assert unused(session) == 2, "its DELETE is not acknowledged"
    world.run(50)
    assert unused(session) == held.id >> 4
    for _ in range(5):
        again = session.writer(device.participant, "rt/again", STRING)
        assert (again.id, again.above) == (held.id, held.above)
        world.run(50)
        assert again.write_bytes(b"here")
        again.destroy()
        fresh = session.writer(device.participant, "rt/fresh", STRING)
        assert fresh.id != again.id
        world.run(50)
        assert fresh.write_bytes(b"here too")
        fresh.destroy()
        world.run(50)
    sent = [s for _, m in device.transport.log for s in submessages(m) if s.kind == DELETE]
    assert len(sent) == 11 * 3


def test_there_is_an_end_to_the_objects_of_a_kind() -> None:
    session = Session(Wire(), 1)
    nodes = [session.participant("n") for _ in range(4096)]
    assert {node.id >> 4 for node in nodes} == set(range(4096))
    with pytest.raises(ValueError, match="a session has at most 4096 objects of a kind"):
        session.participant("one more")
    assert len(session.entities) == 4096
