"""A server under load: a process of its own, watched from outside. Any agent on a UDP port will do."""

import resource
import shlex
import socket
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from bench._load_relay import PEER

MUROS = f"{shlex.quote(sys.executable)} -m muros agent -m local udp4 -p {{port}}"
"""The agent as users run it."""
RELAY = (
    f"{shlex.quote(sys.executable)} {shlex.quote(str(Path(__file__).with_name('_load_relay.py')))} {{port}}"
)

_GET_INFO = bytes.fromhex("80000000 02010800 000a fffd 01000000")
_START_S = 10.0


class Server:
    """Runs ``command``, in which ``{port}`` stands for a free UDP port, and ends it with the ``with`` block."""

    def __init__(self, command: str) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self.port: int = probe.getsockname()[1]
        self._process = subprocess.Popen(
            shlex.split(command.format(port=self.port)), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        self.pid = self._process.pid

    def __enter__(self) -> Self:
        try:
            self._wait_until_it_answers()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def stop(self) -> None:
        """Ends the process, by force if it does not end when asked."""
        self._process.terminate()
        try:
            self._process.wait(5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait(5)

    def cpu(self) -> float:
        """Processor time of all its threads since it began, in seconds."""
        return time.clock_gettime(
            ~self.pid << 3 | 2
        )  # CPUCLOCK_SCHED of a process, see clock_getcpuclockid(3)

    def rss(self) -> float:
        """Resident memory in MB (10^6 bytes)."""
        return int(self._status("VmRSS")) * 1024 / 1e6

    def threads(self) -> int:
        """Its threads."""
        return int(self._status("Threads"))

    def queue(self) -> tuple[int, int]:
        """Of the socket at its port: bytes that wait to be received, datagrams dropped since it was made."""
        wanted = f":{self.port:04X}"
        waiting = dropped = 0
        for table in ("udp", "udp6"):
            for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
                words = line.split()
                if words[1].endswith(wanted):
                    waiting += int(words[4].partition(":")[2], 16)
                    dropped += int(words[12])
        return waiting, dropped

    def _status(self, name: str) -> str:
        for line in Path(f"/proc/{self.pid}/status").read_text().splitlines():
            key, _, value = line.partition(":")
            if key == name:
                return value.split()[0]
        raise ProcessLookupError(f"no {name} of process {self.pid}")

    def _wait_until_it_answers(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.settimeout(0.05)
            sock.connect(("127.0.0.1", self.port))
            end = time.monotonic() + _START_S
            while time.monotonic() < end:
                if self._process.poll() is not None:
                    raise RuntimeError(f"{self._process.args!r} has ended with {self._process.returncode}")
                try:
                    sock.send(_GET_INFO)
                    sock.recv(2048)
                except (TimeoutError, ConnectionRefusedError):
                    time.sleep(0.02)
                    continue
                return
        raise TimeoutError(f"{self._process.args!r} does not answer within {_START_S:.0f} s")


def relay_to(sock: socket.socket) -> None:
    """Has a relay send everything to ``sock`` from now on."""
    sock.send(PEER)
    time.sleep(0.05)


def raise_file_limit(files: int) -> None:
    """Sees to room for so many sockets; OSError says so when the system does not grant it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft < files:
        if hard != resource.RLIM_INFINITY and hard < files:
            raise OSError(f"{files} open files are needed, the system grants {hard}: ulimit -n")
        resource.setrlimit(resource.RLIMIT_NOFILE, (files, hard))


__all__ = ["MUROS", "RELAY", "Server", "raise_file_limit", "relay_to"]
