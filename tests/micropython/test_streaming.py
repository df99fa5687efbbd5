"""An image that is larger than a board's heap, streamed by MicroPython through an agent."""

import threading
from pathlib import Path
from typing import Any

from muros.client import Session, Udp
from muros.interfaces import board
from muros.rclc import Context, Executor
from tests.micropython.runtimes import require
from tests.micropython.test_lifecycle import stage
from tests.micropython.tree import board_tree, compiled, write
from tests.micropython.unix import run_mpy
from tests.rclc_space.ways import PATIENCE, Stage

from sensor_msgs.msg import Image

__all__ = ["stage"]

HEAP = "100K"
"""Of 64 bit; the image alone has 200 kB."""

CAMERA = """
import sys
from muros.client import Udp
from muros.compat import loans, sleep_ms
from muros.rclc import Context, Executor, Streamer

from sensor_msgs.msg import Image

context = Context(Udp("127.0.0.1", int(sys.argv[1])))
node = context.node("camera")
ended = []

def fill(buf, off, n, at):
    for i in range(n):
        buf[off + i] = at + i & 0xFF

executor = Executor(context)
frames = Streamer(node.publisher(Image, "image"), fill, on_end=ended.append)
image = Image(height=400, width=500, encoding="mono8", step=500)
while not ended:
    if not frames.busy:
        frames.publish(image, 200_000)
    executor.spin_some(0.02)
for i in range(30):
    executor.spin_some(0.01)
print(ended, loans)
context.close()
"""


def test_an_image_larger_than_the_heap(stage: Stage, tmp_path: Path) -> None:
    require("unix")
    require("mpy-cross")
    way: Any = stage.way
    came: list[Image] = []
    context = Context(Session(Udp("127.0.0.1", way.link.port), largest=300_000))
    stage.contexts.append(context)
    stage.executors.append(Executor(context))
    context.node("screen").subscription(Image, "image", came.append)
    assert context.wait_connected(PATIENCE)
    files = board_tree() | {
        path: text.encode() for path, text in board.sources(["sensor_msgs/msg/Image"]).items()
    }
    folder = write(compiled(files, march="x64"), tmp_path)
    output: list[str] = []

    def run() -> None:
        output.append(run_mpy(CAMERA, [str(way.link.port)], heapsize=HEAP, library=[folder]))

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    stage.until(lambda: came or not thread.is_alive())
    thread.join()
    stage.until(lambda: came)
    assert output == ["[True] []\n"]
    assert (came[0].height, came[0].width, came[0].encoding) == (400, 500, "mono8")
    assert bytes(came[0].data) == bytes(range(256)) * 781 + bytes(range(64))
