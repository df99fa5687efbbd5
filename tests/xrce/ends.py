"""Two ends of a session for tests: a device's, with buffers made at the start, and a host's, with queues."""

import random
import struct
from collections.abc import Callable
from typing import Any

from muros.xrce._types import Buffer
from muros.xrce.beginning import make_input, make_output
from muros.xrce.constants import HANDLED, LATER
from muros.xrce.queues import HostSession, QueuedOutput, QueuedReliableOutput, resume
from muros.xrce.streams import Output

KEY = b"\xaa\xbb\xcc\xdd"
RELIABLE = 0x80
NUMBERS = 0x10000


class End(HostSession):
    """One end. ``out`` keeps what it sends, ``got`` the payloads it handled; ``is_busy()`` says to answer LATER."""

    def __init__(
        self,
        *,
        hosts: bool,
        mtu: int = 64,
        window: int = 4,
        keyed: bool = False,
        start: int = 0,
        largest: int = 1 << 20,
    ) -> None:
        self.begin(1 if keyed else 0x81, KEY, self._keep, largest)
        self.hosts = hosts
        self.mtu = mtu
        self.out: list[bytes] = []
        self.got: list[bytes] = []
        self.is_busy: Callable[[], bool] = lambda: False
        self.stop_at_failure = False
        output: Any = make_output(RELIABLE, mtu, self.head, window, 100)
        output.__class__ = QueuedOutput
        if hosts:
            output = QueuedReliableOutput(RELIABLE, mtu, self.head, window, 100)
        output.next = output.first = output.sent = start
        self.outputs[RELIABLE] = output
        self._window = window
        self._begin = start
        self.make_input(RELIABLE)

    def make_input(self, stream_id: int) -> Any:
        """Every stream comes into being."""
        stream = make_input(stream_id, 0, 1)
        if stream_id >= RELIABLE:
            stream = make_input(stream_id, self.mtu, self._window)
            stream.expected = self._begin
        self.inputs[stream_id] = stream
        return stream

    def has_room(self) -> bool:
        """Whether one more message can be begun."""
        stream = self.outputs[RELIABLE]
        return bool((stream.next - stream.first) % NUMBERS < stream.history)

    def post(self, body: bytes, now: int) -> bool:
        """Sends a WRITE_DATA that fits a message; False when there is no room. (An empty one runs to the end of its
        message: real ones begin with ids.)"""
        submessage = struct.pack("<BBH", 7, 1, len(body)) + body
        stream = self.outputs[RELIABLE]
        if self.hosts:
            return bool(stream.post(submessage, self.send, now))
        return write(stream, submessage)

    def take(self) -> list[bytes]:
        """What was sent since the last call."""
        out, self.out = self.out, []
        return out

    def tell(self, message: bytes, now: int) -> None:
        """A message arrives."""
        assert self.receive(message, 0, len(message), now)

    def _keep(self, buf: Buffer, off: int, n: int) -> None:
        message = bytes(buf[off : off + n])
        assert len(message) <= self.mtu
        self.out.append(message)

    def answer(self, kind: int, flags: int, buf: Buffer, off: int, n: int, stream_id: int) -> int:
        """Takes a submessage."""
        if self.is_busy():
            return LATER
        self.got.append(bytes(buf[off : off + n]))
        return HANDLED


def write(stream: Output, submessage: bytes) -> bool:
    """Puts a submessage into a board's stream; False when there is no room."""
    n = len(submessage) - 4
    at = stream.place(n)
    if at < 0:
        return False
    stream.buf[at + 4 : at + 4 + n] = submessage[4:]
    stream.commit(at, submessage[0] | submessage[1] << 8, n)
    return True


def converse(
    one: End, other: End, dice: random.Random, bodies: list[bytes], *, loss: float, rounds: int = 4000
) -> int:
    """Both send ``bodies`` to each other over a line that loses, doubles and shuffles; the time it took (ms).

    Ends when both have everything acknowledged; raises AssertionError if that does not come.
    """
    line: list[tuple[End, bytes]] = []
    left = {id(one): list(bodies), id(other): list(bodies)}
    for now in range(0, rounds * 10, 10):
        for end, peer in ((one, other), (other, one)):
            todo = left[id(end)]
            while todo and end.has_room() and end.post(todo[0], now):
                del todo[0]
            resume(end, RELIABLE, now)
            end.flush(now)
            for message in end.take():
                for _ in range(2 if dice.random() < 0.1 else 1):
                    if dice.random() >= loss:
                        line.append((peer, message))
        dice.shuffle(line)
        keep = len(line) // 4
        arriving, line = line[keep:], line[:keep]
        for end, message in arriving:
            end.tell(message, now)
        if not any(left.values()) and one.outputs[RELIABLE].idle() and other.outputs[RELIABLE].idle():
            return now
    raise AssertionError("it does not end")
