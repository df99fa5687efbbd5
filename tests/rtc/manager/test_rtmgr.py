"""rtmgr of rtshell drives our managers: everything it can, also where it fails with the real ones."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from muros.rtc.corba import RunningNameServer
from tests.rtc.manager._processes import Managers

RTMGR = Path(sys.executable).with_name("rtmgr")
SHIM = Path(__file__).parents[1] / "shim" / "components"

pytestmark = pytest.mark.skipif(not RTMGR.exists(), reason="rtshell-aist is not installed")

Rtmgr = Callable[..., str]


@pytest.fixture
def managers(tmp_path: Path, name_server: RunningNameServer) -> Iterator[Managers]:
    with Managers(tmp_path, name_server.address) as made:
        yield made


@pytest.fixture
def rtmgr(managers: Managers, name_server: RunningNameServer) -> Rtmgr:
    """Runs rtmgr on the master that has been started, or on `where`; gives what it prints."""
    managers.start("-d", "-o", f"manager.modules.load_path:{SHIM}")

    def run(*words: str, where: str = f"/{name_server.address}/robot.host_cxt/manager.mgr") -> str:
        done = subprocess.run(
            [RTMGR, *words, where],
            capture_output=True,
            text=True,
            timeout=30,
            env={**os.environ, "RTCTREE_NAMESERVERS": name_server.address, "OMNIORB_CONFIG": os.devnull},
        )
        assert (done.returncode, done.stderr) == (0, "")
        return done.stdout

    return run


def test_what_can_be_loaded(rtmgr: Rtmgr) -> None:
    listed = rtmgr("-m").splitlines()
    assert any(line.endswith(":ConsoleOut:Python:1.0") or ":ConsoleOut:" in line for line in listed)
    assert len(listed) >= 5


def test_components_of_a_slave_come_and_go(rtmgr: Rtmgr) -> None:
    """Deleting one through the master fails with the real manager."""
    rtmgr("-c", "ConsoleOut?instance_name=Left")
    rtmgr("-c", "ConsoleIn")
    said = rtmgr("-r")
    assert "instance name:\tLeft" in said
    assert ".host_cxt/Left.rtc\n" in said
    assert "instance name:\tConsoleIn0" in said
    rtmgr("-d", "Left")
    assert "Left" not in rtmgr("-r")


def test_settings(rtmgr: Rtmgr) -> None:
    """Listing them fails with the real manager, whose process id is a number."""
    rtmgr("-s", "a.b=c")
    said = {line.partition(":")[0]: line.partition(":")[2].strip() for line in rtmgr("-g").splitlines()}
    assert said["a.b"] == "c"
    assert said["manager.is_master"] == "YES"
    assert said["manager.pid"].isdigit()


def test_modules_by_path(rtmgr: Rtmgr) -> None:
    path = str(SHIM / "ConsoleOut.py")
    rtmgr("-l", f"{path}:ConsoleOutInit")
    rtmgr("-u", path)


def test_by_corbaloc(rtmgr: Rtmgr, managers: Managers) -> None:
    rtmgr("-c", "ConsoleOut", where=f"corbaloc::{managers.master_address}/manager")
    assert "instance name:\tConsoleOut0" in rtmgr("-r")
