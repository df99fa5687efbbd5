"""`muros rosserial` as a user meets it: its words, its output, its exit status."""

from __future__ import annotations

import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from muros import cli
from muros.cli._rosserial_options import WrongUseError, parameters_of, parse, take_settings
from muros.rosserial.node_handle import NodeHandle
from muros.rosserial.tcp import Tcp
from muros.rosserial.types import message


@contextmanager
def running(line: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The command on a local space, and its banner."""
    command = [sys.executable, "-m", "muros", "rosserial", "--space", "local:", *shlex.split(line)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    try:
        yield process, process.stdout.readline().rstrip("\n")
    finally:
        process.kill()
        process.wait(20)
        process.stdout.close()


def test_a_board_dials_in_and_everything_is_said(tmp_path: Path) -> None:
    file = tmp_path / "boards.yaml"
    file.write_text("/**:\n  ros__parameters:\n    gain: 3\n")
    with running(f"--tcp 0 --bind 127.0.0.1 --name opencr --params-file {file}") as (process, banner):
        matched = re.fullmatch(r"muros rosserial \S+ · local space · tcp4 127\.0\.0\.1:(\d+)", banner)
        assert matched
        port = Tcp("127.0.0.1", int(matched[1]))
        node = NodeHandle(port)
        byte: Any = message("std_msgs/Byte")
        node.subscribe("led_out", byte, lambda led: None)
        while not node.connected:
            node.spin_once(10)
        assert node.get_param("~gain", int) == [3]
        node.loginfo("LEDs are ready")
        node.spin_once(10)
        assert process.stdout is not None
        awaited = {
            "Note: subscribe buffer size is 512 bytes",
            "Setup subscriber on led_out [std_msgs/Byte]",
            "[INFO] 127.0.0.1: LEDs are ready",
            "board 127.0.0.1: node /opencr: 1 subscriber",
        }
        for each in process.stdout:
            awaited.discard(re.sub(r"^\[\d\d:\d\d:\d\d\] ", "", each.rstrip("\n")))
            if not awaited:
                break
        assert not awaited
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 0
        while node.connected:  # it was told
            node.spin_once(10)
        port.close()


def test_a_port_that_is_not_there_is_awaited(tmp_path: Path) -> None:
    with running(f"-D {tmp_path}/ttyACM7") as (process, banner):
        assert banner.endswith(f"serial {tmp_path}/ttyACM7 at 57600")
        assert process.stdout is not None
        assert "there is no such device now" in process.stdout.readline()
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("-D /dev/ttyACM0", {"devices": ["/dev/ttyACM0"], "baud": 57600, "tcp": []}),
        ("-D /dev/a -D '/dev/ttyUSB*' -b auto", {"devices": ["/dev/a", "/dev/ttyUSB*"], "baud": None}),
        ("--tcp", {"tcp": [11411], "devices": []}),
        ("--tcp 0 --tcp 5000", {"tcp": [0, 5000]}),
        ("/dev/ttyUSB1 _baud:=115200 __name:=arm __ns:=/left", {
            "devices": ["/dev/ttyUSB1"], "baud": 115200, "name": "arm", "namespace": "/left"}),
        ("_port:=/dev/ttyUSB2 _gain:=2.5 led_out:=/leds __log:=x", {
            "devices": ["/dev/ttyUSB2"], "parameters": {"gain": 2.5}, "remap": {"led_out": "/leds"}}),
        ("tcp", {"tcp": [11411]}),
        ("tcp 12000", {"tcp": [12000]}),
        ("_port:=tcp _tcp_port:=12001", {"tcp": [12001]}),
        ("--ros1", {"ros1": "", "devices": [], "tcp": []}),
        ("--ros1 /dev/ttyACM0", {"ros1": "", "devices": ["/dev/ttyACM0"]}),
        ("--ros1 http://robot:11311 tcp", {"ros1": "http://robot:11311", "tcp": [11411]}),
        ("--tcp --remap a:=b -d 7 --types x", {"remap": {"a": "b"}, "domain": 7, "types": ["x"]}),
    ],
)  # fmt: skip
def test_words(line: str, expected: dict[str, object]) -> None:
    options = parse(shlex.split(line))
    assert {name: getattr(options, name) for name in expected} == expected


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("", "name a port, such as -D /dev/ttyACM0, or --tcp"),
        ("-D /dev/x -b fast", "'fast' is no rate: write a number such as 57600, or auto"),
        ("ttyACM0", "'ttyACM0' is no port"),
        ("--tcp 70000", "a port is from 0 to 65535"),
        ("--tcp --space none", "--space none leaves the boards nowhere to be: add --ros1"),
        ("tcp ten", "'ten' is no TCP port"),
        ("--tcp --remap ab", "--remap ab: write OLD:=NEW"),
        ("--tcp --types /nowhere", "/nowhere"),
        ("--tcp --params-file /nowhere.yaml", "/nowhere.yaml: No such file or directory"),
    ],
)
def test_wrong_use_is_one_line(line: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["rosserial", *shlex.split(line)]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("line", "settings", "expected"),
    [
        ("--ros1", {}, {"devices": ["/dev/ttyUSB0"], "tcp": [], "baud": 57600}),
        ("--ros1", {"port": "/dev/ttyACM1", "baud": 115200}, {"devices": ["/dev/ttyACM1"], "baud": 115200}),
        ("--ros1", {"port": "tcp", "tcp_port": 12000}, {"tcp": [12000], "devices": []}),
        ("--ros1", {"port": "tcp"}, {"tcp": [11411], "devices": []}),
        ("--ros1", {"port": "tcp", "/rosserial_embeddedlinux/tcp_port": "12002"}, {"tcp": [12002]}),
        ("--ros1 tcp", {"tcp_port": 12000, "/rosserial_embeddedlinux/tcp_port": 12002}, {"tcp": [12000]}),
        ("--ros1 tcp 12003", {"tcp_port": 12000}, {"tcp": [12003]}),
        ("--ros1 tcp _tcp_port:=12004", {"tcp_port": 12000}, {"tcp": [12004]}),
        ("--ros1 --tcp 5000 tcp", {"tcp_port": 12000}, {"tcp": [12000, 5000]}),
        ("--ros1 --tcp 5000", {"tcp_port": 12000}, {"tcp": [5000]}),
        ("--ros1 -b 9600 /dev/x", {"port": "/dev/y", "baud": 115200}, {"devices": ["/dev/x"], "baud": 9600}),
    ],
)
def test_what_is_left_open_is_in_the_parameters_of_a_master(
    line: str, settings: dict[str, object], expected: dict[str, object]
) -> None:
    options = parse(shlex.split(line))
    take_settings(options, settings.get)
    assert {name: getattr(options, name) for name in expected} == expected


def test_no_master_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    words = [
        "rosserial",
        "--tcp",
        "0",
        "--bind",
        "127.0.0.1",
        "--ros1",
        "http://127.0.0.1:9",
        "--space",
        "none",
    ]
    assert cli.main(words) == 1
    err = capsys.readouterr().err
    assert "no ROS 1 master" in err
    assert err.count("\n") == 1


def test_a_rate_that_ports_do_not_have(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["rosserial", "-D", "/dev/null", "-b", "57601", "--space", "local:"]) == 1
    assert "57601 is not a baud rate" in capsys.readouterr().err


def test_parameters_come_from_files_of_both_kinds_and_from_the_command_line(tmp_path: Path) -> None:
    two = tmp_path / "two.yaml"
    two.write_text("/serial_node:\n  ros__parameters:\n    gain: 1\n    motor: {current: 2}\n")
    one = tmp_path / "one.yaml"
    one.write_text("serial_node:\n  rate: 50\nother: 3\n")
    flat = tmp_path / "flat.yaml"
    flat.write_text("limits:\n  low: -1\nname: arm\n")
    for files, node, expected in (
        ((two,), "/serial_node", {"gain": 1, "motor.current": 2}),
        ((two,), "/another", {}),
        ((one,), "/serial_node", {"rate": 50}),
        ((flat,), "/any", {"limits.low": -1, "name": "arm"}),
    ):
        words = ["--tcp", *(word for file in files for word in ("--params-file", str(file)))]
        assert parameters_of(parse(words))(node) == expected
    of = parameters_of(parse(["--tcp", "--params-file", str(flat), "_name:=leg"]))
    assert of("/any") == {"limits.low": -1, "name": "leg"}
    bad = tmp_path / "bad.yaml"
    bad.write_text("- 1\n")
    with pytest.raises(WrongUseError, match="names none"):
        parameters_of(parse(["--tcp", "--params-file", str(bad)]))
