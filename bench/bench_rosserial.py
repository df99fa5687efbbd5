"""The rosserial server beside a bare relay of bytes: frames a second, latency, processor time, connecting, recovering.

Run from a checkout: python bench/bench_rosserial.py [--quick] [--dds DOMAIN] [--json FILE]

Boards are played here, as raw frames on a TCP connection or a pseudoterminal; the server is a process of its own. The
program in the graph is in the server's process, or with --dds in a third one, so that messages also cross DDS. The
relay reads the same bytes in the same run and sends them back: one way is half of that. Nothing leaves this host.
"""

from __future__ import annotations

import argparse
import json
import os
import pty
import select
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "src")]

from muros import interfaces  # noqa: E402
from muros.links._terminal import make_raw  # noqa: E402
from muros.rosserial.messages import TopicInfo  # noqa: E402
from muros.rosserial.packets import Decoder, frame  # noqa: E402

LIMIT_S = 30.0
"""How long any one step may take."""
UP, IMU, DOWN = 125, 126, 100
TIME = 10


@dataclass(frozen=True, slots=True)
class Sizes:
    """How much is measured."""

    frames: int = 20_000
    pings: int = 500
    boards: int = 10
    idle: float = 5.0
    tries: int = 5


FULL = Sizes()
QUICK = Sizes(frames=500, pings=40, boards=2, idle=0.3, tries=1)


class Worker:
    """A process of `_rosserial_worker.py`."""

    def __init__(self, *words: str) -> None:
        script = str(Path(__file__).with_name("_rosserial_worker.py"))
        self.process = subprocess.Popen(
            [sys.executable, script, *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        self.port: int = json.loads(self.process.stdout.readline())["port"]

    def do(self, what: str, **more: Any) -> dict[str, Any]:
        """Has a command carried out; returns the answer."""
        self.begin(what, **more)
        return self.end()

    def begin(self, what: str, **more: Any) -> None:
        """Begins a command."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"do": what, **more}) + "\n")
        self.process.stdin.flush()

    def end(self) -> dict[str, Any]:
        """Waits for the answer."""
        assert self.process.stdout is not None
        answer: dict[str, Any] = json.loads(self.process.stdout.readline())
        return answer

    def close(self) -> None:
        """Ends the process."""
        self.process.kill()
        self.process.wait(LIMIT_S)
        for stream in (self.process.stdin, self.process.stdout):
            assert stream is not None
            stream.close()


class Board:
    """A board on a descriptor: answers what the server asks, and takes note of what comes on /down."""

    def __init__(self, fd: int, keep: object = None) -> None:
        self.fd = fd
        self.keep = keep
        self.delays: list[int] = []
        self.received = 0
        self.asked = 0
        self.connected = False
        self._decoder = Decoder(65535, self._on_frame)
        os.set_blocking(fd, False)

    def spin(self, seconds: float) -> None:
        """Takes what comes for so long."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            if select.select([self.fd], [], [], left)[0]:
                self.read()

    def until(self, condition: Callable[[], object]) -> None:
        """Takes what comes until something holds."""
        end = time.monotonic() + LIMIT_S
        while not condition():
            if time.monotonic() > end:
                raise TimeoutError("the server does not do what it is waited for")
            if select.select([self.fd], [], [], 0.01)[0]:
                self.read()

    def read(self) -> None:
        """Takes what is there."""
        try:
            data = os.read(self.fd, 65536)
        except BlockingIOError:
            return
        if not self.connected and b"\xff\x00" in data and b"\xff\xfe\x00" not in data:
            self.write(frame(TIME, bytes(8)))
        self._decoder.feed(data, len(data), time.monotonic_ns() // 1_000_000)

    def write(self, data: bytes) -> None:
        """Sends all of it, and takes meanwhile what comes."""
        view = memoryview(data)
        while view:
            readable, writable, _ = select.select([self.fd], [self.fd], [], 1)
            if readable:
                self.read()
            if writable:
                view = view[os.write(self.fd, view[:4096]) :]

    def _on_frame(self, topic_id: int, buf: Any, off: int, n: int) -> None:
        if topic_id == 0:
            self.asked += 1
            infos = [
                (0, TopicInfo(UP, "up", "std_msgs/String", interfaces.md5("std_msgs/String"), 1024)),
                (0, TopicInfo(IMU, "imu", "sensor_msgs/Imu", interfaces.md5("sensor_msgs/Imu"), 1024)),
                (1, TopicInfo(DOWN, "down", "std_msgs/String", interfaces.md5("std_msgs/String"), 1024)),
            ]
            out = [frame(TIME, bytes(8))]
            for half, info in infos:
                body = bytearray(info.size())
                info.write(body, 0)
                out.append(frame(half, bytes(body)))
            self.connected = True
            self.write(b"".join(out))
        elif topic_id == DOWN:
            self.received += 1
            if n >= 20:
                self.delays.append(time.monotonic_ns() - int(bytes(buf[off + 4 : off + 20]), 16))


@contextmanager
def over_tcp(worker: Worker) -> Iterator[Board]:
    """A board that dials in."""
    with socket.create_connection(("127.0.0.1", worker.port)) as sock:
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        yield Board(sock.fileno(), sock)


def string(text: str) -> bytes:
    """A std_msgs/String in ROS 1."""
    return len(text).to_bytes(4, "little") + text.encode()


def imu() -> bytes:
    """A sensor_msgs/Imu in ROS 1."""
    kind = interfaces.message("sensor_msgs/msg/Imu")()
    kind.header.frame_id = "base"
    return interfaces.converter("sensor_msgs/Imu").to_ros1(kind.serialize())


def percentile(values: Sequence[int], share: float) -> float:
    """In milliseconds."""
    return sorted(values)[min(len(values) - 1, int(share * len(values)))] / 1e6


class Bench:
    """The measures."""

    def __init__(self, sizes: Sizes, domain: int | None) -> None:
        self.sizes = sizes
        self.space = "local:" if domain is None else f"dds:{domain}"
        self.rows: list[dict[str, Any]] = []

    def run(self) -> None:
        """All of them."""
        for line in ("tcp", "pty"):
            self._line(line)
        self._idle()

    def _row(self, what: str, line: str, cells: dict[str, float]) -> None:
        self.rows.append({"what": what, "line": line, **cells})
        print(
            f"  {line:<4} {what:<28}"
            + "  ".join(f"{k} {v:,.3g}" if v < 100 else f"{k} {v:,.0f}" for k, v in cells.items()),
            flush=True,
        )

    def _line(self, line: str) -> None:
        with ExitStack() as stack:
            near = far = -1
            words: list[str] = []
            relay_words: list[str] = []
            if line == "pty":
                near, far = pty.openpty()
                make_raw(far)
                words = ["--device", os.ttyname(far)]
                stack.callback(os.close, far)
                stack.callback(os.close, near)
            server = Worker("server", "--space", self.space, *words)
            stack.callback(server.close)
            program = server
            if self.space != "local:":
                program = Worker("program", "--space", self.space)
                stack.callback(program.close)
            board = Board(near) if line == "pty" else stack.enter_context(over_tcp(server))
            board.until(lambda: board.connected)
            while not program.do("look")["matched"]:
                board.spin(0.05)
            board.spin(0.5)
            self._up(line, board, server, program)
            self._down(line, board, server, program)
            self._paced(line, board, program)
            self._latency(line, board, program)
            if line == "tcp":
                self._connect(server)
                self._recover(board)
        with ExitStack() as stack:
            if line == "pty":
                near, far = pty.openpty()
                make_raw(far)
                relay_words = ["--device", os.ttyname(far)]
                stack.callback(os.close, far)
                stack.callback(os.close, near)
            relay = Worker("relay", *relay_words)
            stack.callback(relay.close)
            board = Board(near) if line == "pty" else stack.enter_context(over_tcp(relay))
            self._relay(line, board, relay)

    def _up(self, line: str, board: Board, server: Worker, program: Worker) -> None:
        for name, topic_id, body in (
            ("String 16 B up", UP, string("x" * 16)[:-1] + b"y"),
            ("String 200 B up", UP, string("x" * 200)),
            ("Imu up", IMU, imu()),
        ):
            n = self.sizes.frames
            one = frame(topic_id, body if name != "String 16 B up" else string("0" * 16))
            program.do("reset")
            before = server.do("look")["cpu"]
            start = time.monotonic_ns()
            for _ in range(0, n, 100):
                board.write(one * 100)
            accepted = time.monotonic_ns() - start
            found = program.do("look")
            end = time.monotonic() + LIMIT_S
            while found["count"] < n and time.monotonic() < end:
                board.spin(0.05)
                now = program.do("look")
                if now["count"] == found["count"] and time.monotonic_ns() - now["last"] > 2e9:
                    break
                found = now
            took = (found["last"] - start) / 1e9
            cpu = server.do("look")["cpu"] - before
            self._row(
                name,
                line,
                {
                    "frames/s": found["count"] / took,
                    "delivered": found["count"] / n,
                    "accepted/s": n / accepted * 1e9,
                    "CPU s/100k": cpu / max(found["count"], 1) * 1e5,
                },
            )

    def _down(self, line: str, board: Board, server: Worker, program: Worker) -> None:
        n = self.sizes.frames
        for name, size, rate in (
            ("String 16 B down", 16, 0),
            ("String 200 B down", 200, 0),
            ("String 16 B down, 20000/s", 16, 20_000),
            ("String 200 B down, 20000/s", 200, 20_000),
        ):
            board.received = 0
            before = server.do("look")["cpu"]
            start = time.monotonic()
            program.begin("write", n=n, size=size, rate=rate)
            assert program.process.stdout is not None
            while not select.select([program.process.stdout], [], [], 0)[0]:
                board.spin(0.005)
            took = time.monotonic() - start
            program.end()
            left = -1
            while board.received != left:
                left = board.received
                board.spin(0.2)
            cpu = server.do("look")["cpu"] - before
            self._row(
                name,
                line,
                {
                    "frames/s": board.received / took,
                    "delivered": board.received / n,
                    "CPU s/100k": cpu / max(board.received, 1) * 1e5,
                },
            )

    def _paced(self, line: str, board: Board, program: Worker) -> None:
        """What a line of 3 Mbaud carries, 10 700 frames a second, and 20 000 a second: is every frame delivered?"""
        one = frame(UP, string("0" * 16))
        for rate in (10_700, 20_000):
            program.do("reset")
            start = time.monotonic()
            n = 0
            while n < self.sizes.frames:
                due = min(self.sizes.frames, int((time.monotonic() - start) * rate) + 1)
                if due > n:
                    board.write(one * (due - n))
                    n = due
                time.sleep(0.002)
            took = time.monotonic() - start
            board.spin(0.5)
            self._row(
                f"String 16 B up, {rate}/s",
                line,
                {"frames/s": n / took, "delivered": program.do("look")["count"] / n},
            )

    def _latency(self, line: str, board: Board, program: Worker) -> None:
        """Calm, where every process has to be woken for each message, and in a row."""
        for rate in (100, 1000):
            program.do("reset")
            for _ in range(self.sizes.pings):
                board.write(frame(UP, string(f"{time.monotonic_ns():016x}")))
                board.spin(1 / rate)
            up = program.do("delays")["delays"]
            board.delays.clear()
            program.begin("write", n=self.sizes.pings, period=1 / rate)
            board.until(lambda: len(board.delays) >= self.sizes.pings)
            program.end()
            for way, delays in (("up", up), ("down", board.delays)):
                self._row(
                    f"latency {way}, {rate}/s",
                    line,
                    {"p50 ms": percentile(delays, 0.5), "p99 ms": percentile(delays, 0.99), "n": len(delays)},
                )

    def _connect(self, server: Worker) -> None:
        times = []
        for _ in range(self.sizes.tries):
            start = time.monotonic_ns()
            with over_tcp(server) as board:
                board.until(lambda b=board: b.connected)  # type: ignore[misc]
                times.append(time.monotonic_ns() - start)
        self._row("connect", "tcp", {"p50 ms": percentile(times, 0.5), "worst ms": max(times) / 1e6})

    def _recover(self, board: Board) -> None:
        times = []
        for _ in range(self.sizes.tries):
            board.spin(0.1)
            board.connected = False
            start = time.monotonic_ns()
            board.until(lambda: board.connected)
            times.append(time.monotonic_ns() - start)
        self._row(
            "recover after reset", "tcp", {"p50 ms": percentile(times, 0.5), "worst ms": max(times) / 1e6}
        )

    def _relay(self, line: str, board: Board, relay: Worker) -> None:
        one = frame(UP, string("0" * 16))
        n = self.sizes.frames
        relay.do("reset", echo=False)
        before = relay.do("look")["cpu"]
        start = time.monotonic_ns()
        for _ in range(0, n, 100):
            board.write(one * 100)
        end = time.monotonic() + LIMIT_S
        while (found := relay.do("look"))["count"] < n * len(one) and time.monotonic() < end:
            time.sleep(0.01)
        self._row(
            "bare relay up",
            line,
            {
                "frames/s": found["count"] / len(one) / (found["last"] - start) * 1e9,
                "CPU s/100k": (found["cpu"] - before) / n * 1e5,
            },
        )
        relay.do("reset", echo=True)
        trips = []
        for _ in range(self.sizes.pings):
            start = time.monotonic_ns()
            os.write(board.fd, one)
            got = 0
            while got < len(one):
                select.select([board.fd], [], [], 1)
                got += len(os.read(board.fd, 4096))
            trips.append((time.monotonic_ns() - start) // 2)
            time.sleep(0.005)
        self._row(
            "bare relay, half a trip",
            line,
            {"p50 ms": percentile(trips, 0.5), "p99 ms": percentile(trips, 0.99)},
        )

    def _idle(self) -> None:
        with ExitStack() as stack:
            server = Worker("server", "--space", self.space)
            stack.callback(server.close)
            boards = [stack.enter_context(over_tcp(server)) for _ in range(self.sizes.boards)]
            for board in boards:
                board.until(lambda b=board: b.connected)  # type: ignore[misc]
            time.sleep(0.5)
            before = server.do("look")["cpu"]
            start = time.monotonic()
            asked = start
            while time.monotonic() < start + self.sizes.idle:
                for board in boards:
                    board.read()
                    if time.monotonic() >= asked:
                        board.write(frame(TIME, bytes(8)))
                if time.monotonic() >= asked:
                    asked += 2.5
                time.sleep(0.1)
            used = server.do("look")["cpu"] - before
            took = time.monotonic() - start
            self._row(f"idle, {len(boards)} boards", "tcp", {"% of a core": 100 * used / took})


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the benchmark; returns the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="only to see that it works")
    parser.add_argument("--dds", type=int, metavar="DOMAIN", help="the program is another process, over DDS")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows there, too")
    given = parser.parse_args(argv)
    bench = Bench(QUICK if given.quick else FULL, given.dds)
    print(f"rosserial server, {bench.space.partition(':')[0]} space")
    bench.run()
    if given.json:
        given.json.write_text(json.dumps(bench.rows, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
