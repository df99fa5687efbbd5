"""Blocks of shared memory at the end of a connection."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from muros.rtc.codes import PortStatus
from muros.rtc.corba import Orb
from muros.rtc.corba._shared_memory import _Block, _End, is_available
from muros.rtc.corba._stubs import OpenRTM

pytestmark = pytest.mark.skipif(not is_available(), reason="no memory file system")


def still_open(name: str) -> list[str]:
    """What this process holds of a block, also where the file itself has gone."""
    found = []
    for descriptor in Path("/proc/self/fd").iterdir():
        try:
            target = os.readlink(descriptor)
        except OSError:
            continue
        if name in target:
            found.append(target)
    return found


@pytest.fixture
def connection() -> Any:
    findings: list[Any] = []
    return SimpleNamespace(
        little=True,
        port_name="A.in",
        profile=SimpleNamespace(name="c"),
        report=findings.append,
        findings=findings,
    )


def test_a_block_told_of_after_the_end_is_let_go(orb: Orb, connection: Any) -> None:
    """The sender's call may be on its way while the connection ends."""
    end = _End(connection, orb, 100, put=lambda octets: PortStatus.PORT_OK)
    block = _Block("muros-test-late", 100, make=True)
    try:
        block.write(b"x", "little")
        end.open_memory(100, block.name)
        assert end.put() == OpenRTM.PORT_OK
        assert len(still_open(block.name)) == 2
        end.end()
        assert len(still_open(block.name)) == 1
        end.open_memory(100, block.name)
        assert len(still_open(block.name)) == 1
        assert end.put() == OpenRTM.PORT_ERROR
        assert connection.findings == []
    finally:
        block.close()
    assert still_open("muros-test-late") == []


def test_a_block_made_after_the_end_goes_at_once(orb: Orb, connection: Any) -> None:
    end = _End(connection, orb, 100)
    told: list[str] = []
    end.peer = SimpleNamespace(open_memory=lambda size, name: told.append(name))
    end.end()
    end.place(b"x")
    (name,) = told
    assert still_open(name) == []
    assert not (Path("/dev/shm") / name).exists()
