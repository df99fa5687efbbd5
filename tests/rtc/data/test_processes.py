"""An OutPort here, an InPort in another process, and what happens to that process."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from muros.rtc.codes import DataPortStatus, ReturnCode
from muros.rtc.corba import Orb, data_type_of
from muros.rtc.corba._transports import corba_cdr
from muros.rtc.data import TRANSPORTS, DataOutPort
from muros.rtc.profiles import ConnectorProfile

pytestmark = pytest.mark.flaky(reruns=1)  # meets another program in real time

PROGRAM = Path(__file__).with_name("programs") / "receiver.py"
PUSH = {
    "dataport.interface_type": "corba_cdr",
    "dataport.dataflow_type": "push",
    "dataport.subscription_type": "flush",
}


class Across:
    """The OutPort, and the process with the InPort."""

    def __init__(self) -> None:
        self.codes: list[str] = []
        self.long = data_type_of("RTC::TimedLong")
        self.out: DataOutPort[Any] = DataOutPort(
            "out", self.long, report=lambda finding: self.codes.append(finding.code)
        )
        self.processes: list[subprocess.Popen[str]] = []

    def start(self, properties: Mapping[str, str] = PUSH) -> subprocess.Popen[str]:
        """Another process with an InPort, connected."""
        words = [f"{key}={text}" for key, text in properties.items()]
        process = subprocess.Popen(
            [sys.executable, str(PROGRAM), *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.processes.append(process)
        agreed = json.loads(self.line(process))
        code, _ = self.out.connect(ConnectorProfile("across", "", (self.out,), agreed))
        assert code is ReturnCode.RTC_OK, self.codes
        return process

    def line(self, process: subprocess.Popen[str]) -> str:
        assert process.stdout is not None
        return process.stdout.readline()

    def write(self, number: int) -> bool:
        value = self.long.default()
        value.data = number
        return self.out.write(value)

    def close(self) -> None:
        self.out.disconnect_all()
        for process in self.processes:
            process.kill()
            process.wait(10)
            for stream in (process.stdin, process.stdout):
                assert stream is not None
                stream.close()


@pytest.fixture
def across(orb: Orb, monkeypatch: pytest.MonkeyPatch) -> Iterator[Across]:
    monkeypatch.setitem(TRANSPORTS.push, "corba_cdr", corba_cdr(orb))
    across = Across()
    yield across
    across.close()


@pytest.mark.parametrize("endian", ["little,big", "big"])
def test_values_come(across: Across, endian: str) -> None:
    process = across.start({**PUSH, "dataport.serializer.cdr.endian": endian})
    for number in (1, -2, 300000):
        assert across.write(number)
        assert across.line(process) == f"{number}\n"


def test_a_killed_receiver_is_dropped_in_that_write_and_others_go_on(across: Across) -> None:
    first, second = across.start(), across.start()
    assert across.write(1)
    first.kill()
    first.wait(10)
    assert not across.write(2)
    assert across.out.status == [DataPortStatus.CONNECTION_LOST, DataPortStatus.PORT_OK]
    assert across.codes == ["connection-lost"]
    assert across.write(3)
    assert [across.line(second) for _ in range(3)] == ["1\n", "2\n", "3\n"]
    assert len(across.out.connectors) == 1


def test_a_killed_receiver_of_a_new_connection_is_dropped_at_a_later_write(across: Across) -> None:
    process = across.start({**PUSH, "dataport.subscription_type": "new"})
    assert across.write(1)
    assert across.line(process) == "1\n"
    process.kill()
    process.wait(10)
    deadline = time.monotonic() + 20
    while across.write(2) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert across.out.status == [DataPortStatus.CONNECTION_LOST]
    assert not across.out.connectors


def test_a_receiver_that_stands_still_holds_up_no_writer_of_a_new_connection(across: Across) -> None:
    process = across.start({**PUSH, "dataport.subscription_type": "new"})
    assert across.write(1)
    assert across.line(process) == "1\n"
    os.kill(process.pid, signal.SIGSTOP)
    try:
        assert all(across.write(number) for number in range(2, 100))
    finally:
        os.kill(process.pid, signal.SIGCONT)
    got = ""
    while got != "99\n":
        got = across.line(process)
        assert got, "the receiver has ended"
