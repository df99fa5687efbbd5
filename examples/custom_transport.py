"""A transport of your own: four functions carry the messages, here through a UDP socket.

    python custom_transport.py 192.168.1.10 8888

prints

    Sent: 0

Whatever can carry bytes will do: a radio, a CAN bus, another program. `Custom(..., framing=True)` is for ways that know
no messages, only bytes.
"""

import socket
import sys

from counting import count_up

from muros.client import Custom
from muros.rclc import Context, Executor

place = socket.getaddrinfo(sys.argv[1], int(sys.argv[2]))[0][-1]
wires: "list[socket.socket]" = []


def open_wire() -> bool:
    """Opens the way; called again after it was lost."""
    wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    wire.setblocking(False)
    wire.connect(place)
    wires.append(wire)
    return True


def close_wire() -> None:
    """Closes it."""
    wires.pop().close()


def write(buf: "bytes | bytearray | memoryview", off: int, n: int) -> None:
    """Sends a message."""
    wires[0].send(bytes(buf[off : off + n]))


def read(buf: bytearray) -> int:
    """Takes a message, if there is one."""
    try:
        data = wires[0].recv(len(buf))
    except OSError:
        return 0
    buf[: len(data)] = data
    return len(data)


context = Context(Custom(open_wire, close_wire, write, read))
node = context.node("custom_transport")
count_up(node)
Executor(context).spin()
