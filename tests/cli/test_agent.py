"""`muros agent` as a user meets it: a process, its output, its exit status."""

import asyncio
import re
import shlex
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from muros import cli
from muros.agent.arguments import parse_arguments
from muros.cli.agent import make_links
from muros.links import DiscoveryLink
from muros.links.testing import Recorder
from muros.rosserial.node_handle import NodeHandle
from muros.rosserial.tcp import Tcp
from muros.rosserial.types import message

CREATE_CLIENT = bytes.fromhex("80000000 00011000 58524345 0100010f ba5eba11 8100fc01")
CREATE_PARTICIPANT = bytes.fromhex(
    "81800000 01071e00 000a0001 01030000 0f000000 00010000 07000000 74616c6b657200 00 0000"
)
DELETE_CLIENT = bytes.fromhex("81000000 03010400 0002fffe")


class Running:
    """A running agent and the address it listens on."""

    def __init__(self, process: "subprocess.Popen[str]", banner: str) -> None:
        self.process = process
        self.banner = banner

    def line(self, containing: str) -> str:
        """The next line with this text; fails when the output ends before."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if containing in line:
                return line.rstrip("\n")
        raise AssertionError(f"no line with {containing!r}")

    def stop(self, number: int = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        return self.process.wait(20)


@contextmanager
def running(line: str) -> Iterator[Running]:
    command = [sys.executable, "-m", "muros", "agent", "-m", "local", *shlex.split(line)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        assert process.stdout is not None
        yield Running(process, process.stdout.readline().rstrip("\n"))
    finally:
        process.kill()
        process.wait(20)
        assert process.stdout is not None
        process.stdout.close()


@contextmanager
def client(port: int) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.settimeout(20)
        sock.connect(("127.0.0.1", port))
        yield sock


def test_a_rosserial_board_meets_the_others_in_one_space() -> None:
    with running("udp4 -p 0 --bind 127.0.0.1 rosserial -p 0 --bind 127.0.0.1") as agent:
        matched = re.fullmatch(
            r"muros agent \S+ · local space · udp4 \S+ · tcp4 127\.0\.0\.1:(\d+)", agent.banner
        )
        assert matched
        line = Tcp("127.0.0.1", int(matched[1]))
        node = NodeHandle(line)
        node.advertise("chatter", message("std_msgs/String"))
        while not node.connected:
            node.spin_once(10)
        agent.line("Setup publisher on chatter [std_msgs/String]")
        agent.line("board 127.0.0.1: node /serial_node_127_0_0_1: 1 publisher")
        assert agent.stop() == 0
        while node.connected:
            node.spin_once(10)
        line.close()


def test_links_for_rosserial_are_asked_for_as_others() -> None:
    options = parse_arguments(
        ["rosserial", "-D", "/dev/ttyACM0 /dev/ttyACM1", "rosserial", "-p", "0", "-b", "9600"]
    )
    assert options is not None
    assert [(link.devices, link.port, link.baudrate) for link in options.links] == [
        (("/dev/ttyACM0", "/dev/ttyACM1"), 0, 57600),
        ((), 0, 9600),
    ]
    assert list(make_links(options)) == []


def test_a_client_comes_and_goes() -> None:
    with running("udp4 -p 0 --bind 127.0.0.1") as agent:
        matched = re.fullmatch(r"muros agent [\d.]+\S* · local space · udp4 127\.0\.0\.1:(\d+)", agent.banner)
        assert matched
        with client(int(matched[1])) as board:
            board.send(CREATE_CLIENT)
            assert board.recv(100)[4] == 4  # STATUS_AGENT
            connected = agent.line("connected")
            assert re.fullmatch(
                r"\[\d\d:\d\d:\d\d\] client 0xBA5EBA11 connected from 127\.0\.0\.1:\d+", connected
            )
            board.send(DELETE_CLIENT)
            assert board.recv(100)[4] == 5  # STATUS
            assert "client 0xBA5EBA11 gone" in agent.line("gone")
        assert agent.stop() == 0


def test_every_message_in_the_words_of_the_reference() -> None:
    with running("udp4 -p0 --bind 127.0.0.1 -v6 -m ced --log-style reference") as agent:
        assert "info     | UDPv4AgentLinux.cpp | init " in agent.banner
        with client(int(agent.banner.rpartition("port: ")[2])) as board:
            board.send(CREATE_CLIENT)
            assert "len: 24, data: " in agent.line("[==>> UDP <<==]")
            assert agent.line("0000: ") == "0000: " + CREATE_CLIENT.hex(" ").upper()
            assert "session_id: 0x81" in agent.line("| create  ")
            assert "client_key: 0xBA5EBA11, address: 127.0.0.1:" in agent.line("session established")
            agent.line("[** <<UDP>> **]")
            board.send(CREATE_PARTICIPANT)
            assert "participant_id: 0x000(1)" in agent.line("participant created")
        assert agent.stop(signal.SIGINT) == 0
        agent.line("session closed")


def test_a_pseudoterminal_names_its_far_end(tmp_path: Path) -> None:
    far_end = tmp_path / "board"
    with running(f"pseudoterminal -D {far_end} -v 5") as agent:
        assert f"pseudoterminal {far_end}" in agent.banner
        assert far_end.is_symlink()
        assert agent.stop() == 0
    assert not far_end.is_symlink()


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("udp4", "muros: udp4: -p PORT is required"),
        ("udp4 -p 99999", "muros: udp4: -p 99999: out of range: it must be from 0 to 65535"),
        (
            "udp4 -p 1 -m ced --ros-distro humble",
            "muros: --ros-distro humble has no meaning for -m ced: it belongs to dds",
        ),
        ("udp4 -p 1 -r /nowhere.refs", "muros: /nowhere.refs: no such file or directory"),
    ],
)
def test_wrong_use_is_one_line_and_status_2(line: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["agent", *shlex.split(line)]) == 2
    assert capsys.readouterr() == ("", said + "\n")


def test_bad_profiles_stop_the_agent_unless_they_are_optional(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refs = tmp_path / "bad.refs"
    refs.write_text("<profiles>\n<topic>\n")
    assert cli.main(["agent", "udp4", "-p", "0", "-r", str(refs)]) == 2
    assert capsys.readouterr().err == f"muros: {refs}:3: not well-formed: no element found\n"
    with running(f"udp4 -p 0 --bind 127.0.0.1 -r {refs} --refs-optional") as agent:
        assert (
            agent.banner == f"muros: {refs}:3: not well-formed: no element found; going on without profiles"
        )
        agent.line("local space")
        assert agent.stop() == 0


def test_what_has_no_effect_is_noted(tmp_path: Path) -> None:
    refs = tmp_path / "agent.refs"
    refs.write_text(
        '<profiles><data_writer profile_name="w"><topic><name>T</name></topic><times/></data_writer></profiles>'
    )
    with running(f"udp4 -p 0 --bind 127.0.0.1 -P 7401 -r {refs}") as agent:
        assert agent.banner.startswith("muros: note: udp4: -P has no effect: ")
        agent.line(f"muros: note: {refs}:1: no effect in profile 'w': data_writer/times")
        agent.line("local space")
        assert agent.stop() == 0


def test_a_port_in_use_is_one_line_and_status_1() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        command = [sys.executable, "-m", "muros", "agent", "-m", "ced", "udp4", "-p", str(port)]
        command += ["--bind", "127.0.0.1"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("muros: udp4 ")
    assert "in use" in done.stderr
    assert done.stderr.count("\n") == 1


def test_discovery_hears_the_interface_of_the_link() -> None:
    for bind, interface in (("127.0.0.1", "127.0.0.1"), ("0.0.0.0", None)):
        options = parse_arguments(["udp4", "-p", "1", "-d", "--bind", bind], {})
        assert options is not None
        (link, _), (discovery, announced) = make_links(options)
        assert announced == [link]
        assert isinstance(discovery, DiscoveryLink)
        assert discovery.interface == interface


@pytest.mark.parametrize(
    ("line", "names"),
    [
        ("udp4 -p 8888 --bind 127.0.0.1", ["udp4 127.0.0.1:8888"]),
        ("udp6 -p 8888", ["udp6 [::]:8888"]),
        ("tcp4 -p 1 -d", ["tcp4 0.0.0.0:1", "discovery 239.255.0.2:7400"]),
        ("udp4 -p 1 -d tcp4 -p 2 -d udp4 -p 3 -d 7500", None),
        ("serial -D /dev/a -b 921600", ["serial /dev/a at 921600"]),
        ("multiserial -D '/dev/a /dev/b'", ["multiserial /dev/a /dev/b at 115200"]),
        ("pseudoterminal", ["pseudoterminal"]),
        ("canfd -D can0", ["canfd can0"]),
    ],
)
def test_links_are_made_as_asked_for(line: str, names: list[str] | None) -> None:
    options = parse_arguments(shlex.split(line), {})
    assert options is not None
    made = [link.name for link, _ in make_links(options)]
    if names is None:
        # One discovery port is opened once, however many links ask for it.
        assert [name.rpartition(":")[2] for name in made] == ["1", "2", "3", "7400", "7500"]
    else:
        assert made == names


def test_a_tcp_link_holds_as_many_connections_as_asked_for() -> None:
    options = parse_arguments(shlex.split("tcp4 -p 0 --bind 127.0.0.1 --connections 1"), {})
    assert options is not None
    ((link, _),) = make_links(options)

    async def program() -> bytes:
        link.open(Recorder())
        port = int(link.name.rpartition(":")[2])
        first = await asyncio.open_connection("127.0.0.1", port)
        second = await asyncio.open_connection("127.0.0.1", port)
        ended = await asyncio.wait_for(second[0].read(), 10)
        assert not first[0].at_eof()
        for _, writer in (first, second):
            writer.close()
        link.close()
        return ended

    assert asyncio.run(program()) == b""
    assert link.counters.dropped == {"too-many-connections": 1}
