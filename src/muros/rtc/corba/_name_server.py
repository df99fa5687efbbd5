"""omniNames, the ORB's name server, as a program that this one starts."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import struct
import subprocess
import time
from pathlib import Path
from typing import Final

import jeteve_omniorb

from muros.rtc.codes import RtcError

__all__ = ["RunningNameServer", "start_name_server"]

START_SECONDS: Final = 10.0
"""Time that the server has until it answers."""

STOP_SECONDS: Final = 5.0
"""Time that it has to end before it is killed."""

_PAUSE: Final = 0.02


class RunningNameServer:
    """A name server that `start_name_server` has started; ends with its `with` block or by `stop`."""

    def __init__(self, process: subprocess.Popen[bytes], address: str, log: Path) -> None:
        self.process: Final = process
        self.address: Final = address
        """`HOST:PORT`"""
        self.log: Final = log

    @property
    def pid(self) -> int:
        """Of the server itself, not of a program around it."""
        return self.process.pid

    def stop(self) -> None:
        """End it. Twice is allowed."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()

    def __enter__(self) -> RunningNameServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def start_name_server(
    port: int = 2809,
    *,
    host: str = "127.0.0.1",
    folder: str | os.PathLike[str] | None = None,
    detached: bool = False,
    start_seconds: float = START_SECONDS,
) -> RunningNameServer:
    """Start omniNames on `host`:`port` and wait until it can be reached.

    It keeps its names in `folder` (made if missing; default: the user's state folder, by port), and has them again
    when it is started there another time. `detached`: it outlives this program and Ctrl-C. RtcError if it does not
    start; the text has its last words.
    """
    place = Path(folder) if folder is not None else _state_folder() / f"names-{port}"
    try:
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        log = place / "omniNames.out"
        output = log.open("ab")
    except OSError as error:
        raise RtcError(
            f"{place}: {error.strerror or error}; the name server keeps its names there"
        ) from error
    known = any(place.glob("omninames-*.dat")) or any(place.glob("omninames-*.bak"))
    command = [
        str(_program()),
        *([] if known else ["-start", str(port)]),
        *("-logdir", str(place), "-errlog", str(place / "omniNames.err")),
        *("-ORBendPoint", f"giop:tcp:{host}:{port}"),
    ]
    if _is_open(host, port):
        output.close()
        raise RtcError(f"{host}:{port}: something listens there already; a name server? Choose another port")
    with output:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            start_new_session=detached,
            env={**os.environ, "OMNIORB_CONFIG": os.devnull},
        )
    server = RunningNameServer(process, f"{host}:{port}", log)
    deadline = time.monotonic() + start_seconds
    while not _serves_names(host, port):
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_PAUSE)
        if process.poll() is not None or time.monotonic() > deadline:
            server.stop()
            words = log.read_text(errors="replace").strip().splitlines()[-3:]
            raise RtcError(
                f"the name server does not start on {host}:{port}: {' / '.join(words) or 'it says nothing'}"
            )
    return server


def _program() -> Path:
    """The real program: the commands of the same name only start it, and when they are ended it goes on."""
    for place in (Path(jeteve_omniorb.__file__).parent / "bin" / "omniNames", shutil.which("omniNames")):
        if place is not None and os.access(place, os.X_OK):
            return Path(place)
    raise RtcError("omniNames is not there: pip install 'muros[rtc]'")


def _state_folder() -> Path:
    home = os.environ.get("XDG_STATE_HOME", "")
    return (Path(home) if os.path.isabs(home) else Path.home() / ".local" / "state") / "muros"


def _is_open(host: str, port: int) -> bool:
    try:
        with socket.create_connection((host, port), timeout=1.0):
            return True
    except OSError:
        return False


def _serves_names(host: str, port: int) -> bool:
    """Whether the root context is there: asked with a GIOP LocateRequest, which every ORB answers by itself."""
    key = b"NameService"
    body = struct.pack("<II", 1, len(key)) + key
    try:
        with socket.create_connection((host, port), timeout=1.0) as line:
            line.sendall(b"GIOP\1\0\1\3" + struct.pack("<I", len(body)) + body)
            reply = b""
            while len(reply) < 20 and (some := line.recv(64)):
                reply += some
    except OSError:
        return False
    status = int.from_bytes(reply[16:20], "little" if reply[6:7] == b"\1" else "big")
    return reply[7:8] == b"\4" and status in (1, 2)  # it is here, or elsewhere
