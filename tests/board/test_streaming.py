"""A sample that is streamed on every runtime: 200 kB pass through a heap that has no room for them."""

import gc

from muros.client import Session
from muros.client.raw import Raw
from muros.compat import MPY, const
from muros.rclc import Streamer
from tests.board.agent import Agent
from tests.board.harness import raises

if not MPY:
    import tracemalloc

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client._types import Outgoing

_FRAGMENT = const(13)
_LAST = const(0x02)
_SIZE = const(200000)
_ROOM = const(16000)  # bytes of heap that streaming may take, borrowed code included, on 64 bit


class Summing(Agent):
    """An agent that keeps of fragments how many bytes they had, and how many were other than they should be."""

    def __init__(self, mtu: int = 512) -> None:
        super().__init__(mtu)
        self.size = 0
        self.wrong = 0
        self.wholes: "list[int]" = []

    def handle(self, message: bytes) -> None:
        """Takes the submessages of a message; a fragment is the only one in its message, or the last."""
        if message[4] != _FRAGMENT:
            super().handle(message)
            return
        n = message[6] | message[7] << 8
        for i in range(n):
            at = self.size + i - 12  # behind a header with ids, and four bytes of the message
            if at >= 0 and message[8 + i] != at * 7 & 255:
                self.wrong += 1
        self.size += n
        if message[5] & _LAST:
            self.wholes.append(self.size)
            self.size = 0


class Camera:
    """Gives bytes and notes how much heap is in use meanwhile."""

    def __init__(self) -> None:
        self.ended: "list[bool]" = []
        self.peak = 0
        self.most = 0

    def fill(self, buf: "bytearray", off: int, n: int, at: int) -> None:
        for i in range(n):
            buf[off + i] = (at + i) * 7 & 255
        self.most = max(self.most, n)
        if at // _SIZE // 20 != (at + n) // _SIZE // 20 or at % 16 == 0:
            self.peak = max(self.peak, used())


def used() -> int:
    """Bytes of heap in use."""
    if MPY:
        gc.collect()
        in_use: int = gc.mem_alloc()  # type: ignore[attr-defined]
        return in_use
    return tracemalloc.get_traced_memory()[1]


def measures() -> bool:
    """Whether garbage is told from what is used: one of the builds collects only between two programs."""
    before = used()
    for _ in range(100):
        bytearray(1000)
    return not MPY or used() - before < 50000


class Rig:
    """A session with an agent, and a camera whose bytes it streams."""

    def __init__(self) -> None:
        self.agent = Summing()
        self.session = Session(self.agent, 0xBA5EBA11)
        self.writer = self.session.writer(
            self.session.participant("board"), "rt/image", "sensor_msgs/msg/Image"
        )
        self.camera = Camera()
        self.streamer = Streamer(self.writer, self.camera.fill, 1, None, self.camera.ended.append)
        self.now = 0
        self.spin(20)

    def spin(self, turns: int) -> None:
        """Turns of 10 ms."""
        for _ in range(turns):
            self.now += 10
            self.session.spin_once(self.now)

    def stream(self, message: "Outgoing", more: int) -> None:
        """Streams a sample until it has arrived."""
        count = len(self.camera.ended)
        assert self.streamer.publish(message, more)
        end = self.now + 60000
        while len(self.camera.ended) == count:
            self.spin(1)
            assert self.now < end


def test_200_kb_through_a_small_heap() -> None:
    rig = Rig()
    message = Raw(bytes(4))
    if not MPY:
        rig.stream(message, 2000)  # on hosts what is borrowed stays, and importing it takes much
        tracemalloc.start()
    before = used()
    rig.stream(message, _SIZE)
    if not MPY:
        tracemalloc.stop()
    assert rig.camera.ended[-1]
    assert rig.agent.wholes[-1] == _SIZE + 12
    assert rig.agent.wrong == 0
    assert rig.camera.most <= 512
    if measures():
        assert 0 < rig.camera.peak - before < _ROOM, rig.camera.peak - before
    assert rig.session.backlog is None


def test_what_fill_raises() -> None:
    rig = Rig()

    def fill(buf: "bytearray", off: int, n: int, at: int) -> None:
        if at > 5000:
            raise OSError(5)

    streamer = Streamer(rig.writer, fill, 0, lambda: 20000, rig.camera.ended.append)
    assert streamer.publish(Raw(b"1234"))
    with raises(OSError):
        rig.spin(200)
    rig.spin(2)
    assert rig.camera.ended == [False]
    assert len(rig.agent.wholes) == 1
    assert rig.agent.wholes[0] < 20000
    assert rig.session.backlog is None
    assert not streamer.busy
