"""Publishes 100 000 bytes that are never there at once: they are made while they are sent.

    python streamed_image.py udp:192.168.1.10:8888

prints

    Sent: 100000 bytes
"""

from way import open_context

from muros.rclc import Executor, Streamer

from std_msgs.msg import UInt8MultiArray

SIZE = 100_000

context = open_context()
node = context.node("streamed_image")


def fill(buf: bytearray, off: int, n: int, at: int) -> None:
    """Gives the bytes from the ``at``-th on."""
    for i in range(n):
        buf[off + i] = (at + i) % 251


def ended(sent: bool) -> None:
    """All of it was sent, or it was given up."""
    if sent:
        print("Sent:", SIZE, "bytes")


frames = Streamer(node.publisher(UInt8MultiArray, "image"), fill, on_end=ended)
message = UInt8MultiArray()


def send() -> None:
    """Begins the next one, once the last has been sent."""
    if not frames.busy:
        frames.publish(message, SIZE)


node.timer(0.2, send)
Executor(context).spin()
