"""One process of bench_rosserial.py. Usage: _rosserial_worker.py ROLE [--space URL] [--device PATH]

ROLE is ``server`` (muros' rosserial server and, on a local space, the program as well), ``program`` (who reads /up and
writes /down in the graph) or ``relay`` (the floor: reads bytes and sends them back). Commands come as JSON lines and
are answered by one line each; the first line that is printed says that the process is ready.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import resource
import socket
import sys
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "src"))

STRING = "std_msgs/msg/String"
IMU = "sensor_msgs/msg/Imu"
DEPTH = 200_000
"""Messages that the program's reader keeps."""


class Program:
    """Reads /up and /imu, writes /down."""

    def __init__(self, space: Any) -> None:
        from muros import interfaces
        from muros.space import Qos, Topic

        participant = space.participant("program")
        self.count = 0
        self.last = 0
        self.delays: list[int] = []
        self._string = interfaces.message(STRING)

        def topic(name: str, kind: str) -> Any:
            return Topic(interfaces.dds_topic(name), interfaces.dds_type_name(kind))

        participant.reader(topic("/up", STRING), Qos(depth=DEPTH), self._on_string)
        participant.reader(topic("/imu", IMU), Qos(depth=DEPTH), self._on_imu)
        self.writer = participant.writer(topic("/down", STRING), Qos(depth=1000))

    def _on_string(self, reader: Any) -> None:
        while (sample := reader.take()) is not None:
            self.count += 1
            now = time.monotonic_ns()
            self.last = now
            if len(sample.data) == 21:  # 16 characters: the time at which it was sent
                self.delays.append(now - int(sample.data[4:20], 16))

    def _on_imu(self, reader: Any) -> None:
        while reader.take() is not None:
            self.count += 1
            self.last = time.monotonic_ns()

    async def do(self, command: dict[str, Any]) -> dict[str, Any]:
        """Carries out a command."""
        if command["do"] == "reset":
            self.count, self.last = 0, 0
            self.delays.clear()
        elif command["do"] == "write":
            start, rate = time.monotonic(), command.get("rate", 0)
            for i in range(command["n"]):
                while rate and i > (time.monotonic() - start) * rate:
                    await asyncio.sleep(0.001)
                text = f"{time.monotonic_ns():016x}".ljust(command.get("size", 16), ".")
                self.writer.write(self._string(data=text).serialize())
                if command.get("period"):
                    await asyncio.sleep(command["period"])
                elif i % 20 == 19:
                    await asyncio.sleep(0)
        used = resource.getrusage(resource.RUSAGE_SELF)
        return {
            "count": self.count,
            "last": self.last,
            "delays": self.delays if command["do"] == "delays" else [],
            "matched": len(self.writer.matched),
            "cpu": used.ru_utime + used.ru_stime,
        }


class Relay:
    """Sends back what it reads."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.bytes = 0
        self.echo = True
        self.last = 0
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.listener.setblocking(False)
        self._loop = loop
        loop.add_reader(self.listener, self._accept)

    def _accept(self) -> None:
        sock, _ = self.listener.accept()
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._loop.add_reader(sock, self.read, sock.fileno(), sock)

    def device(self, path: str) -> None:
        """Relays on a terminal."""
        fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self._loop.add_reader(fd, self.read, fd, None)

    def read(self, fd: int, keep: object) -> None:
        """Bytes came."""
        data = os.read(fd, 4096)
        if not data:
            self._loop.remove_reader(fd)
            return
        self.bytes += len(data)
        self.last = time.monotonic_ns()
        if self.echo:
            os.write(fd, data)

    async def do(self, command: dict[str, Any]) -> dict[str, Any]:
        """Carries out a command."""
        if command["do"] == "reset":
            self.bytes, self.last, self.echo = 0, 0, command.get("echo", False)
        used = resource.getrusage(resource.RUSAGE_SELF)
        return {"count": self.bytes, "last": self.last, "delays": [], "cpu": used.ru_utime + used.ru_stime}


async def main() -> None:
    """Runs until standard input ends."""
    parser = argparse.ArgumentParser()
    parser.add_argument("role", choices=["server", "program", "relay"])
    parser.add_argument("--space", default="local:")
    parser.add_argument("--device")
    given = parser.parse_args()
    loop = asyncio.get_running_loop()
    port = 0
    part: Any = None
    if given.role == "relay":
        part = Relay(loop)
        port = part.listener.getsockname()[1]
        if given.device:
            part.device(given.device)
    else:
        from muros.space import open_space

        space = open_space(given.space)
        space.attach(loop)
        if given.role == "program" or given.space == "local:":
            part = Program(space)
        if given.role == "server":
            from muros.rosserial.server import Server

            server = Server(space)
            server.on_finding(lambda finding: print(finding.format(), file=sys.stderr))
            link: Any = server.add_tcp(0, "127.0.0.1")
            if given.device:
                server.add_serial(given.device, name="/bench")
            await server.start()
            port = link.port
    print(json.dumps({"port": port}), flush=True)
    reader = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    while line := await reader.readline():
        command = json.loads(line)
        if part is None:
            used = resource.getrusage(resource.RUSAGE_SELF)
            print(json.dumps({"cpu": used.ru_utime + used.ru_stime}), flush=True)
        else:
            print(json.dumps(await part.do(command)), flush=True)


if __name__ == "__main__":
    asyncio.run(main())
