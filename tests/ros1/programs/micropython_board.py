"""``micropython-rosserial`` on CPython: a board that publishes each line of its input and prints what it hears.

Usage: micropython_board.py SOURCES PORT. The package is used as it is; only the modules of MicroPython that it imports
are stood in for, and its UART is a TCP connection to a server.
"""

from __future__ import annotations

import os
import socket
import struct
import sys
import types
from typing import Any


class Bytes(str):
    """Text of MicroPython's StringIO, which may hold any bytes."""

    raw: bytes

    def encode(self, *_: Any) -> bytes:
        return self.raw


class StringIO:
    """MicroPython's, which takes bytes."""

    def __init__(self) -> None:
        self._data = b""

    def write(self, data: bytes) -> None:
        self._data += data

    def getvalue(self) -> Bytes:
        made = Bytes()
        made.raw = self._data
        return made


def pack(form: str, *values: Any) -> bytes:
    """``struct.pack`` of MicroPython, which takes text for ``s``."""
    return struct.pack(form, *(value.encode() if isinstance(value, str) else value for value in values))


class Uart:
    """A connection that reads and writes like a UART."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port))

    def read(self, n: int) -> bytes:
        data = b""
        while len(data) < n:
            piece = self._socket.recv(n - len(data))
            if not piece:
                os._exit(0)
            data += piece
        return data

    def write(self, data: bytes) -> None:
        self._socket.sendall(data)


class String:
    """std_msgs/String as micropython-genpy makes it."""

    _type = "std_msgs/String"
    _md5sum = "992ce8a1687cec8c8bd883ec73ca41d1"

    def __init__(self, data: str = "") -> None:
        self.data = data

    def serialize(self, buffer: StringIO) -> None:
        raw = self.data.encode()
        buffer.write(struct.pack(f"<I{len(raw)}s", len(raw), raw))

    def deserialize(self, data: bytes) -> String:
        (size,) = struct.unpack_from("<I", data)
        self.data = data[4 : 4 + size].decode()
        return self


def stand_in(name: str, **members: Any) -> None:
    """A module of MicroPython."""
    module = types.ModuleType(name)
    module.__dict__.update(members)
    sys.modules[name] = module


def main() -> None:
    """Plays the board until its input ends."""
    stand_in("machine")
    stand_in("uio", StringIO=StringIO)
    stand_in("ustruct", pack=pack, unpack=struct.unpack)
    sys.path.insert(0, sys.argv[1])
    import uros

    node = uros.NodeHandle(serial=Uart(int(sys.argv[2])))
    node.subscribe("listen", String, lambda message: print("heard", message.data, flush=True))
    print("ready", flush=True)
    node.publish("greet", String("first"))
    for line in sys.stdin:
        node.publish("greet", String(line.rstrip("\n")))
    os._exit(0)


if __name__ == "__main__":
    main()
