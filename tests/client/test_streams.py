"""Transports that die in the middle of something: while messages are taken, while a program takes its leave."""

import importlib
import os
import pty
import socket
import struct
import sys
import time
from collections.abc import Callable
from types import SimpleNamespace

import pytest

from muros.client import LOST, Serial, Session, Tcp, Udp
from muros.client._types import Transport
from muros.client.stream import Stream
from muros.xrce.framing import serial_frame
from tests.client.agent_thread import PATIENCE

MESSAGE = b"\x81\x80\0\0\0\0\0\0"
WELCOME = bytes.fromhex("81000000 04010600 000058524345".replace(" ", ""))
RESET = struct.pack("ii", 1, 0)


def until(condition: Callable[[], object]) -> None:
    """Waits in real time."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"nothing came of it within {PATIENCE} s"
        time.sleep(0.001)


def tcp() -> tuple[Tcp, socket.socket, socket.socket]:
    """A connected transport, its peer, and the server."""
    server = socket.create_server(("127.0.0.1", 0))
    transport = Tcp("127.0.0.1", server.getsockname()[1])
    until(transport.open)
    peer, _ = server.accept()
    return transport, peer, server


def framed(message: bytes) -> bytes:
    return len(message).to_bytes(2, "little") + message


def test_tcp_that_dies_in_a_send_while_messages_are_taken() -> None:
    transport, peer, server = tcp()
    with server:
        peer.sendall(framed(MESSAGE) * 8)
        transport.wait(1000)
        peer.close()  # with nothing unread: what we send next is answered with a reset
        taken: list[bytes] = []

        def deliver(buf: bytes | bytearray | memoryview, off: int, n: int) -> None:
            taken.append(bytes(buf[off : off + n]))

            def died() -> bool:
                transport.send(b"answer", 0, 6)
                return transport._file is None

            if len(taken) == 3:
                until(died)

        assert transport.receive(deliver) == 3
        assert taken == [MESSAGE] * 3
        transport.wait(10)
        transport.send(b"to nobody", 0, 9)
        with pytest.raises(OSError, match="104"):
            transport.receive(deliver)
        transport.close()


def test_a_session_survives_tcp_that_dies_in_a_send() -> None:
    transport, peer, server = tcp()
    session = Session(transport, 7, retry=10)
    with server:
        session.spin_once()
        assert peer.recv(100)
        peer.sendall(framed(WELCOME))
        until(lambda: session.spin_once() or not session.away)
        data = b"\x09\x01\x08\0\0\0\0\x06abcd"
        for i in range(10):
            peer.sendall(framed(bytes((0x81, 0x80, i, 0)) + data))
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
        peer.close()
    until(lambda: session.spin_once() or session.state == LOST)
    session.close()


def test_closing_a_session_whose_way_is_dead() -> None:
    transport, peer, server = tcp()
    session = Session(transport, 7)
    with server:
        session.spin_once()
        peer.sendall(framed(WELCOME))
        until(lambda: session.spin_once() or not session.away)
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
        peer.close()
        session.close()
    assert session.state == 0


def test_a_port_that_is_closed_while_frames_are_taken() -> None:
    ours, theirs = pty.openpty()
    serial = Serial(os.ttyname(theirs))
    try:
        assert serial.open()
        os.write(ours, serial_frame(MESSAGE * 10, 0, 1) * 4)
        assert serial.receive(lambda buf, off, n: serial.close()) == 1
        serial.wait(10)
        serial.send(MESSAGE, 0, 8)
        with pytest.raises(OSError, match="19"):
            serial.receive(lambda buf, off, n: None)
    finally:
        os.close(ours)
        os.close(theirs)


def test_a_port_whose_far_end_is_gone() -> None:
    ours, theirs = pty.openpty()
    serial = Serial(os.ttyname(theirs))
    assert serial.open()
    os.close(theirs)
    os.close(ours)
    serial.send(MESSAGE, 0, 8)
    assert serial._file is None, "a write that fails closes"
    with pytest.raises(OSError, match="19"):
        serial.receive(lambda buf, off, n: None)


def test_a_socket_that_is_closed_while_datagrams_are_taken() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as agent:
        agent.bind(("127.0.0.1", 0))
        udp = Udp("127.0.0.1", agent.getsockname()[1])
        assert udp.open()
        udp.send(b"hello", 0, 5)
        _, address = agent.recvfrom(100)
        for _ in range(3):
            agent.sendto(MESSAGE, address)
        udp.wait(1000)
        assert udp.receive(lambda buf, off, n: udp.close()) == 1


@pytest.mark.parametrize(
    "transport", [Udp("127.0.0.1"), Tcp("127.0.0.1"), Serial("/dev/null")], ids=lambda t: type(t).__name__
)
def test_what_is_closed_takes_calls(transport: Transport) -> None:
    transport.send(MESSAGE, 0, 8)
    transport.wait(1000)
    transport.close()


class Reluctant(Stream):
    """A stream whose file takes a few bytes at a time, and then none."""

    def __init__(self, patience: int) -> None:
        self.left = patience
        self.ours, self.theirs = socket.socketpair()
        self._attach(self.ours, self.ours.recv, self._some)
        self.written = b""

    def _some(self, data: memoryview) -> int | None:
        if self.left == 0:
            raise BlockingIOError(11, "later")
        self.left -= 1
        if self.left % 2:
            return None  # as a raw file says that it has no room
        self.written += bytes(data[:3])
        return min(3, len(data))


def test_all_is_written_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = Reluctant(20)
    assert stream._write(b"..in several parts", 2, 16)
    assert stream.written == b"in several parts"
    ticks = iter(range(0, 10_000, 100))
    monkeypatch.setattr("muros.client.stream.ticks_ms", lambda: next(ticks))
    assert not stream._write(bytes(100), 0, 100), "it takes nothing for two seconds"
    assert stream._file is None
    assert next(ticks) <= 2300
    stream.theirs.close()


def test_a_uart_of_a_board(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    asked: list[object] = []

    class UART:
        """The pins of a board that lead to a socket."""

        def __init__(self, *arguments: object, **pins: object) -> None:
            asked.append((arguments, pins))
            self.fileno = ours.fileno
            self.readinto = ours.recv_into
            self.write = ours.send

    monkeypatch.setitem(sys.modules, "machine", SimpleNamespace(UART=UART))
    monkeypatch.delitem(sys.modules, "muros.client.uart", raising=False)
    uart = importlib.import_module("muros.client.uart").Uart(1, 9600, mtu=128, tx=4, rx=5)
    assert asked == [((1, 9600), {"rxbuf": 256, "timeout": 0, "tx": 4, "rx": 5})]
    got: list[bytes] = []
    assert uart.open()
    theirs.sendall(serial_frame(MESSAGE * 10, 0, 1) * 3)
    until(lambda: uart.receive(lambda buf, off, n: got.append(bytes(buf[off : off + n]))) or len(got) == 3)
    assert got == [MESSAGE * 10] * 3
    uart.send(MESSAGE, 0, 8)
    assert theirs.recv(100) == serial_frame(MESSAGE, 1, 0)
    uart.close()
    assert uart.open()
    monkeypatch.delitem(sys.modules, "muros.client.uart")
    ours.close()
    theirs.close()
