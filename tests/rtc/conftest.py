"""The ORB of the tests' process, and name servers on free ports of this machine."""

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

os.environ["OMNIORB_CONFIG"] = os.devnull

from muros.rtc.corba import Orb, RunningNameServer, start_name_server, start_orb


@pytest.fixture(scope="session")
def orb() -> Iterator[Orb]:
    """The ORB, on loopback. One for the whole process: tests leave it running."""
    running = start_orb("127.0.0.1:", connect_timeout=1.0)
    yield running
    running.shutdown()


@pytest.fixture
def free_port() -> int:
    """A TCP port of loopback that nobody listens on."""
    return find_free_port()


@pytest.fixture
def name_server(tmp_path: Path) -> Iterator[RunningNameServer]:
    """A name server of this test's own."""
    with start_name_server(find_free_port(), folder=tmp_path / "names") as server:
        yield server


@pytest.fixture(scope="module")
def shared_name_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningNameServer]:
    """A name server for the tests of one file, which look after their names themselves."""
    with start_name_server(find_free_port(), folder=tmp_path_factory.mktemp("names")) as server:
        yield server


def find_free_port() -> int:
    """A TCP port of loopback that nobody listens on."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
        return port
