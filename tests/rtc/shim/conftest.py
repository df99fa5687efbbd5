"""A stage for old components."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import OpenRTM_aist as rtm
from muros.rtc.corba import Orb, RunningNameServer
from tests.rtc.shim.stage import Stage


@pytest.fixture
def manager(orb: Orb) -> Iterator[rtm.Manager]:
    """A manager that nobody else sees."""
    settings = ("naming.enable:NO", "logger.enable:NO", "manager.shutdown_auto:NO", "corba.endpoints:127.0.0.1:",
                "exec_cxt.periodic.rate:200", "manager.shutdown_on_nortcs:NO")  # fmt: skip
    manager = rtm.Manager.init(["program", "-i", "-f", "none", *(w for s in settings for w in ("-o", s))])
    assert manager.activateManager()
    assert manager.activateManager(), "twice is once"
    manager.runManager(True)
    yield manager
    manager.shutdown()
    manager.join()


@pytest.fixture
def stage(orb: Orb, name_server: RunningNameServer, tmp_path: Path) -> Iterator[Stage]:
    """Programs end with the test."""
    from omniORB import CORBA

    stage = Stage(CORBA.ORB_init([], CORBA.ORB_ID), name_server.address, tmp_path)
    yield stage
    stage.close()
