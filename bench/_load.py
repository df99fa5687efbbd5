"""Raw XRCE clients for load: bytes and sockets only, so that what is measured is the agent and not a client library.

A `Client` is one socket with the few numbers that a session needs. `drive` brings many of them through stages of
requests and answers (connect, create, read, leave). The loads are loops of their own: `closed_loop` keeps ``history``
messages of each writer unacknowledged, `paced` sends at a fixed rate, `latency` sends one message at a time. All are
bounded in time, and all take a plain relay for an agent: a message that comes back counts as its acknowledgement.
"""

import select
import socket
import struct
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from bench._load_server import Server

SESSION = 0x81
RELIABLE = 0x80
BEST_EFFORT = 0x01
_CREATE_CLIENT, _CREATE, _DELETE, _STATUS_AGENT, _STATUS = 0, 1, 3, 4, 5
_WRITE, _READ, _DATA, _ACKNACK, _HEARTBEAT = 7, 8, 9, 10, 11
_LITTLE = 1
_REPLACE = 4
_WINDOW = 16
_RETRY_S = 0.2


class LoadError(Exception):
    """The server does not do what the load needs of it."""


class Client:
    """One client on a socket of its own. ``sent``, ``acked`` and ``expected`` are sequence numbers of stream 0x80."""

    __slots__ = (
        "acked",
        "early",
        "expected",
        "got",
        "key",
        "recv",
        "send",
        "sent",
        "sock",
        "stage",
        "stages",
        "touched",
    )

    def __init__(self, port: int, key: int) -> None:
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.connect(("127.0.0.1", port))
        self.sock.setblocking(False)
        self.send = self.sock.send
        self.recv = self.sock.recv
        self.key = key
        self.sent = self.acked = self.expected = 0
        self.early: set[int] = set()
        self.stages: Sequence[Stage] = ()
        self.stage = self.got = 0
        self.touched = 0.0

    def take(self, data: bytes) -> bool:
        """Notes and acknowledges a message of a reliable stream; whether it is new."""
        number = data[2] | data[3] << 8
        ahead = number - self.expected & 0xFFFF
        new = ahead < _WINDOW and number not in self.early
        if ahead == 0:
            number = number + 1 & 0xFFFF
            while number in self.early:
                self.early.remove(number)
                number = number + 1 & 0xFFFF
            self.expected = number
        elif new:
            self.early.add(number)
        self.acknowledge(self._missing())
        return new

    def acknowledge(self, missing: int = 0) -> None:
        """Sends an ACKNACK."""
        first = self.expected
        self.send(
            bytes(
                (
                    SESSION,
                    0,
                    0,
                    0,
                    _ACKNACK,
                    _LITTLE,
                    5,
                    0,
                    first & 255,
                    first >> 8,
                    missing >> 8,
                    missing & 255,
                    RELIABLE,
                )
            )
        )

    def acknowledged(self, first: int) -> int:
        """Takes the ``first_unacked`` of an ACKNACK; how many messages it frees."""
        moved = first - self.acked & 0xFFFF
        if moved > (self.sent - self.acked & 0xFFFF):
            return 0
        self.acked = first
        return moved

    def heartbeat(self) -> None:
        """Asks the agent what it lacks."""
        first, last = self.acked, self.sent - 1 & 0xFFFF
        self.send(struct.pack("<4B4BHHB", SESSION, 0, 0, 0, _HEARTBEAT, _LITTLE, 5, 0, first, last, RELIABLE))

    def on_heartbeat(self, data: bytes) -> None:
        """Tells the agent what is missing."""
        last = data[10] | data[11] << 8
        count = last + 1 - self.expected & 0xFFFF
        self.acknowledge(0 if count > 0x8000 else self._missing() | self._absent(min(count, 16)))

    def _missing(self) -> int:
        if not self.early:
            return 0
        return self._absent(1 + max(number - self.expected & 0xFFFF for number in self.early))

    def _absent(self, count: int) -> int:
        return sum(1 << i for i in range(count) if self.expected + i & 0xFFFF not in self.early)

    def close(self) -> None:
        """Closes the socket; the agent is not told."""
        self.sock.close()


def messages(stream_id: int, size: int) -> list[bytes]:
    """A WRITE_DATA of ``size`` bytes for every sequence number; all clients send the same ones."""
    length = 4 + size
    body = bytes((_WRITE, _LITTLE, length & 255, length >> 8, 0, 9, 0, 0x15)) + bytes(size)
    return [bytes((SESSION, stream_id, n & 255, n >> 8)) + body for n in range(0x10000)]


# Sessions


@dataclass(frozen=True, slots=True)
class Stage:
    """Messages to send, each a submessage; ``answers`` submessages of ``kind`` end the stage."""

    submessages: tuple[bytes, ...]
    kind: int
    answers: int
    stream_id: int = RELIABLE


def connect(key: int, mtu: int = 1024) -> Stage:
    """Opens a session."""
    body = b"XRCE\1\0\1\x0f" + key.to_bytes(4, "big") + bytes((SESSION, 0)) + mtu.to_bytes(2, "little")
    return Stage((_submessage(_CREATE_CLIENT, body),), _STATUS_AGENT, 1, 0)


def create(topic: str, *, writer: bool = True, reader: bool = False, depth: int = 16) -> Stage:
    """Makes a participant, a topic, and what is to use it; reliable, keep last ``depth``, volatile."""
    qos = struct.pack("<BxHBxHBBB", 1, 3, 1, depth, 0, 0, 0)
    objects = [
        (0x11, 1, b"\0\1\0\0" + _string("load"), b"\0\0"),
        (0x12, 2, _string(topic) + _pad(b"\0\1", len(topic)) + _string("load::Blob") + b"", b"\0\x11"),
    ]
    if writer:
        objects += [(0x13, 3, b"\0\0", b"\0\x11"), (0x15, 5, b"\0\x12" + qos + b"\0", b"\0\x13")]
    if reader:
        objects += [(0x14, 4, b"\0\0", b"\0\x11"), (0x16, 6, b"\0\x12" + qos + b"\0\0", b"\0\x14")]
    creates = tuple(_create(*each, number=0x0A + i) for i, each in enumerate(objects))
    return Stage(creates, _STATUS, len(creates))


def read(stream_id: int = RELIABLE) -> Stage:
    """Starts a reading without end."""
    body = bytes((0, 0x20, 0, 0x16, stream_id, 0, 0, 1)) + struct.pack("<HHHH", 0xFFFF, 0, 0, 0)
    return Stage((_submessage(_READ, body),), _ACKNACK, 1)


def leave() -> Stage:
    """Closes the session."""
    return Stage((_submessage(_DELETE, b"\0\2\xff\xfe"),), _STATUS, 1, 0)


def drive(
    clients: Iterable[Client], stages: Callable[[Client], Sequence[Stage]], at_once: int, limit: float
) -> float:
    """Brings each client through its stages, ``at_once`` of them at a time; the seconds it took.

    Raises LoadError after ``limit`` seconds.
    """
    poll = select.epoll()
    waiting = list(clients)[::-1]
    running: dict[int, Client] = {}
    start = time.perf_counter()
    try:
        while waiting or running:
            while waiting and len(running) < at_once:
                client = waiting.pop()
                client.stages, client.stage = stages(client), 0
                _begin_stage(client)
                running[client.sock.fileno()] = client
                poll.register(client.sock, select.EPOLLIN)
            for fd, _ in poll.poll(_RETRY_S / 4):
                client = running[fd]
                if _drive_one(client):
                    poll.unregister(fd)
                    del running[fd]
            now = time.perf_counter()
            if now - start > limit:
                raise LoadError(f"{len(running) + len(waiting)} clients not served after {limit:.0f} s")
            for client in running.values():
                if now - client.touched > _RETRY_S:
                    _send_stage(client)
    finally:
        poll.close()
    return time.perf_counter() - start


def _begin_stage(client: Client) -> None:
    stage = client.stages[client.stage]
    client.got = 0
    if stage.kind == _STATUS_AGENT:
        client.sent = client.acked = client.expected = 0
        client.early.clear()
    if stage.stream_id:
        client.sent = client.sent + len(stage.submessages) & 0xFFFF
    _send_stage(client)


def _send_stage(client: Client) -> None:
    stage = client.stages[client.stage]
    client.touched = time.perf_counter()
    first = client.sent - len(stage.submessages) & 0xFFFF if stage.stream_id else 0
    session_id = SESSION if stage.kind != _STATUS_AGENT else 0x80
    for i, submessage in enumerate(stage.submessages):
        number = first + i & 0xFFFF if stage.stream_id else 0
        client.send(bytes((session_id, stage.stream_id, number & 255, number >> 8)) + submessage)


def _drive_one(client: Client) -> bool:
    """Takes what has come for a client; whether it has been through all its stages."""
    try:
        while True:
            data = client.recv(2048)
            stage = client.stages[client.stage]
            kind = data[4]
            if kind == _HEARTBEAT:
                client.on_heartbeat(data)
            elif kind == _ACKNACK:
                client.acknowledged(data[8] | data[9] << 8)
            new = client.take(data) if data[1] & 0x80 and kind != _WRITE else True
            if kind == stage.kind and new:
                if kind in (_STATUS, _STATUS_AGENT) and data[-2 if kind == _STATUS else 8] & 0x80:
                    raise LoadError(f"refused: {data.hex()}")
                client.got += 1
                if client.got >= stage.answers:
                    client.stage += 1
                    if client.stage == len(client.stages):
                        return True
                    _begin_stage(client)
    except BlockingIOError:
        return False


def _submessage(kind: int, body: bytes, flags: int = _LITTLE) -> bytes:
    return bytes((kind, flags, len(body) & 255, len(body) >> 8)) + body


def _create(object_id: int, kind: int, blob: bytes, parent: bytes, *, number: int) -> bytes:
    if kind == 1:
        blob += bytes(len(blob) & 1)
    body = bytes((0, number, 0, object_id, kind, 3, 0, 0)) + len(blob).to_bytes(4, "little") + blob + parent
    return _submessage(_CREATE, body, _LITTLE | _REPLACE)


def _string(text: str) -> bytes:
    return (len(text) + 1).to_bytes(4, "little") + text.encode() + b"\0"


def _pad(head: bytes, text: int) -> bytes:
    return head + bytes(-(4 + text + 1 + len(head)) & 3)


# Loads


@dataclass(slots=True)
class Flow:
    """What a load has moved."""

    seconds: float = 0.0
    cpu: float = 0.0
    """Processor time of the server, in seconds."""
    sent: int = 0
    acked: int = 0
    delivered: int = 0
    lost: int = 0
    times: list[float] = field(default_factory=list)
    """Microseconds from writing to reading, one for each message."""

    def percentile(self, percent: float) -> float:
        """Of the times."""
        ordered = sorted(self.times)
        return ordered[min(len(ordered) - 1, int(len(ordered) * percent / 100))]


def closed_loop(
    server: Server,
    writers: Sequence[Client],
    readers: Sequence[Client],
    history: int,
    table: list[bytes],
    seconds: float,
) -> Flow:
    """Reliable messages, ``history`` of each writer unacknowledged."""
    flow = Flow()
    clients = {client.sock.fileno(): client for client in (*writers, *readers)}
    poll = select.epoll()
    for fd in clients:
        poll.register(fd, select.EPOLLIN)
    writing = set(writers)
    acked = delivered = sent = 0
    cpu = server.cpu()
    start = now = time.perf_counter()
    deadline, check = start + seconds, start + 0.1
    try:
        for client in writers:
            for _ in range(history):
                client.send(table[client.sent])
                client.sent = client.sent + 1 & 0xFFFF
        sent = history * len(writers)
        before = {client: client.acked for client in writers}
        while now < deadline:
            for fd, _ in poll.poll(0.05):
                client = clients[fd]
                recv = client.recv
                try:
                    while True:
                        data = recv(2048)
                        kind = data[4]
                        if kind == _ACKNACK:
                            moved = data[8] + (data[9] << 8) - client.acked & 0xFFFF
                            if moved <= history:
                                client.acked = client.acked + moved & 0xFFFF
                                acked += moved
                            if data[10] or data[11]:
                                flow.lost += _send_again(client, data[11] | data[10] << 8, table)
                        elif kind == _DATA:
                            delivered += client.take(data)
                        elif kind == _WRITE:  # from a relay
                            client.acked = client.acked + 1 & 0xFFFF
                            acked += 1
                        elif kind == _HEARTBEAT:
                            client.on_heartbeat(data)
                except BlockingIOError:
                    pass
                if client in writing:
                    number = client.sent
                    end = client.acked + history & 0xFFFF
                    while number != end:
                        client.send(table[number])
                        number = number + 1 & 0xFFFF
                        sent += 1
                    client.sent = number
            now = time.perf_counter()
            if now > check:
                check = now + 0.1
                for client in writers:
                    if client.acked == before[client]:
                        client.heartbeat()
                    before[client] = client.acked
    finally:
        poll.close()
    flow.seconds = now - start
    flow.cpu = server.cpu() - cpu
    flow.sent, flow.acked, flow.delivered = sent, acked, delivered
    settle((*writers, *readers))
    return flow


def _send_again(client: Client, bitmap: int, table: list[bytes]) -> int:
    pending = client.sent - client.acked & 0xFFFF
    wanted = [i for i in range(min(pending, 16)) if bitmap >> i & 1]
    for i in wanted:
        client.send(table[client.acked + i & 0xFFFF])
    return len(wanted)


def paced(
    server: Server,
    writers: Sequence[Client],
    readers: Sequence[Client],
    table: list[bytes],
    rate: float,
    seconds: float,
) -> Flow:
    """Best-effort messages at ``rate`` a second in all, in bursts of a millisecond.

    The time ends when the server has emptied its socket; what it could not take counts as lost.
    """
    flow = Flow()
    poll = select.epoll()
    clients = {client.sock.fileno(): client for client in readers}
    for fd in clients:
        poll.register(fd, select.EPOLLIN)
    _, dropped = server.queue()
    cpu = server.cpu()
    sent = delivered = turn = 0
    count = len(writers)
    start = now = time.perf_counter()
    try:
        while now < start + seconds:
            due = int((now - start) * rate) + 1
            while sent < due:
                client = writers[turn]
                turn = turn + 1 if turn + 1 < count else 0
                client.send(table[client.sent])
                client.sent = client.sent + 1 & 0xFFFF
                sent += 1
            if clients:
                delivered += _drain(poll, clients)
            pause = (sent / rate) - (time.perf_counter() - start)
            if pause > 0.0002:
                time.sleep(min(pause, 0.001))
            now = time.perf_counter()
        end = now + 2.0
        while server.queue()[0] and now < end:
            if clients:
                delivered += _drain(poll, clients)
            now = time.perf_counter()
        flow.seconds = now - start
        flow.cpu = server.cpu() - cpu
        if clients:
            time.sleep(0.02)
            delivered += _drain(poll, clients)
    finally:
        poll.close()
    flow.sent, flow.delivered = sent, delivered
    flow.lost = sent - delivered if readers else server.queue()[1] - dropped
    return flow


def _drain(poll: select.epoll, clients: dict[int, Client]) -> int:
    count = 0
    for fd, _ in poll.poll(0):
        recv = clients[fd].recv
        try:
            while True:
                data = recv(2048)
                count += data[4] == _DATA or data[4] == _WRITE
        except BlockingIOError:
            pass
    return count


def latency(writer: Client, reader: Client, table: list[bytes], count: int, pause: float) -> Flow:
    """``count`` messages, the next one ``pause`` seconds after the last has come."""
    flow = Flow()
    reliable = table[0][1] >= 0x80
    ready = select.poll()
    ready.register(reader.sock, select.POLLIN)
    start = time.perf_counter()
    for _ in range(count):
        begin = time.perf_counter()
        writer.send(table[writer.sent])
        writer.sent = writer.sent + 1 & 0xFFFF
        while True:
            if not ready.poll(1000):
                flow.lost += 1
                break
            data = reader.recv(2048)
            if data[4] == _DATA or data[4] == _WRITE:
                flow.times.append((time.perf_counter() - begin) * 1e6)
                break
            if data[4] == _HEARTBEAT:
                reader.on_heartbeat(data)
        if reliable and data[4] == _DATA:
            reader.take(data)
        if flow.lost > 10:
            raise LoadError("messages do not arrive")
        if pause:
            time.sleep(pause)
        empty(writer)
    flow.seconds = time.perf_counter() - start
    if not flow.times:
        raise LoadError("no message arrived")
    return flow


def settle(clients: Iterable[Client], quiet: float = 0.05) -> None:
    """Waits until nothing more comes, acknowledging what is reliable, at most a second."""
    poll = select.epoll()
    by_fd = {client.sock.fileno(): client for client in clients}
    for fd in by_fd:
        poll.register(fd, select.EPOLLIN)
    end = time.perf_counter() + 1.0
    try:
        while time.perf_counter() < end:
            ready = poll.poll(quiet)
            if not ready:
                return
            for fd, _ in ready:
                empty(by_fd[fd])
    finally:
        poll.close()


def empty(client: Client) -> None:
    """Takes what has come, without looking at what it is."""
    try:
        while True:
            data = client.recv(2048)
            if data[4] == _ACKNACK:
                client.acknowledged(data[8] | data[9] << 8)
            elif data[4] == _DATA and data[1] & 0x80:
                client.take(data)
    except BlockingIOError:
        pass
