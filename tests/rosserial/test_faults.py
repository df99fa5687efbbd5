"""Faults on the line, in virtual time and from seeds: what is lost, what is wrong, and how long it takes to recover."""

from __future__ import annotations

from random import Random
from typing import Any

import pytest

from muros.rosserial.constants import VERSION_GROOVY, VERSION_HYDRO
from muros.rosserial.server import BoardReady
from muros.space import Qos, Reliability, Topic
from tests.rosserial.scene import RosLib, Scene, string

STRING = "std_msgs/msg/String"
PERIOD = 10
"""Milliseconds between messages of the board."""


class Line:
    """Damages what passes, from a seed: probabilities of ``flips`` of bits, ``losses`` and ``insertions`` of bytes."""

    def __init__(
        self, board: RosLib, seed: int, flips: float = 0, losses: float = 0, insertions: float = 0
    ) -> None:
        self.random = Random(seed)
        self.flips, self.losses, self.insertions = flips, losses, insertions
        self.hit = 0
        """Pieces that were damaged."""
        self._up, self._down = board.raw, board.scene.link.send
        board.raw = self.up  # type: ignore[method-assign]
        board.scene.link.send = self.down  # type: ignore[method-assign]

    def up(self, data: bytes) -> None:
        """From the board."""
        damaged = self.damage(data)
        if damaged:
            self._up(damaged)

    def down(self, message: bytes, address: Any) -> bool:
        """To the board."""
        return self._down(self.damage(message), address)

    def damage(self, data: bytes) -> bytes:
        """The bytes as they come out of the line."""
        random, out = self.random, bytearray()
        for byte in data:
            if random.random() < self.losses:
                continue
            if random.random() < self.insertions:
                out.append(random.randrange(256))
            if self.flips and random.random() < 8 * self.flips:
                byte ^= 1 << random.randrange(8)
            out.append(byte)
        self.hit += out != data
        return bytes(out)


class Traffic:
    """A board that publishes numbered strings; what of them arrives, and when."""

    def __init__(self, scene: Scene, text: str = "{:016}", version: int = VERSION_HYDRO) -> None:
        self.scene = scene
        self.text = text
        self.board = RosLib(scene, version=version)
        self.id = self.board.publisher("chatter", "std_msgs/String")
        self.sub = self.board.subscriber("echo", "std_msgs/String")
        self.hear = scene.reader("/chatter", STRING)
        self.write = scene.writer("/echo", STRING)
        self.board.plug()
        scene.until(lambda: self.board.connected)
        scene.step(400)
        self.sent = 0
        self.right: list[int] = []
        self.wrong = 0
        self.line: Line | None = None
        self.good: dict[int, int] = {}
        """When those came to the server that the line has not damaged."""
        self.late = 0
        """How much later, at worst, they were delivered, in ms."""

    def through(self, seed: int, flips: float = 0, losses: float = 0, insertions: float = 0) -> Line:
        """From now on the line damages what passes."""
        self.line = Line(self.board, seed, flips, losses, insertions)
        return self.line

    def run(self, n: int) -> None:
        """Publishes so many."""
        for _ in range(n):
            if self.board.connected:
                hit = self.line.hit if self.line else 0
                self.board.send(self.id, string(self.text.format(self.sent)))
                if not self.line or self.line.hit == hit:
                    self.good[self.sent] = self.scene.now
                self.sent += 1
            self.listen(PERIOD)

    def listen(self, ms: int) -> None:
        """Takes what is delivered."""
        for _ in range(ms):
            self.scene.step()
            for message in self.hear():
                number = int(message.data) if message and message.data.isdigit() else -1
                if not (self.right[-1] if self.right else -1) < number < self.sent:
                    self.wrong += 1
                    continue
                self.right.append(number)
                if number in self.good:
                    self.late = max(self.late, self.scene.now - self.good[number])

    @property
    def missing(self) -> list[int]:
        """What came undamaged to the server and was not delivered."""
        return sorted(set(self.good).difference(self.right))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rate", [1e-6, 1e-5, 1e-4, 1e-3])
@pytest.mark.parametrize("version", [VERSION_HYDRO, VERSION_GROOVY])
def test_bit_errors_cost_the_messages_that_they_hit_and_no_more(version: int, rate: float, seed: int) -> None:
    """A good frame is never lost, whatever came before it, and is delivered within 100 ms of its own last byte."""
    scene = Scene()
    traffic = Traffic(scene, version=version)
    line = traffic.through(seed, flips=rate)
    traffic.run(1000)
    traffic.listen(100)
    assert traffic.board.connected
    assert not traffic.missing
    assert traffic.late <= 100
    assert traffic.sent - len(traffic.good) <= line.hit
    assert traffic.wrong <= max(1, 0.004 * traffic.sent * min(1, rate * 1e3))


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("version", [VERSION_HYDRO, VERSION_GROOVY])
def test_lost_and_inserted_bytes(version: int, seed: int) -> None:
    scene = Scene()
    traffic = Traffic(scene, version=version)
    line = traffic.through(seed, losses=5e-4, insertions=5e-4)
    traffic.run(1500)
    traffic.listen(100)
    assert line.hit > 20
    assert not traffic.missing
    assert traffic.late <= 100
    assert traffic.wrong <= 3


@pytest.mark.parametrize("seed", range(3))
def test_both_directions_at_once(seed: int) -> None:
    scene = Scene()
    traffic = Traffic(scene)
    line = traffic.through(seed, flips=1e-4)
    got: list[bytes] = []
    for i in range(500):
        traffic.write(data=f"{i:016}")
        traffic.run(1)
        got += traffic.board.taken(traffic.sub)
    assert traffic.board.connected
    right = [body for body in got if body[4:].isdigit()]
    assert len(right) >= 500 - line.hit
    assert [int(body[4:]) for body in right] == sorted({int(body[4:]) for body in right})


@pytest.mark.parametrize("baud", [0, 57_600])
def test_a_damaged_length_delays_a_live_line_for_less_than_100_ms(baud: int) -> None:
    """Also where the damage passes the length's own checksum and promises a long frame."""
    late = []
    for length in (17, 100, 400, 503, 511):
        for offset in range(0, PERIOD, 3):
            scene = Scene(baud=baud)
            traffic = Traffic(scene)
            traffic.run(20)
            traffic.listen(offset)
            evil = bytes(
                (0xFF, 0xFE, length & 255, length >> 8, ~((length & 255) + (length >> 8)) & 255, 125, 0)
            )
            traffic.board.raw(evil)
            traffic.run(40)
            assert not traffic.missing
            late.append(traffic.late)
    assert 20 <= max(late) <= 100


def test_what_damage_hides_stays_in_the_graph() -> None:
    """Damage brings other requests: what was named after the first of them is there, though not after the last."""
    scene = Scene()
    traffic = Traffic(scene)
    board, raw = traffic.board, traffic.board.raw
    calls = board.server("switch", "std_srvs/SetBool")
    board.boot()
    scene.until(lambda: board.connected)
    scene.step(400)
    before = [endpoint.gid for endpoint in (*scene.space.graph.readers, *scene.space.graph.writers)]
    asks = scene.core.boards[0].asks

    def damage(data: bytes) -> None:
        """One half of the service is lost at each request, the rest at all but the first."""
        said = scene.core.boards[0].asks - asks
        hidden = {1: calls[:1], 2: calls[1:]}.get(said, (traffic.id, traffic.sub, *calls))
        if data[5:7] in {bytes((half, 0)) for half in range(4)} and data[7] in hidden:
            data = data[:20] + b"?" + data[21:]
        raw(data)

    board.raw = damage  # type: ignore[method-assign]
    board.send(99, b"no such id")
    traffic.run(2_000)
    assert scene.core.boards[0].asks - asks <= 6
    assert not traffic.missing
    assert [e.gid for e in (*scene.space.graph.readers, *scene.space.graph.writers)] == before


@pytest.mark.parametrize("seed", range(8))
def test_a_board_restarts_at_any_moment(seed: int) -> None:
    random = Random(seed)
    scene = Scene()
    traffic = Traffic(scene)
    gids = [writer.gid for writer in scene.space.graph.writers]
    for _ in range(3):
        traffic.run(random.randrange(1, 300))
        traffic.board.raw(b"\xff\xfe\x10\x00\xef\x7d\x00half a frame"[: random.randrange(20)])
        traffic.board.boot()
        scene.step(random.randrange(500))  # the boot loader
        start = scene.now
        scene.until(lambda: traffic.board.connected, within=2_000)
        before = len(traffic.right)
        traffic.run(20)
        assert len(traffic.right) == before + 20
        assert scene.now - start <= 2_000 + 20 * PERIOD
    assert [writer.gid for writer in scene.space.graph.writers] == gids
    assert traffic.wrong == 0


@pytest.mark.parametrize("seed", range(4))
def test_a_cable_is_pulled_at_any_moment(seed: int) -> None:
    random = Random(seed)
    scene = Scene()
    traffic = Traffic(scene)
    for _ in range(4):
        traffic.run(random.randrange(1, 100))
        traffic.board.raw(b"\xff\xfe\x10\x00\xef\x7d\x00half"[: random.randrange(12)])
        traffic.board.pull()
        if random.random() < 0.5:
            traffic.board.boot()
        scene.step(random.randrange(10, 5_000))
        traffic.board.came.clear()
        traffic.board.plug()
        scene.step(50)
        before = len(traffic.right)
        traffic.run(20)
        assert len(traffic.right) == before + 20


def test_the_server_is_killed_and_started_again() -> None:
    """A board that still believes itself connected is asked at once, and is in sync with the new server."""
    scene = Scene()
    traffic = Traffic(scene)
    traffic.run(100)
    fresh = Scene()
    fresh.now = scene.now
    board = traffic.board
    board.scene = fresh
    fresh.boards.append(board)
    hear = fresh.reader("/chatter", STRING)
    start = fresh.now
    board.plug()
    fresh.until(lambda: fresh.core.boards[0].in_sync)
    assert fresh.now - start <= 10
    fresh.step(10)
    board.send(traffic.id, string("to the new one"))
    fresh.step(2)
    assert [message.data for message in hear()] == ["to the new one"]


def test_a_line_that_is_cut_for_twenty_seconds() -> None:
    scene = Scene()
    traffic = Traffic(scene)
    traffic.run(50)
    send, raw = scene.link.send, traffic.board.raw
    scene.link.send = lambda message, address: True  # type: ignore[method-assign]
    traffic.board.raw = lambda data: None  # type: ignore[method-assign]
    scene.step(20_000)
    assert not traffic.board.connected
    scene.link.send, traffic.board.raw = send, raw  # type: ignore[method-assign]
    assert scene.until(lambda: traffic.board.connected) <= 1_100
    before = len(traffic.right)
    traffic.run(20)
    assert len(traffic.right) == before + 20


def test_one_bad_board_harms_no_other() -> None:
    scene = Scene()
    traffic = Traffic(scene)
    foe = RosLib(scene, "foe")
    foe.publisher("foe", "std_msgs/String")
    foe.subscriber("chatter", "std_msgs/String")
    foe.plug()
    random = Random(3)
    for _ in range(100):
        foe.raw(random.randbytes(2000))
        foe.raw(b"\xff\xfe\xff\xff\x01" * 100)
        traffic.run(1)
    assert len(traffic.right) == traffic.sent
    assert traffic.wrong == 0


def test_a_flood_of_topics_and_findings_takes_no_memory() -> None:
    scene = Scene()
    foe = RosLib(scene, "foe")
    foe.plug()
    for i in range(2_000):
        foe.infos.clear()
        foe._next = i
        foe.publisher(f"t{i}", "std_msgs/String")
        info = foe.infos[0][1]
        body = bytearray(info.size())
        info.write(body, 0)
        foe.send(0, bytes(body))
        foe.send(2, bytes(body))
        foe.send(300 + i, b"x")
    board = scene.core.boards[0]
    assert len(board.roster.endpoints) <= scene.core.limits.max_endpoints
    assert len(board.roster._halves) <= scene.core.limits.max_endpoints + 1
    assert len(scene.findings.snapshot()) <= scene.findings.capacity + 10


def test_readers_that_are_slow_do_not_stop_a_board() -> None:
    scene = Scene()
    traffic = Traffic(scene)
    never = scene.other.reader(
        Topic("rt/chatter", "std_msgs::msg::dds_::String_"), Qos(Reliability.RELIABLE, depth=1)
    )
    traffic.run(300)
    assert len(traffic.right) == 300
    assert never.pending == 1


def test_boot_text_before_the_first_frame_is_passed_over() -> None:
    scene = Scene()
    board = RosLib(scene)
    board.publisher("chatter", "std_msgs/String")
    scene.port.up("a", scene.now)
    board.came.clear()
    board.raw(b"ets Jun  8 2016 00:22:57\r\nrst:0x1 (POWERON_RESET),boot:0x13\r\n\xff\xfe\xff")
    scene.step(1_500)
    assert board.connected
    assert scene.said(BoardReady)
    assert "no-sync" not in scene.codes()
