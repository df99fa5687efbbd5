"""Every transport against the real agent over loopback: one set of tests for all."""

import contextlib
import os
import pty
import socket
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from muros.client import CONNECTED, LOST, Custom, Serial, Session, Tcp, Udp, discover, ping
from muros.client._types import Transport
from muros.client.discovery import InfoError, locators_untrusted
from muros.links import CustomLink, DiscoveryLink, Link, PseudoterminalLink, TcpLink, UdpLink
from tests.client.agent_thread import PATIENCE, RunningAgent
from tests.client.replay import VECTORS, load

STRING = "std_msgs::msg::dds_::String_"


class Pipe:
    """Two ends of a byte stream for custom transports."""

    def __init__(self) -> None:
        self.ours, self.theirs = socket.socketpair()
        self.ours.setblocking(False)
        self.theirs.setblocking(False)

    def transport(self, framing: bool) -> Custom:
        """The client's end."""

        def read(buf: bytearray) -> int:
            try:
                return self.ours.recv_into(buf)
            except BlockingIOError:
                return 0

        return Custom(
            lambda: True,
            lambda: None,
            lambda buf, off, n: self.ours.send(memoryview(buf)[off : off + n]),
            read,
            framing,
        )


def udp(family: int) -> tuple[Link, Callable[[], Transport]]:
    host = "127.0.0.1" if family == 4 else "::1"
    link = UdpLink(0, host, family=family)
    return link, lambda: Udp(host, link.port)


def tcp(family: int) -> tuple[Link, Callable[[], Transport]]:
    host = "127.0.0.1" if family == 4 else "::1"
    link = TcpLink(0, host, family=family)
    return link, lambda: Tcp(host, link.port)


def serial(_: int) -> tuple[Link, Callable[[], Transport]]:
    link = PseudoterminalLink()
    return link, lambda: Serial(link.device or "")


KINDS: dict[str, tuple[Callable[[int], tuple[Link, Callable[[], Transport]]], int]] = {
    "udp4": (udp, 4),
    "udp6": (udp, 6),
    "tcp4": (tcp, 4),
    "tcp6": (tcp, 6),
    "serial": (serial, 0),
}


@pytest.fixture(params=KINDS)
def rig(request: pytest.FixtureRequest) -> Iterator[tuple[RunningAgent, Callable[[], Transport]]]:
    """An agent and what makes transports to it."""
    make, family = KINDS[request.param]
    link, transport = make(family)
    agent = RunningAgent(link)
    yield agent, transport
    agent.stop()


def spin(session: Session, condition: Callable[[], object]) -> None:
    """Runs a session in real time until a condition holds."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"nothing came of it within {PATIENCE} s; state {session.state}"
        session.spin_once()
        session.wait(20)


def loop_back(session: Session) -> list[bytes]:
    """A session that hears what it says: small samples and large ones. What it heard."""
    participant = session.participant("loop")
    writer = session.writer(participant, "rt/loop", STRING)
    got: list[bytes] = []
    session.reader(participant, "rt/loop", STRING, "default", lambda b, o, n: got.append(bytes(b[o : o + n])))
    spin(session, lambda: session.state == CONNECTED)
    for i in range(30):
        message = b"%d " % i + bytes(range(256)) * (10 if i % 10 == 9 else 0)
        spin(session, lambda message=message: writer.write_bytes(message))  # type: ignore[misc]
    spin(session, lambda: len(got) == 30)
    return got


def test_samples_small_and_large(rig: tuple[RunningAgent, Callable[[], Transport]]) -> None:
    session = Session(rig[1]())
    got = loop_back(session)
    assert [int(message.split(b" ")[0]) for message in got] == list(range(30))
    assert [len(message) for message in got[9::10]] == [2562, 2563, 2563]
    assert list(session.drops)[2:] == [0, 0, 0]
    session.close()
    assert session.state == 0


def test_ping(rig: tuple[RunningAgent, Callable[[], Transport]]) -> None:
    transport = rig[1]()
    assert ping(transport, 5)
    rig[0].stop()
    assert not ping(transport, 1, 100)
    transport.close()


def test_an_agent_that_goes_is_noticed(rig: tuple[RunningAgent, Callable[[], Transport]]) -> None:
    session = Session(rig[1](), keepalive=200, ping_timeout=50)
    spin(session, lambda: session.state == CONNECTED)
    rig[0].stop()
    spin(session, lambda: session.state == LOST)
    session.close()


def test_tcp_comes_back_by_itself() -> None:
    link = TcpLink(0, "127.0.0.1")
    agent = RunningAgent(link)
    session = Session(Tcp("127.0.0.1", link.port))
    spin(session, lambda: session.state == CONNECTED)
    agent.stop()
    spin(session, lambda: session.state == LOST)
    again = RunningAgent(TcpLink(link.port, "127.0.0.1"))
    spin(session, lambda: session.state == CONNECTED)
    session.close()
    again.stop()


def test_nobody_listens() -> None:
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        port = held.getsockname()[1]
        for transport in (Tcp("127.0.0.1", port), Udp("127.0.0.1", port)):
            session = Session(transport, retry=50)
            end = time.monotonic() + 0.3
            while time.monotonic() < end:
                session.spin_once()
                session.wait(10)
            assert session.state == 0
            session.close()


def test_a_host_without_a_name_is_waited_for() -> None:
    session = Session(Udp("no-such-host.invalid", 1))
    session.spin_once()
    assert session.state == 0
    session.close()


def test_a_device_that_is_not_there_is_waited_for(tmp_path: Path) -> None:
    device = tmp_path / "ttyBoard"
    session = Session(Serial(str(device)), retry=20)
    for _ in range(5):
        session.spin_once()
        session.wait(10)
    assert session.state == 0
    link = PseudoterminalLink(str(device))
    agent = RunningAgent(link)
    spin(session, lambda: session.state == CONNECTED)
    session.close()
    agent.stop()


def test_a_speed_that_does_not_exist() -> None:
    with pytest.raises(ValueError, match="12345 baud"):
        Serial("/dev/null", 12345)


def test_serial_frames_with_noise_between() -> None:
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    serial = Serial(os.ttyname(theirs))
    got: list[bytes] = []
    try:
        assert serial.open()
        assert serial.open()
        frame = bytes.fromhex(load("xrce/serial_session.json")["packets"][1]["frame_hex"])
        os.write(ours, b"noise" + frame + b"\x00\x7e\x7e" + frame)
        end = time.monotonic() + PATIENCE
        while len(got) < 2:
            assert time.monotonic() < end
            serial.wait(50)
            serial.receive(lambda buf, off, n: got.append(bytes(buf[off : off + n])))
        message = load("xrce/serial_session.json")["packets"][1]["hex"]
        assert [g.hex() for g in got] == [message] * 2
        assert serial.deframer.garbage == 6
    finally:
        serial.close()
        serial.close()
        os.close(ours)
        os.close(theirs)


def test_tcp_passes_over_what_is_too_long() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        tcp = Tcp("127.0.0.1", server.getsockname()[1], mtu=64)
        end = time.monotonic() + PATIENCE
        while not tcp.open():
            assert time.monotonic() < end
        peer, _ = server.accept()
        with peer:
            peer.sendall(
                b"\x05\0first" + (5000).to_bytes(2, "little") + bytes(5000) + b"\0\0" + b"\x06\0second"
            )
            got: list[bytes] = []
            while len(got) < 2:
                assert time.monotonic() < end
                tcp.wait(50)
                tcp.receive(lambda buf, off, n: got.append(bytes(buf[off : off + n])))
            assert got == [b"first", b"second"]
            assert tcp.too_long == 2
            tcp.send(b"..answer", 2, 6)
            assert peer.recv(100) == b"\x06\0answer"
        tcp.wait(5000)
        with pytest.raises(OSError, match="104"):
            tcp.receive(lambda buf, off, n: None)
        tcp.close()


@pytest.mark.parametrize("framing", [False, True])
def test_custom(framing: bool) -> None:
    pipe = Pipe()
    if not framing:
        pipe.ours.close()
        pipe.theirs.close()
        pipe.ours, pipe.theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        pipe.ours.setblocking(False)
        pipe.theirs.setblocking(False)

    def read() -> bytes | None:
        try:
            return pipe.theirs.recv(65535)
        except BlockingIOError:
            return None

    agent = RunningAgent(CustomLink(None, None, read, pipe.theirs.send, framing=framing))
    session = Session(pipe.transport(framing))
    assert len(loop_back(session)) == 30
    session.close()
    agent.stop()
    pipe.ours.close()
    pipe.theirs.close()


def test_discovery_of_a_listed_host() -> None:
    data, door = UdpLink(0, "127.0.0.1"), DiscoveryLink(0)
    agent = RunningAgent(data, door)
    found = discover(["no-such-host.invalid", "127.0.0.1"], door.port, attempts=3, timeout=300)
    agent.stop()
    assert ("127.0.0.1", data.port) in found


def test_discovery_of_one_host() -> None:
    data, door = UdpLink(0, "127.0.0.1"), DiscoveryLink(0)
    agent = RunningAgent(data, door)
    found = discover("127.0.0.1", door.port, attempts=3, timeout=300)
    agent.stop()
    assert ("127.0.0.1", data.port) in found


def test_discovery_finds_nobody() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as held:
        held.bind(("127.0.0.1", 0))
        assert discover(["127.0.0.1"], held.getsockname()[1], attempts=2, timeout=50) == []


def test_locators_of_recorded_agents() -> None:
    assert (VECTORS / "xrce" / "raw_discovery.json").exists()
    packets = load("xrce/raw_discovery.json")["packets"]
    answers = [bytes.fromhex(p["hex"]) for p in packets if p["dir"] == "a>c"]
    for answer in answers:
        (found,) = locators_untrusted(answer)
        assert found[0] == "127.0.0.1"
    for cut in range(len(answers[0])):
        with contextlib.suppress(InfoError):
            assert locators_untrusted(answers[0][:cut]) == []
    six = answers[0][:-8] + b"\x02" + bytes(15) + b"\x01" + bytes(3) + (8888).to_bytes(4, "little")
    assert locators_untrusted(six) == [("0:0:0:0:0:0:0:1", 8888)]
