"""The session of hosts: wrong arguments are said at once, the end of a program is told to the agent; ping."""

import re
import subprocess
import sys
from typing import Any

import pytest

from muros.client import CONNECTED, LOST, Session, Udp, hosts
from muros.links import UdpLink
from tests.client.agent_thread import RunningAgent
from tests.client.test_session import Device
from tests.client.world import World


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"mtu": 5}, "mtu is 5: it must be from 64 to 65539 bytes"),
        ({"mtu": 70_000}, "mtu is 70000"),
        ({"creation": "foo"}, "creation is 'foo': it must be one of binary, xml, reference"),
        ({"session_id": 300}, "session_id is 300: it must be from 0x81 to 0xFF"),
        ({"session_id": 0}, "session_id is 0"),
        ({"session_id": 0x80}, "session_id is 128"),
        ({"queue": -1}, "queue is -1: it must be an integer of at least 0"),
        ({"queue": 2.5}, "queue is 2.5"),
        ({"heartbeat": 0}, "heartbeat is 0: it must be an integer of at least 1"),
        ({"hard_liveliness": 10**6}, "hard_liveliness is 1000000: at most 999999 ms"),
        ({"client_key": 0}, "client_key is 0x0: it must be from 1 to 0xFFFFFFFF"),
        ({"client_key": 1 << 32}, "client_key is 0x100000000"),
        ({"client_key": b"abc"}, "client_key must be 4 bytes"),
        ({"history": 3}, "history is 3: it must be a power of two"),
    ],
)
def test_wrong_values(arguments: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)) as caught:
        Session(Udp("127.0.0.1"), **arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("transport", [None, "127.0.0.1", 5, Udp])
def test_what_is_no_transport(transport: Any) -> None:
    with pytest.raises(TypeError, match="is no transport: Session takes one such as Udp"):
        Session(transport)


def test_an_option_that_does_not_exist() -> None:
    with pytest.raises(TypeError, match="Session has no option timeout"):
        Session(Udp("127.0.0.1"), timeout=5)  # type: ignore[call-arg]


def test_a_participant_whose_name_is_too_long() -> None:
    session = Session(Udp("127.0.0.1"))
    session.participant("/" + "x" * 58)
    with pytest.raises(ValueError, match=r"is too long: 60 characters as /x+, at most 59"):
        session.participant("/" + "x" * 59)


def test_closing_twice_says_goodbye_once() -> None:
    world = World()
    device = Device(world).connect()
    device.session.close()
    said = len(device.transport.log) if hasattr(device.session.transport, "log") else 0
    device.session.close()
    assert said == 0
    assert not world.core.clients


PROGRAM = """
import sys
from muros.client import CONNECTED, Session, Udp
session = Session(Udp("127.0.0.1", int(sys.argv[1])), client_key=0xCAFE)
while session.state != CONNECTED:
    session.spin_once()
    session.wait(20)
"""


def test_a_program_that_ends_says_goodbye() -> None:
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link)
    events: list[str] = []
    agent._agent.on_event(lambda event: events.append(type(event).__name__))
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(link.port)],
        timeout=30,
        capture_output=True,
        text=True,
        check=False,
    )
    agent.stop()
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert events == ["ClientConnected", "ClientGone"]


def test_goodbye_of_sessions_that_are_connected(monkeypatch: pytest.MonkeyPatch) -> None:
    connected, waiting = World(), World()
    device = Device(connected).connect()
    other = Device(waiting)
    closed: list[Session] = []

    def close(session: Session) -> None:
        closed.append(session)
        raise OSError

    monkeypatch.setattr(hosts.Session, "close", close)
    hosts._goodbye()
    assert device.session in closed
    assert other.session not in closed
    closed.clear()
    monkeypatch.setattr(hosts, "_process", -1)  # as in a child that was forked
    hosts._goodbye()
    assert not closed


def test_ping_in_a_session() -> None:
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link)
    session = Session(Udp("127.0.0.1", link.port), keepalive=0)
    assert session.ping(10_000), "it connects first"
    assert session.state == CONNECTED
    assert session.ping()
    agent.stop()
    assert not session.ping(50)
    session.close()
    assert not session.ping(20)


def test_ping_goes_on_with_the_session() -> None:
    world = World()
    device = Device(world).connect()
    world.sessions.clear()
    device.transport.on_wait = lambda ms: world.run(1, 1)
    device.host_writer.write(b"meanwhile")
    assert device.session.ping(1000, lambda: world.now)
    assert device.session.ping(1000, lambda: world.now)
    assert device.got == [b"meanwhile"]
    world.stop_agent()
    started = world.now
    assert not device.session.ping(500, lambda: world.now)
    assert 500 <= world.now - started <= 510
    world.start_agent()
    assert not device.session.ping(100, lambda: world.now), "an agent that does not know us"


def test_every_name_of_the_package_comes_with_a_star() -> None:
    names: dict[str, Any] = {}
    exec("from muros.client import *", names)
    assert names["Session"] is Session
    assert {"Udp", "Serial", "Qos", "ping", "discover", "CONNECTED"} <= set(names)
    assert "const" not in names
    assert names["LOST"] == LOST
