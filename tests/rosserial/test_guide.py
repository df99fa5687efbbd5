"""The guide's program for a server runs, and what the guide shows is what is printed."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
from pathlib import Path

from muros.rosserial.node_handle import NodeHandle
from muros.rosserial.server import BoardHeard, BoardReady, BufferKnown, EndpointSetUp, LineUp
from muros.rosserial.tcp import Tcp
from muros.rosserial.types import message

GUIDE = (Path(__file__).parents[2] / "docs/rosserial.md").read_text()


def test_the_server_in_a_program(tmp_path: Path) -> None:
    (program,) = (text for text in re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL) if "Server(" in text)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    program = program.replace('"dds:"', '"local:"').replace("add_tcp(11411)", f'add_tcp({port}, "127.0.0.1")')
    program = program.replace("/dev/ttyACM0", f"{tmp_path}/ttyACM0")
    process = subprocess.Popen(
        [sys.executable, "-u", "-c", program], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    line = Tcp("127.0.0.1", port)
    try:
        node = NodeHandle(line)
        node.advertise("chatter", message("std_msgs/String"))
        while not node.connected:
            assert process.poll() is None
            node.spin_once(10)
        assert node.get_param("~gain", float) == [2.5]
        assert process.stdout is not None
        said = []
        for each in process.stdout:
            said.append(each)
            if "Setup publisher on chatter [std_msgs/String]" in each:
                break
        assert any("there is no such device now" in each for each in said)
    finally:
        process.kill()
        process.communicate()
        line.close()


def test_what_is_shown_is_what_is_said() -> None:
    shown = GUIDE.partition("```console\n")[2].partition("```")[0]
    device = "/dev/ttyACM0"
    for event in (
        LineUp(device),
        BoardHeard(device, 0xFE),
        BufferKnown(device, "subscribe", 1024),
        EndpointSetUp(device, "subscriber", "led_out", "std_msgs/Byte", 1024),
        BoardReady(device, "/serial_node", 0, 1, 0, 0, 0.3),
    ):
        assert f"] {event.text()}\n" in shown
