"""The RTC world's own tools on components of ours: every command that works with the real ones."""

import os
import queue
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from muros.rtc.corba import NameServer, Orb, RunningNameServer

WAIT = 15.0
BIN = Path(sys.executable).parent
PROGRAM = Path(__file__).parents[1] / "programs" / "tools.py"

pytest.importorskip("rtshell")


class Process:
    """A process of ours with the components of programs/tools.py, and what it prints."""

    def __init__(self, conf: Path, *options: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "muros", "rtc", "run", str(PROGRAM), "-f", str(conf), *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.lines = queue.Queue[str]()
        self.said: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def end(self, *, kill: bool = False) -> int:
        """End it, as a person does or by force; its exit status."""
        (self.process.kill if kill else self.process.terminate)()
        status = self.process.wait(WAIT)
        self._reader.join(WAIT)
        assert self.process.stdout is not None
        self.process.stdout.close()
        return status

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.said.append(line.rstrip())
            self.lines.put(line.rstrip())

    def until(self, pattern: str) -> str:
        """The next line that the pattern matches."""
        while True:
            try:
                line = self.lines.get(timeout=WAIT)
            except queue.Empty:
                pytest.fail(f"nothing like {pattern!r} was said, only {self.said[-5:]}")
            if re.search(pattern, line):
                return line

    def forget(self) -> None:
        """Do not look at what has been said so far."""
        while not self.lines.empty():
            self.lines.get_nowait()


class World:
    """A name server and a process of ours, for the tools."""

    def __init__(self, orb: Orb, server: RunningNameServer, folder: Path) -> None:
        self.folder = folder
        self.server = NameServer(orb, server.address)
        self.conf = folder / "rtc.conf"
        self.conf.write_text(
            f"corba.nameservers: {server.address}\ncorba.endpoints: 127.0.0.1:\nlogger.enable: NO\n"
            "naming.formats: test.host_cxt/%n.rtc\nmanager.shutdown_on_nortcs: NO\nmanager.shutdown_auto: NO\n"
        )
        self.root = f"/{server.address}"
        self.giver = f"{self.root}/test.host_cxt/Giver0.rtc"
        self.taker = f"{self.root}/test.host_cxt/Taker0.rtc"
        self.process = self.start()

    def start(self) -> Process:
        """Another process with both components, when these can be reached."""
        process = Process(self.conf)
        for name in ("Giver0", "Taker0"):
            self.until(lambda name=name: self.is_there(name), process)  # type: ignore[misc]
        return process

    def is_there(self, name: str) -> bool:
        """Whether a living component has that name."""
        found = self.server.resolve(f"test.host_cxt/{name}.rtc")
        try:
            return found is not None and not found._non_existent()
        except Exception:
            return False

    def until(self, holds: Callable[[], bool], process: Process | None = None) -> None:
        """Wait until something holds."""
        tries = threading.Event()
        for _ in range(int(WAIT / 0.05)):
            if holds():
                return
            assert process is None or process.process.poll() is None, process.said
            tries.wait(0.05)
        pytest.fail("it does not come to hold")

    def run(self, command: str, *arguments: str, status: int = 0) -> str:
        """What a tool prints."""
        done = subprocess.run(
            [str(BIN / command), *arguments],
            env={**os.environ, "RTCTREE_NAMESERVERS": self.root[1:], "OMNIORB_CONFIG": os.devnull},
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=40,
            check=False,
        )
        assert done.returncode == status, f"{done.stdout}{done.stderr}"
        return done.stdout + done.stderr

    def state(self, path: str) -> str:
        """Active, Inactive or Error."""
        return self.run("rtcat", path).splitlines()[0].split()[-1]


@pytest.fixture(scope="module")
def world(
    orb: Orb, shared_name_server: RunningNameServer, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[World]:
    one = World(orb, shared_name_server, tmp_path_factory.mktemp("tools"))
    yield one
    assert one.process.end() == 0, one.process.said


def test_listing(world: World) -> None:
    assert "test.host_cxt" in world.run("rtls", f"{world.root}/")
    listed = world.run("rtls", "-lR", f"{world.root}/")
    assert re.search(r"Inactive +1/0 +0/0 +1/0 +0/0 +Giver0\.rtc", listed)
    assert re.search(r"Inactive +1/0 +1/0 +0/0 +0/0 +Taker0\.rtc", listed)
    assert "Giver0.rtc" in world.run("rtfind", "-t", "c", f"{world.root}/")
    world.run("rtpwd")


def test_a_component_in_all_detail(world: World) -> None:
    text = world.run("rtcat", "-lll", world.giver)
    for line in (
        r"Giver0\.rtc +Inactive",
        r"Category +test",
        r"Description +Gives numbers\.",
        r"Type +Monolithic",
        r"State +Running",
        r"Kind +Periodic",
        r"Rate +50\.0",
        r"Owner +Giver0",
        r"-DataOutPort: out",
        r"dataport\.data_type +IDL:RTC/TimedLong:1\.0",
        r"port\.port_type +DataOutPort",
    ):
        assert re.search(line, text), line
    assert "-DataInPort: inp" in world.run("rtcat", "-ll", world.taker)


@pytest.mark.parametrize(
    "properties",
    [
        [],
        ["dataport.subscription_type=flush"],
        ["dataport.subscription_type=periodic", "dataport.push_rate=100"],
        ["dataport.subscription_type=new", "dataport.publisher.push_policy=all"],
        ["dataport.interface_type=data_service"],
        ["dataport.interface_type=shared_memory", "dataport.subscription_type=flush"],
        ["dataport.interface_type=direct", "dataport.subscription_type=flush"],
        ["dataport.serializer.cdr.endian=big,little"],
    ],
    ids=lambda words: ",".join(words) or "default",
)
def test_connecting_and_running(world: World, properties: list[str]) -> None:
    options = [word for one in properties for word in ("-p", one)]
    world.run("rtcon", "-n", "line", *options, f"{world.giver}:out", f"{world.taker}:inp")
    try:
        assert re.search(r"Inactive +1/1 +0/0 +1/1 +0/0 +Giver0\.rtc", world.run("rtls", "-l", world.giver))
        world.process.forget()
        world.run("rtact", world.giver, world.taker)
        world.process.until(r"got \d+")
        assert world.state(world.giver) == "Active"
    finally:
        world.run("rtdeact", world.giver, world.taker)
        world.run("rtdis", f"{world.giver}:out")
    assert world.state(world.giver) == "Inactive"
    assert re.search(r"1/0 +0/0 +1/0", world.run("rtls", "-l", world.giver))


def test_connecting_from_the_inport_with_an_id(world: World) -> None:
    world.run("rtcon", "-i", "my-id", f"{world.taker}:inp", f"{world.giver}:out")
    assert "my-id" in world.run("rtcat", "-lll", world.taker)
    world.run("rtdis", f"{world.taker}:inp")
    assert "my-id" not in world.run("rtcat", "-lll", world.giver)


def test_connections_that_cannot_be(world: World) -> None:
    text = world.run(
        "rtcon", "-p", "dataport.interface_type=smoke", f"{world.giver}:out", f"{world.taker}:inp", status=1
    )
    assert "Incompatible connection properties" in text
    assert world.run("rtcon", f"{world.giver}:none", f"{world.taker}:inp", status=1)


def test_parameters(world: World) -> None:
    assert "default" in world.run("rtconf", world.giver, "list")
    assert world.run("rtconf", world.giver, "get", "step").strip() == "1"
    world.run("rtconf", world.giver, "set", "step", "5")
    assert world.run("rtconf", world.giver, "get", "step").strip() == "5"
    world.run("rtconf", "-s", "default", world.giver, "set", "step", "1")
    assert "step" in world.run("rtconf", "-l", world.giver, "list")
    assert "__widget__" in world.run("rtconf", "-a", world.giver, "list")
    world.run("rtconf", "-s", "default", world.giver, "act")


def test_an_error_and_its_reset(world: World) -> None:
    world.run("rtconf", world.giver, "set", "fails", "1")
    world.run("rtact", world.giver)
    world.until(lambda: world.state(world.giver) == "Error")
    world.run("rtconf", world.giver, "set", "fails", "0")
    world.process.forget()
    world.run("rtreset", world.giver)
    world.process.until("reset")
    assert world.state(world.giver) == "Inactive"


def test_a_system_is_kept_taken_down_and_brought_back(world: World) -> None:
    world.run("rtcon", "-p", "dataport.subscription_type=flush", f"{world.giver}:out", f"{world.taker}:inp")
    world.run("rtconf", world.giver, "set", "step", "3")
    world.run("rtcryo", "-o", "system.rtsys", world.root[1:])
    kept = (world.folder / "system.rtsys").read_text()
    assert "Giver0" in kept
    assert "flush" in kept
    world.run("rtteardown", "system.rtsys")
    assert re.search(r"1/0 +0/0 +1/0", world.run("rtls", "-l", world.giver))
    world.run("rtconf", world.giver, "set", "step", "1")
    world.run("rtresurrect", "system.rtsys")
    assert re.search(r"1/1 +0/0 +1/1", world.run("rtls", "-l", world.giver))
    assert world.run("rtconf", world.giver, "get", "step").strip() == "3"
    world.process.forget()
    world.run("rtstart", "system.rtsys")
    world.process.until(r"got \d+")
    world.run("rtstop", "system.rtsys")
    assert world.state(world.giver) == "Inactive"
    world.run("rtteardown", "system.rtsys")


def test_ending_and_clearing_away(world: World) -> None:
    world.run("rtexit", world.taker)
    world.until(lambda: world.server.resolve("test.host_cxt/Taker0.rtc") is None)
    world.process.end(kill=True)
    assert re.search(r"\*Giver0\.rtc|Zombie", world.run("rtls", "-l", f"{world.root}/test.host_cxt"))
    world.run("rtdel", "-z")
    assert "Giver0" not in world.run("rtls", f"{world.root}/test.host_cxt")
    world.process = world.start()
    world.run("rtdel", world.giver)
    assert world.server.resolve("test.host_cxt/Giver0.rtc") is None
    assert world.is_there("Taker0")
