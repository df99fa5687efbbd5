"""Samples that are streamed through a session: nobody holds them whole, and they arrive once, whole and in order."""

from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from muros.client import CONNECTED
from muros.client.raw import Raw
from muros.interfaces import message
from muros.rclc import RclError
from muros.rclc.streaming import Streamer
from tests.client.test_session import Device
from tests.client.world import World

IMAGE = message("sensor_msgs/msg/Image")


class Source:
    """Bytes that tell where they stand; ``asked`` is what was asked for, ``ended`` what was told."""

    def __init__(self, device: Device, element: int = 0, **more: Any) -> None:
        self.asked: list[tuple[int, int]] = []
        self.ended: list[bool] = []
        self.fail_at = -1
        self.streamer = Streamer(device.writer, self.fill, element, on_end=self.ended.append, **more)

    @staticmethod
    def data(n: int, at: int = 0) -> bytes:
        """The bytes from the ``at``-th on."""
        return bytes((i * 7 + (i >> 8)) & 255 for i in range(at, at + n))

    def fill(self, buf: bytearray, off: int, n: int, at: int) -> None:
        """Gives bytes."""
        self.asked.append((at, n))
        if 0 <= self.fail_at < at + n:
            raise OSError("the camera is gone")
        buf[off : off + n] = self.data(n, at)


def spin(world: World, device: Device) -> list[Exception]:
    """What comes out of the session during a second."""
    raised: list[Exception] = []
    for _ in range(100):
        try:
            world.run(10)
        except OSError as error:
            raised.append(error)
    return raised


def test_r7_continuous_fragment() -> None:
    world = World()
    device = Device(world).connect()
    source = Source(device)
    assert source.streamer.publish(Raw(b""), 30_000)
    world.until(lambda: source.ended)
    assert device.heard == [Source.data(30_000)]
    assert source.ended == [True]


def test_r8_continuous_fragment_with_callbacks() -> None:
    world = World()
    device = Device(world).connect()
    source = Source(device, more=lambda: 10_000)
    assert source.streamer.publish(Raw(b"0123456789"))
    world.until(lambda: source.ended)
    assert device.heard == [b"0123456789" + Source.data(10_000)]


def test_an_image_of_200_kb_is_never_there_whole() -> None:
    world = World()
    device = Device(world).connect()
    source = Source(device, element=1)
    image = IMAGE(height=400, width=500, encoding="mono8", step=500)
    assert source.streamer.publish(image, 200_000)
    assert source.streamer.busy
    assert sum(n for _, n in source.asked) <= 4 * 512, "no more than there is room for"
    longest = 0
    while not source.ended:
        held = device.session.backlog.items if device.session.backlog else []
        longest = max([longest, *(len(item) for item in held if isinstance(item, bytes | bytearray))])
        world.run(5)
    assert longest == 0
    assert max(n for _, n in source.asked) <= 512
    assert [at for at, _ in source.asked] == sorted(at for at, _ in source.asked)
    arrived = IMAGE.deserialize(device.heard[0])
    assert (arrived.height, arrived.width, arrived.encoding, arrived.step) == (400, 500, "mono8", 500)
    assert bytes(arrived.data) == Source.data(200_000)


@pytest.mark.parametrize("seed", range(5))
def test_it_arrives_whole_over_a_bad_network(seed: int) -> None:
    world = World(seed, loss=0.2, duplicate=0.1)
    device = Device(world).connect()
    source = Source(device)
    assert source.streamer.publish(Raw(b"head"), 20_000)
    world.until(lambda: source.ended, 120_000)
    assert device.heard == [b"head" + Source.data(20_000)]
    asked = [at for at, _ in source.asked]
    assert asked == sorted(set(asked)), "what is lost is sent again from the stream's own buffer"


def test_elements_are_counted_and_aligned() -> None:
    world = World()
    device = Device(world).connect()
    floats = message("std_msgs/msg/Float64MultiArray")
    source = Source(device, element=8)
    assert source.streamer.publish(floats(), 8000)
    world.until(lambda: source.ended)
    assert floats.deserialize(device.heard[0]).data.tobytes() == Source.data(8000)
    assert source.streamer.publish(floats(), 0)
    world.run(50)
    assert floats.deserialize(device.heard[1]) == floats()


@settings(max_examples=40)
@given(
    mtu=st.sampled_from([64, 128, 512]),
    head=st.binary(max_size=150),
    more=st.integers(0, 3000),
    element=st.sampled_from([0, 1, 2, 4, 8]),
    ahead=st.integers(0, 3),
)
def test_in_pieces_or_whole_it_is_the_same(
    mtu: int, head: bytes, more: int, element: int, ahead: int
) -> None:
    world = World()
    device = Device(world, mtu=mtu, queue=8).connect()
    source = Source(device, element)
    more -= more % (element or 1)
    before = Raw(head + bytes(4) if element else head)
    assume(before.size() + more)
    for i in range(ahead):
        assert device.writer.write_bytes(bytes([i]))
    assert source.streamer.publish(before, more)
    world.until(lambda: source.ended, 60_000)
    world.run(50)
    whole = head
    if element:
        whole += (more // element).to_bytes(4, "little")
        whole += bytes(-len(whole) % element if more else 0)
    assert device.heard[ahead:] == [whole + Source.data(more)]


def test_a_small_one_is_one_message() -> None:
    world = World()
    device = Device(world).connect()
    source = Source(device)
    assert source.streamer.publish(Raw(b"ab"), 20)
    assert source.ended == [True]
    assert not source.streamer.busy
    world.run(50)
    assert device.heard == [b"ab" + Source.data(20)]


def test_the_next_one_may_follow_from_on_end() -> None:
    world = World()
    device = Device(world).connect()
    ended: list[bool] = []

    def again(sent: bool) -> None:
        ended.append(sent)
        if len(ended) < 3:
            assert streamer.publish(Raw(bytes([len(ended)])), 5000)

    streamer = Streamer(device.writer, Source(device).fill, 0, on_end=again)
    assert streamer.publish(Raw(b"\0"), 5000)
    world.until(lambda: len(ended) == 3)
    assert device.heard == [bytes([i]) + Source.data(5000) for i in range(3)]


def test_when_the_agent_restarts_the_program_is_asked_again() -> None:
    world = World()
    device = Device(world).connect()
    source = Source(device)
    assert source.streamer.publish(Raw(b""), 20_000)
    world.until(lambda: len(source.asked) > 10)
    world.stop_agent()
    world.run(3000)
    assert not source.ended
    world.start_agent()
    device.connect()
    world.until(lambda: source.ended, 10_000)
    assert device.heard == [Source.data(20_000)]
    assert [at for at, _ in source.asked].count(0) == 2


def test_what_fill_raises_gives_the_sample_up_and_comes_out() -> None:
    world = World()
    device = Device(world).connect()
    source = Source(device)
    source.fail_at = 9000
    assert source.streamer.publish(Raw(b""), 20_000)
    raised = spin(world, device)
    assert [str(error) for error in raised] == ["the camera is gone"]
    assert source.ended == [False]
    assert device.heard == []
    assert device.session.state == CONNECTED
    source.fail_at = -1
    assert source.streamer.publish(Raw(b"next"), 20_000)
    world.until(lambda: len(source.ended) == 2)
    assert device.heard == [b"next" + Source.data(20_000)]


def test_what_fill_raises_at_once() -> None:
    world = World()
    device = Device(world).connect()
    source = Source(device)
    source.fail_at = 0
    assert source.streamer.publish(Raw(b""), 20_000)
    assert len(spin(world, device)) == 1
    assert source.ended == [False]
    assert device.writer.write_bytes(b"next")
    world.run(50)
    assert device.heard == [b"next"]


@pytest.mark.parametrize("pieces", [1, 9])
def test_cancelling(pieces: int) -> None:
    world = World()
    device = Device(world).connect()
    source = Source(device)
    assert source.streamer.publish(Raw(b""), 20_000)
    world.until(lambda: len(source.asked) >= pieces)
    source.streamer.cancel()
    world.until(lambda: source.ended)
    assert source.ended == [False]
    asked = len(source.asked)
    assert device.writer.write_bytes(b"next")
    world.run(500)
    assert device.heard == [b"next"]
    assert len(source.asked) == asked
    source.streamer.cancel()  # nothing is on its way
    assert source.streamer.publish(Raw(b""), 2000)
    world.until(lambda: len(source.ended) == 2)
    assert source.ended == [False, True]


def test_closing_gives_it_up() -> None:
    world = World()
    device = Device(world).connect()
    source = Source(device)
    assert source.streamer.publish(Raw(b""), 20_000)
    world.run(20)
    device.session.close()
    assert source.ended == [False]


def test_what_is_refused() -> None:
    world = World()
    device = Device(world)
    source, other = Source(device), Source(device)
    assert not source.streamer.publish(Raw(b""), 20_000), "there is no session"
    device.connect()
    assert source.streamer.publish(Raw(b""), 20_000)
    with pytest.raises(RclError, match="still being streamed"):
        source.streamer.publish(Raw(b""), 20_000)
    assert not other.streamer.publish(Raw(b""), 20_000), "another large one is on its way"
    assert other.ended == []
    assert not other.asked
    assert "still on its way" in device.problems[-1][1]
    world.until(lambda: source.ended)
    loose = Streamer(
        device.session.writer(device.participant, "rt/loose", "std_msgs/msg/String", "sensor_data"),
        other.fill,
    )
    world.run(200)
    assert not loose.publish(IMAGE(), 20_000), "best effort carries no fragments"
    assert not loose.busy


def test_a_queue_takes_several() -> None:
    world = World()
    device = Device(world, queue=3)
    sources = [Source(device) for _ in range(3)]
    for i, source in enumerate(sources):
        assert source.streamer.publish(Raw(bytes([i])), 5000)
    assert not any(source.asked for source in sources)
    device.connect()
    world.until(lambda: all(source.ended for source in sources))
    assert device.heard == [bytes([i]) + Source.data(5000) for i in range(3)]


def test_wrong_use() -> None:
    device = Device(World()).connect()
    with pytest.raises(ValueError, match="element is 3"):
        Source(device, element=3)
    with pytest.raises(ValueError, match="does not end with an empty sequence"):
        Source(device, element=1).streamer.publish(IMAGE(data=b"full"), 100)
    with pytest.raises(ValueError, match="101 bytes are no number of elements of 2 B"):
        Source(device, element=2).streamer.publish(IMAGE(), 101)
    with pytest.raises(ValueError, match="-1 bytes"):
        Source(device).streamer.publish(IMAGE(), -1)
