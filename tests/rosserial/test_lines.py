"""Boards at the end of serial lines that take their time, with buffers as small as an Arduino's."""

from __future__ import annotations

from collections import deque
from random import Random
from statistics import median
from typing import Any

import pytest

from muros.rosserial.constants import VERSION_GROOVY, VERSION_HYDRO
from muros.rosserial.server import BoardLost
from tests.rosserial.scene import RosLib, Scene, string

STRING = "std_msgs/msg/String"
BYTE = "std_msgs/msg/Byte"
RING = 64
"""Bytes that an Arduino keeps in each direction."""


class Uart:
    """The line of one board: bytes arrive one after the other, and the board stands still while it has to write.

    What comes meanwhile finds room for 64 bytes and is lost beyond. A board that does not run hears nothing.
    """

    def __init__(self, board: RosLib, baud: int) -> None:
        self.byte_us = 10e6 / baud
        self.board = board
        self.lost = 0
        self.sent_up = 0
        self._rising: deque[tuple[float, int]] = deque()
        self._falling: deque[tuple[float, int]] = deque()
        self._spin, self._deliver, self._send = board.tick, board.raw, board.scene.link.send
        board.raw = self.up  # type: ignore[method-assign]
        board.tick = self.tick  # type: ignore[method-assign]
        board.scene.link.send = self.down  # type: ignore[method-assign]

    def up(self, data: bytes) -> None:
        """From the board."""
        self.sent_up += len(data)
        self._queue(self._rising, data)

    def down(self, message: bytes, address: Any) -> bool:
        """To the board."""
        if address != self.board.address:
            return self._send(message, address)
        self._queue(self._falling, message)
        return True

    def tick(self) -> None:
        """A millisecond has passed: what has arrived meanwhile is delivered."""
        now_us = 1000 * self.board.scene.now
        came = bytearray()
        while self._rising and self._rising[0][0] <= now_us:
            came.append(self._rising.popleft()[1])
        if came:
            self._deliver(bytes(came))
        while self._falling and self._falling[0][0] <= now_us:
            byte = self._falling.popleft()[1]
            if len(self.board.came) < RING and self.board.running:
                self.board.came.append(byte)
            elif self.board.running:
                self.lost += 1
        if len(self._rising) <= RING:
            self._spin()

    def _queue(self, way: deque[tuple[float, int]], data: bytes) -> None:
        free = max(way[-1][0] if way else 0.0, 1000.0 * self.board.scene.now)
        for i, byte in enumerate(data, 1):
            way.append((free + i * self.byte_us, byte))


def restart(scene: Scene, board: RosLib, boot: int) -> None:
    """The board starts again, which takes ``boot`` ms."""
    board.running = board.connected = False
    scene.step(boot)
    board.boot()
    board.running = True


@pytest.mark.parametrize("version", [VERSION_HYDRO, VERSION_GROOVY])
@pytest.mark.parametrize("period", [0, 20, 300, 1_900])
def test_a_restarted_board_is_back_within_two_seconds(version: int, period: int) -> None:
    """Whatever it publishes, whenever it restarts, however long it takes to start: within 2 s from when it runs."""
    random = Random(period)
    scene = Scene(baud=57_600)
    board = RosLib(scene, version=version)
    for i in range(4):
        board.subscriber(f"wheel_{i}", "std_msgs/Byte")
    chatter = board.publisher("chatter", "std_msgs/String")
    Uart(board, 57_600)
    board.plug()
    scene.until(lambda: board.connected)
    for _ in range(6):
        for i in range(random.randrange(300, 6_000)):
            if period and i % period == 0:
                board.send(chatter, string(str(i)))
            scene.step()
        restart(scene, board, random.choice([0, 50, 700, 1_600, 4_000, 12_000]))
        assert scene.until(lambda: board.connected, within=12_000) <= 2_000


def test_a_groovy_board_that_talks_is_left_alone() -> None:
    scene = Scene(baud=57_600)
    board = RosLib(scene, version=VERSION_GROOVY)
    chatter = board.publisher("chatter", "std_msgs/String")
    Uart(board, 57_600)
    board.plug()
    scene.step(1_000)
    for i in range(40):
        board.send(chatter, string(str(i)))
        scene.step(1_400)
    assert scene.core.boards[0].asks == 1


def test_a_groovy_board_that_waits_for_an_answer_is_not_asked() -> None:
    """A request for topics ends its call: ros_lib's wait ends with its spinOnce(), which then returns -1."""
    scene = Scene(baud=57_600)
    board = RosLib(scene, version=VERSION_GROOVY)
    requests, responses = board.client("switch", "std_srvs/SetBool")
    calls: list[object] = []
    scene.server("/switch", "std_srvs/srv/SetBool", calls.append)
    Uart(board, 57_600)
    board.plug()
    scene.step(1_000)
    asks = scene.core.boards[0].asks
    board.send(requests, b"\x01")
    scene.step(9_000)
    assert len(calls) == 1
    assert scene.core.boards[0].asks == asks
    assert not board.taken(responses)
    restart(scene, board, 0)
    assert (
        scene.until(lambda: board.connected, within=12_000) <= 3_700
    )  # also then, by the time it does not ask for
    scene.step(12_000)
    restart(scene, board, 0)
    assert scene.until(lambda: board.connected) <= 2_000


def test_a_quiet_groovy_board_that_is_well_loses_nothing() -> None:
    """It is asked, as nothing else tells whether it has restarted, and stands still as long as its list is on the line.

    What goes to it waits in the server meanwhile, as it would not find room in the board.
    """
    scene = Scene(baud=57_600)
    board = RosLib(scene, version=VERSION_GROOVY)
    wheels = [board.subscriber(f"wheel_{i}", "std_msgs/Byte") for i in range(8)]
    chatter = board.publisher("chatter", "std_msgs/String")
    line = Uart(board, 57_600)
    board.plug()
    scene.step(1_000)
    write = scene.writer("/wheel_3", BYTE)
    hear = scene.reader("/chatter", STRING)
    random = Random(1)
    start, asks = scene.now, scene.core.boards[0].asks
    said: list[int] = []
    wrote: list[int] = []
    up: list[int] = []
    down: list[int] = []
    for _ in range(60_000):
        if random.random() < 0.05:
            write(data=len(wrote) % 256)
            wrote.append(scene.now)
        if random.random() < 0.0003:
            board.send(chatter, string("I am well"))
            said.append(scene.now)
        scene.step()
        for body in board.taken(wheels[3]):
            assert body == bytes([len(down) % 256])
            down.append(scene.now - wrote[len(down)])
        up += [scene.now - said[len(up) + i] for i, _ in enumerate(hear())]
    scene.step(300)
    assert len(down) + len(board.taken(wheels[3])) == len(wrote)
    assert len(up) + len(hear()) == len(said)
    assert line.lost == 0
    assert not scene.told
    assert not scene.said(BoardLost)
    listing = sum(7 + info.size() for _, info in board.infos) * line.byte_us / 1000
    assert median(down) <= 2
    assert max(down) <= listing + 10
    assert max(up) <= listing + 10
    assert 20 <= scene.core.boards[0].asks - asks <= (scene.now - start) / 1_500


@pytest.mark.parametrize("period", [5, 10, 30])
@pytest.mark.parametrize("length", [60, 200, 511])
def test_a_damaged_length_on_a_slow_line(period: int, length: int) -> None:
    """What it promises may never come; where the line has no pauses it is complete before long."""
    scene = Scene(baud=57_600)
    board = RosLib(scene)
    chatter = board.publisher("chatter", "std_msgs/String")
    Uart(board, 57_600)
    board.plug()
    scene.step(1_000)
    hear = scene.reader("/chatter", STRING)
    waits: list[int] = []
    said: list[int] = []
    for i in range(1_000):
        if i == 200:
            board.raw(bytes((0xFF, 0xFE, length & 255, length >> 8, ~((length & 255) + (length >> 8)) & 255)))
        if i % period == 0:
            board.send(chatter, string(f"{i:016}"))
            said.append(scene.now)
        scene.step()
        waits += [scene.now - said[len(waits) + k] for k, _ in enumerate(hear())]
    assert len(said) - len(waits) <= 1
    assert min(waits) < max(waits) <= 100


def errors_of_clocks(baud: int, waits: bool, seconds: int = 40) -> list[float]:
    """How far a board's clock is ahead after each answer, in ms, while its line to the board is always full.

    ``waits``: it writes without a buffer, so that its request has left when it looks at its clock.
    """
    scene = Scene(baud=baud)
    board = RosLib(scene)
    board.subscriber("led_out", "std_msgs/Byte")
    line = Uart(board, baud)
    board.plug()
    write = scene.writer("/led_out", BYTE)
    errors: list[float] = []
    for _ in range(1_000 * seconds):
        write(data=0)
        board.clock, asked = None, board.asked_time
        scene.step()
        if waits and board.asked_time > asked:
            board._synced_at += round(16 * line.byte_us / 1000)
        if board.clock is not None:
            errors.append((board.clock - scene.wall()) / 1e6)
    assert len(errors) >= seconds // 3
    return errors


@pytest.mark.parametrize("baud", [9_600, 57_600, 115_200, 1_000_000])
def test_clocks_of_boards_are_right_on_slow_and_busy_lines(baud: int) -> None:
    """The clocks have steps of 1 ms. A board that writes without a buffer is behind by its request on the line."""
    assert max(map(abs, errors_of_clocks(baud, waits=False))) <= 1.0
    request = 160e3 / baud
    behind = errors_of_clocks(baud, waits=True)
    assert -request - 1.5 <= min(behind) <= max(behind) <= 1.0


def test_an_answer_that_waits_has_the_time_when_it_leaves() -> None:
    """Clocks are set: an answer that was ready before has the time of after that."""
    scene = Scene()
    board = RosLib(scene)
    board.plug()
    scene.step(1_000)
    scene.link.waiting = 1
    board._ask_time()
    scene.step(30)
    ahead = 3_600 * 10**9
    wall = scene.wall
    scene.world.time = lambda: wall() + ahead
    scene.link.waiting = 0
    board.clock = None
    scene.until(lambda: board.clock, within=100)
    assert board.clock is not None
    assert abs(board.clock - wall() - ahead) <= 1_000_000
