"""A complete ROS 1 set-up with our server in place of rosserial_python: rosmaster, rospy, commands of ROS 1, boards.

The boards are the client library of this project and ``micropython-rosserial`` from PyPI, which is somebody else's.
"""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from muros.rosserial import types
from muros.rosserial.node_handle import NodeHandle
from muros.rosserial.tcp import Tcp
from tests.cli.shell import Shell
from tests.dds.domains import free_domain
from tests.dds.peers import ROOT, Peer
from tests.ros1.peers import Master, require_tools

pytestmark = pytest.mark.timeout(180)

PROGRAM = Path(__file__).resolve().parent / "programs/micropython_board.py"
SOURCES = ROOT / "build/peers/micropython-rosserial"
ADDRESS = ("--bind", "127.0.0.1", "--name", "serial_node", "--tcp")
LIMIT = 40.0
"""Seconds that a command of ROS 1 may take on a busy machine."""


@pytest.fixture(scope="module")
def master() -> Iterator[Master]:
    with Master() as made:
        yield made


@pytest.fixture(scope="module")
def ros(master: Master) -> Iterator[Peer]:
    with master.peer("peer") as made:
        yield made


@contextmanager
def serving(master: Master, *words: str, port: int = 0) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """`muros rosserial --ros1` and the port where boards dial in."""
    process = subprocess.Popen(
        [sys.executable, "-m", "muros", "rosserial", "--ros1", *ADDRESS, str(port), *words],
        env=master.environment | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdout is not None
    try:
        banner = process.stdout.readline()
        found = re.search(r"tcp4 127\.0\.0\.1:(\d+)", banner)
        assert found, banner
        assert f"ROS 1 at {master.uri}" in banner
        yield process, int(found[1])
    finally:
        process.kill()
        process.wait(20)
        process.stdout.close()


class Board:
    """A board that echoes, serves and calls, spun by a thread; ``node`` may be used from the test, too."""

    def __init__(self, port: int) -> None:
        string, empty, set_bool = (
            types.message("std_msgs/String"),
            types.message("std_msgs/Empty"),
            types.service("std_srvs/SetBool"),
        )
        self.lock = threading.RLock()
        self.heard: list[str] = []
        self.node = NodeHandle(Tcp("127.0.0.1", port))
        self.up = self.node.advertise("b/str", string)
        self.string = string
        self.blink = self.node.advertise("/b/blink", empty)
        self.node.subscribe("h/str", string, self._echo)
        self.node.advertise_service("b/set_bool", set_bool, self._answer)
        self.client = self.node.service_client("h/svc", set_bool)
        self.set_bool = set_bool
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _spin(self) -> None:
        while not self._over.wait(0.001):
            with self.lock:
                self.node.spin_once(5)

    def _echo(self, message: Any) -> None:
        self.heard.append(message.data)
        self.up.publish(self.string("echo " + message.data))

    def _answer(self, request: Any) -> Any:
        return self.set_bool.Response(True, f"board got {request.data:d}")

    def parameter(self, name: str, kind: Any) -> Any:
        """A parameter that was just set: the master tells of it a moment later."""
        end = time.monotonic() + LIMIT
        while (value := self.node.get_param(name, kind, 5000)) is None:
            assert time.monotonic() < end, f"{name} is not told of"
            self.node.spin_once(20)
        return value

    def __enter__(self) -> Board:
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join(10)
        self.node.close()


def command(master: Master, *words: str) -> str:
    """What a command of ROS 1 prints."""
    require_tools()
    done = subprocess.run(
        [f"/usr/bin/{words[0]}", *words[1:]],
        env=master.environment,
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def meet(ros: Peer, heard: int, says: int) -> None:
    """Waits until what rospy says comes back from the board; its own counts of connections come too early."""
    assert ros.do("wait_for_publishers", subscriber=heard) == 1
    assert ros.do("wait_for_subscribers", publisher=says) == 1
    end = time.monotonic() + LIMIT
    while not ros.do("count", subscriber=heard, wait=0.2):
        ros.do("publish", publisher=says, message={"data": "anybody?"})
        assert time.monotonic() < end
    while ros.do("take", subscriber=heard, wait=0.3):
        pass


def test_rospy_and_a_board(master: Master, ros: Peer) -> None:
    with serving(master, "--space", "none") as (process, port), Board(port) as board:
        heard = ros.do("subscriber", topic="/b/str", type="std_msgs/String")
        says = ros.do("publisher", topic="/h/str", type="std_msgs/String")
        meet(ros, heard, says)
        for number in range(5):
            ros.do("publish", publisher=says, message={"data": f"hello {number}"})
            assert ros.do("take", subscriber=heard) == [{"data": f"echo hello {number}"}]
        answer = ros.do("call", service="/b/set_bool", type="std_srvs/SetBool", request={"data": True})
        assert answer == {"success": True, "message": "board got 1"}
        ros.do(
            "serve", service="/h/svc", type="std_srvs/SetBool", answer={"success": True, "message": "host"}
        )
        ros.do("set_param", name="/serial_node/gain", value=2.5)
        with board.lock:
            response = board.client.call(board.set_bool.Request(True), 5000)
            assert (response.success, response.message) == (True, "host")
            assert board.parameter("~gain", float) == [2.5]
            assert board.node.get_param("/no/such", float, 5000) is None
        state = ros.do("state")
        assert state["publishers"]["/b/str"] == ["/serial_node"]
        assert state["subscribers"]["/h/str"] == ["/serial_node"]
        assert state["services"]["/b/set_bool"] == ["/serial_node"]
        ros.do("destroy", thing=heard)
        ros.do("destroy", thing=says)
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
        assert ros.do("gone", node="/serial_node")


def test_the_commands_of_ros1(master: Master) -> None:
    with serving(master, "--space", "none") as (_, port), Board(port) as board:
        while "/b/set_bool" not in command(master, "rosservice", "list"):
            pass
        assert "/b/str" in command(master, "rostopic", "list")
        assert command(master, "rostopic", "type", "/b/str") == "std_msgs/String\n"
        assert "* /serial_node" in command(master, "rostopic", "info", "/h/str")
        echo = subprocess.Popen(
            ["/usr/bin/rostopic", "echo", "-n", "1", "/b/str"],
            env=master.environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            while echo.poll() is None:
                with board.lock:
                    board.up.publish(board.string("for echo"))
                with suppress(subprocess.TimeoutExpired):
                    echo.wait(0.1)
            assert echo.stdout is not None
            assert 'data: "for echo"' in echo.stdout.read()
        finally:
            echo.kill()
            echo.communicate()
        command(master, "rostopic", "pub", "-1", "/h/str", "std_msgs/String", "data: from a command")
        assert board.heard == ["from a command"]
        called = command(master, "rosservice", "call", "/b/set_bool", "data: true")
        assert 'message: "board got 1"' in called
        assert command(master, "rosservice", "type", "/b/set_bool") == "std_srvs/SetBool\n"
        command(master, "rosparam", "set", "/serial_node/list", "[1, 2, 3]")
        with board.lock:
            assert board.parameter("~list", int) == [1, 2, 3]


def banner_of(master: Master) -> str:
    """What the command says first when it is told nothing."""
    process = subprocess.Popen(
        [sys.executable, "-m", "muros", "rosserial", "--ros1", "--space", "none"],
        env=master.environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        assert process.stdout is not None
        return process.stdout.readline()
    finally:
        process.kill()
        process.communicate()


def test_ports_and_rates_come_from_the_parameters_of_the_node(
    master: Master, ros: Peer, tmp_path: Path
) -> None:
    try:
        ros.do("set_param", name="/serial_node/port", value=str(tmp_path / "ttyACM0"))
        ros.do("set_param", name="/serial_node/baud", value=115200)
        banner = banner_of(master)
        assert str(tmp_path / "ttyACM0") in banner
        assert "115200" in banner
        with socket.create_server(("127.0.0.1", 0)) as taken:
            port = taken.getsockname()[1]
        ros.do("set_param", name="/serial_node/port", value="tcp")
        ros.do("set_param", name="/rosserial_embeddedlinux/tcp_port", value=port)
        assert f":{port}" in banner_of(master)
    finally:
        ros.do("delete_param", name="/serial_node")
        ros.do("delete_param", name="/rosserial_embeddedlinux")


def test_both_graphs_at_once(master: Master, ros: Peer) -> None:
    with (
        free_domain() as domain,
        serving(master, "--space", f"dds:{int(domain)}") as (_, port),
        Board(port) as board,
    ):
        ros2 = Shell(domain)
        heard = ros.do("subscriber", topic="/b/str", type="std_msgs/String")
        says = ros.do("publisher", topic="/h/str", type="std_msgs/String")
        meet(ros, heard, says)
        board.heard.clear()
        assert ros2.run("topic pub -1 /h/str std_msgs/msg/String '{data: from ROS 2}'").returncode == 0
        assert ros.do("take", subscriber=heard) == [{"data": "echo from ROS 2"}]
        assert board.heard == ["from ROS 2"]
        with ros2.running("topic echo /b/str") as echo:
            ros.do("begin_publishing", publisher=says, message={"data": "from ROS 1"})
            assert "echo from ROS 1" in echo.line("data")
            ros.do("end_publishing")
        called = ros2.run("service call /b/set_bool std_srvs/srv/SetBool '{data: true}'")
        assert "board got 1" in called.stdout
        answer = ros.do("call", service="/b/set_bool", type="std_srvs/SetBool", request={"data": False})
        assert answer == {"success": True, "message": "board got 0"}
        ros.do("destroy", thing=heard)
        ros.do("destroy", thing=says)


def test_micropython_rosserial(master: Master, ros: Peer) -> None:
    """Another author's client, unchanged, which never asks for the time and numbers its topics its own way."""
    if not any(SOURCES.glob("ready-*")):
        if os.environ.get("CI") == "true":
            pytest.fail("micropython-rosserial is not there (tools/setup.sh fetches it)")
        pytest.skip("micropython-rosserial is not there (tools/setup.sh fetches it)")
    heard = ros.do("subscriber", topic="/greet", type="std_msgs/String")
    says = ros.do("publisher", topic="/listen", type="std_msgs/String")
    with serving(master, "--space", "none") as (server, port):
        board = subprocess.Popen(
            [sys.executable, str(PROGRAM), str(SOURCES), str(port)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert board.stdin is not None
            assert board.stdout is not None
            assert board.stdout.readline() == "ready\n"
            assert ros.do("wait_for_subscribers", publisher=says) == 1
            end = time.monotonic() + LIMIT
            while not ros.do("count", subscriber=heard, wait=0.2):
                board.stdin.write("anybody?\n")
                board.stdin.flush()
                assert time.monotonic() < end
            while ros.do("take", subscriber=heard, wait=0.3):
                pass
            for number in range(3):
                board.stdin.write(f"hello {number}\n")
                board.stdin.flush()
                assert ros.do("take", subscriber=heard) == [{"data": f"hello {number}"}]
                ros.do("publish", publisher=says, message={"data": f"back {number}"})
                assert board.stdout.readline() == f"heard back {number}\n"
            assert server.poll() is None
        finally:
            board.kill()
            board.communicate()
    ros.do("destroy", thing=heard)
    ros.do("destroy", thing=says)


def test_the_server_is_killed_and_started_again(master: Master, ros: Peer) -> None:
    heard = ros.do("subscriber", topic="/b/str", type="std_msgs/String")
    says = ros.do("publisher", topic="/h/str", type="std_msgs/String")
    with serving(master, "--space", "none") as (process, port), Board(port) as board:
        ros.do("wait_for_publishers", subscriber=heard)
        process.kill()
        process.wait(20)
        with serving(master, "--space", "none", port=port):
            start = time.monotonic()
            while not ros.do("count", subscriber=heard, wait=0.02):
                ros.do("publish", publisher=says, message={"data": "again"})
                assert time.monotonic() < start + LIMIT
            assert ros.do("take", subscriber=heard)[0] == {"data": "echo again"}
            assert set(board.heard) == {"again"}
    ros.do("destroy", thing=heard)
    ros.do("destroy", thing=says)
