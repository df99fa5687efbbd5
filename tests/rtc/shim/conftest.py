"""A stage for old components."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from muros.rtc.corba import Orb, RunningNameServer
from tests.rtc.shim.stage import Stage


@pytest.fixture
def stage(orb: Orb, name_server: RunningNameServer, tmp_path: Path) -> Iterator[Stage]:
    """Programs end with the test."""
    from omniORB import CORBA

    stage = Stage(CORBA.ORB_init([], CORBA.ORB_ID), name_server.address, tmp_path)
    yield stage
    stage.close()
