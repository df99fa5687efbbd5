"""`muros doctor --rosserial`: what it says of boards that are well, ill, deaf, or none."""

from __future__ import annotations

import os
import pty
import select
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from muros.cli import main
from muros.cli._diagnosis import Level, Result, report
from muros.cli._rosserial_checks import board_checks
from muros.interfaces import md5
from muros.links import LinkError
from muros.rosserial import types
from muros.rosserial.device import Device
from muros.rosserial.packets import VERSION_GROOVY, VERSION_HYDRO

STRING = ("std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1")
Speak = Callable[[bytes], bytes]


class Line:
    """A line in virtual time. ``speak(data)`` is what a board answers; it hears only at ``baud``, else sends noise."""

    def __init__(self, speak: Speak, baud: int = 57600, rate: bool = True) -> None:
        self.rate = rate
        self.now = 100.0
        self.closed = False
        self._speak = speak
        self._baud = baud
        self._at = 57600
        self._waiting = b""

    def clock(self) -> float:
        return self.now

    def set_baud(self, baud: int) -> None:
        if baud == 921600:
            raise LinkError("ttyTEST", "it has no such rate", "Choose another.")
        self._at = baud

    def write(self, data: bytes) -> None:
        if self.rate and self._at != self._baud:
            self._waiting += b"\x80\x00\xf8"[: len(self._speak(data))]
        else:
            self._waiting += self._speak(data)

    def read(self, timeout: float) -> bytes:
        data, self._waiting = self._waiting, b""
        self.now += 0.001 if data else timeout
        return data

    def close(self) -> None:
        self.closed = True


class Board:
    """A device of ours at the line's end; ``then`` is sent once after it was asked."""

    def __init__(self, then: bytes = b"", **options: Any) -> None:
        self.device = Device(self._send, **options)
        self._out = b""
        self._then = then

    def speak(self, data: bytes) -> bytes:
        self.device.feed(data, len(data), 0)
        out, self._out = self._out, b""
        if out:
            out += self._then
            self._then = b""
        return out

    def _send(self, buf: Any, off: int, n: int) -> None:
        self._out += bytes(buf[off : off + n])


def examined(line: Line, baud: int | None = None) -> tuple[list[Result], str]:
    """What is said of a line, as results and as text."""
    results = list(board_checks("/dev/ttyTEST", baud, lambda device, rate: line, line.clock))
    assert line.closed
    return results, report(results)


def levels(results: list[Result]) -> set[Level]:
    return {result.level for result in results}


def test_a_board_that_is_well() -> None:
    board = Board()
    board.device.publisher("chatter", *STRING)
    board.device.subscriber("led", "std_msgs/Byte", md5("std_msgs/msg/Byte"), lambda *_: None)
    service = "std_srvs/SetBool"
    board.device.publisher("set", service, md5("std_srvs/srv/SetBool_Response"), 2)
    board.device.subscriber("set", service, md5("std_srvs/srv/SetBool_Request"), lambda *_: None, 3)
    results, text = examined(Line(board.speak, rate=False))
    assert levels(results) == {Level.FINE}
    assert "ok     the board answers, protocol version 0xFE: Hydro or newer" in text
    assert "ok     publishes chatter [std_msgs/String], buffer 512 B" in text
    assert "ok     subscribes led [std_msgs/Byte], buffer 512 B" in text
    assert "ok     serves set [std_srvs/SetBool], buffer 512 B" in text
    assert not board.device.connected  # it was told that nobody listens


@pytest.mark.parametrize("version", [VERSION_HYDRO, VERSION_GROOVY])
def test_rate_and_version_are_found(version: int) -> None:
    board = Board(version=version)
    board.device.publisher("chatter", *STRING)
    results, text = examined(Line(board.speak, 1000000))
    assert "the board answers at 1000000 baud" in text
    assert ("Groovy" if version == VERSION_GROOVY else "Hydro") in text
    assert "-> muros rosserial -b 1000000" in text
    assert Level.WRONG not in levels(results)


def test_what_is_wrong_with_topics() -> None:
    board = Board(input_size=100, output_size=100)
    device = board.device
    device.publisher("odom", "nav_msgs/Odometry", md5("nav_msgs/msg/Odometry"))
    device.publisher("bad", "std_msgs/String", "0" * 32)
    device.publisher("unknown", "no_such_msgs/Thing", "0" * 32)
    device.publisher("battery", "sensor_msgs/BatteryState", "476f837fa6771f6e16e3bf4ef96f8770")
    _, text = examined(Line(board.speak))
    assert (
        "WRONG  publishes odom [nav_msgs/Odometry], buffer 100 B: a message has at least 700 B and 92 B fit"
        in text
    )
    assert "WRONG  publishes bad [std_msgs/String], buffer 100 B: std_msgs/String has md5 sum 000" in text
    assert "WRONG  publishes unknown [no_such_msgs/Thing], buffer 100 B: unknown type" in text
    assert (
        "note   publishes battery [sensor_msgs/BatteryState], buffer 100 B: an older definition without"
        in text
    )


def test_what_is_slow() -> None:
    board = Board()
    board.device.subscriber("imu", "std_msgs/Byte", md5("std_msgs/msg/Byte"), lambda *_: None)
    board.device.subscriber("twist", "geometry_msgs/Twist", md5("geometry_msgs/msg/Twist"), lambda *_: None)
    _, text = examined(Line(board.speak, 9600), 9600)
    assert "ok     subscribes imu" in text
    assert (
        "WRONG  subscribes twist [geometry_msgs/Twist], buffer 512 B: its 48 B take longer than 20 ms" in text
    )
    assert "at 9600 baud ros_lib drops what is longer than 11 B" in text


def test_a_board_that_talks_logs_and_asks() -> None:
    board = Board()
    chatter = board.device.publisher("chatter", *STRING)
    other = Board()
    other.device.connected = True
    other.device.publish(chatter, types.message("std_msgs/String")("x"))
    other.device.publish(200, types.message("std_msgs/String")("x"))
    other.device.log(3, b"motor stalled")
    other.device.log(1, b"hello")
    other.device.request_parameter(b"~gain")
    board._then = b"boot v1.2\r\n" + other._out
    _, text = examined(Line(board.speak, rate=False))
    assert "2 messages came meanwhile" in text
    assert "WRONG  it sends on ids it does not name: [200]" in text
    assert "WRONG  it says (error): motor stalled" in text
    assert "note   it says (info): hello" in text
    assert "note   it asks for parameter ~gain" in text
    assert "11 B stand between its frames" in text


def test_a_board_without_topics_that_never_asks_for_the_time() -> None:
    _, text = examined(Line(lambda data: bytes.fromhex("ffff0700060001010000006134"), rate=False))
    assert "WRONG  it names no topics" in text or "no rosserial board answers" in text


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (b"", "nothing arrives"),
        (b"temperature: 21.5\r\n", "something prints text on this port: 'temperature: 21.5"),
        (b"\x80\x00\xf8\xfe\x07", "that are no frames"),
        (bytes.fromhex("fffe0500fa7d00016162636400"), "damaged"),
    ],
)
def test_no_board(answer: bytes, says: str) -> None:
    results, text = examined(Line(lambda data: answer), 57600)
    assert [result.level for result in results] == [Level.FINE, Level.WRONG]
    assert f"WRONG  no rosserial board answers: {says}" in text or says in text


def test_nothing_at_any_rate() -> None:
    line = Line(lambda data: b"")
    _, text = examined(line)
    assert "no rosserial board answers at 57600, 115200" in text
    assert line.now < 115.0


def test_ports_that_cannot_be_had(tmp_path: Path) -> None:
    (result,) = board_checks(str(tmp_path / "ttyACM0"))
    assert "is not there" in result.what
    assert "Plug the board in" in result.remedy
    (tmp_path / "file").write_text("x")
    (result,) = board_checks(str(tmp_path / "file"))
    assert "is not a serial port" in result.what


def test_a_port_that_goes_away() -> None:
    class Gone(Line):
        def read(self, timeout: float) -> bytes:
            raise OSError(5, "Input/output error")

    results, text = examined(Gone(lambda data: b""))
    assert "/dev/ttyTEST is gone: Input/output error" in text
    assert results[-1].level is Level.WRONG


@contextmanager
def plugged_in() -> Iterator[str]:
    """A board of ours at a port of this host, spun by a thread."""
    board, port = pty.openpty()
    over = threading.Event()
    device = Device(lambda buf, off, n: os.write(board, bytes(buf[off : off + n])))
    device.publisher("chatter", *STRING)

    def spin() -> None:
        while not over.is_set():
            if select.select([board], [], [], 0.02)[0]:
                data = os.read(board, 4096)
                device.feed(data, len(data), 0)

    thread = threading.Thread(target=spin)
    thread.start()
    try:
        yield os.ttyname(port)
    finally:
        over.set()
        thread.join(5)
        os.close(port)
        os.close(board)


def test_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    with plugged_in() as path:
        assert main(["doctor", "--rosserial", path]) == 0
    out = capsys.readouterr().out
    assert "ok     publishes chatter [std_msgs/String], buffer 512 B" in out
    assert out.endswith("nothing is wrong\n")
    assert main(["doctor", "--rosserial", "/dev/no_such_port"]) == 1
    assert "/dev/no_such_port is not there" in capsys.readouterr().out
    assert main(["doctor", "-b", "57600"]) == 2
    assert "-b goes with --rosserial DEVICE" in capsys.readouterr().err
