"""Foreign bytes at the whole server: whatever a board sends, nothing is raised, and other boards go on."""

from __future__ import annotations

from random import Random

import pytest

from muros.rosserial.constants import VERSION_GROOVY, VERSION_HYDRO
from muros.rosserial.messages import TopicInfo
from muros.rosserial.packets import frame
from tests.rosserial.scene import RosLib, Scene, string

NAMES = (
    "chatter",
    "/abs",
    "~private",
    "",
    "/",
    "a//b",
    "9lives",
    "grüße",
    "x" * 300,
    "a b",
    "\0",
    "{node}",
    "tf",
    "~",
)
TYPES = (
    "std_msgs/String",
    "std_msgs/Byte",
    "sensor_msgs/Imu",
    "std_srvs/SetBool",
    "std_srvs/Empty",
    "std_msgs/msg/String",
    "no/Type",
    "String",
    "",
    "a/b/c/d",
    "std_msgs/",
    "/",
    "tf/tfMessage",
    "../../etc/passwd",
    "std_msgs/Header",
)
SUMS = ("*", "", "0" * 32, "992ce8a1687cec8c8bd883ec73ca41d1", "f" * 500, "not a sum")
SIZES = (512, 0, -1, 2**31 - 1, -(2**31), 8, 65536)


def piece(random: Random) -> bytes:
    """Something that a broken or hostile board may send."""
    kind = random.randrange(8)
    version = VERSION_HYDRO if random.random() < 0.9 else VERSION_GROOVY
    if kind == 0:
        return random.randbytes(random.randrange(40))
    if kind == 1:
        return frame(random.randrange(0x10000), random.randbytes(random.randrange(60)), version)
    if kind == 2:
        return frame(random.randrange(12), random.randbytes(random.randrange(60)), version)
    if kind == 3:
        return frame(6, string(random.choice(NAMES)), version)
    if kind == 4:
        return frame(
            7,
            bytes((random.randrange(256),)) + string("log \x1b[31m") + random.randbytes(random.randrange(2)),
        )
    if kind == 5:
        good = bytearray(frame(random.randrange(130), random.randbytes(20), version))
        good[random.randrange(len(good))] ^= 1 << random.randrange(8)
        return bytes(good)
    info = TopicInfo(
        random.choice((0, 5, 100, 101, 125, 126, 65535)),
        random.choice(NAMES),
        random.choice(TYPES),
        random.choice(SUMS),
        random.choice(SIZES),
    )
    body = bytearray(info.size())
    info.write(body, 0)
    return frame(random.randrange(6), bytes(body), version)


@pytest.mark.parametrize("seed", range(6))
def test_whatever_a_board_sends(seed: int) -> None:
    random = Random(seed)
    scene = Scene({"chatter": [1, "mixed", None]}, baud=random.choice((0, 9600)), max_endpoints=20)
    good = RosLib(scene, "good")
    topic = good.publisher("good", "std_msgs/String")
    good.plug()
    scene.until(lambda: good.connected)
    hear = scene.reader("/good", "std_msgs/msg/String")
    ask, _ = scene.client("/chatter", "std_srvs/srv/SetBool")
    write = scene.writer("/chatter", "std_msgs/msg/String")
    scene.port.up("evil", scene.now)
    heard = 0
    for i in range(1_500):
        data = piece(random)
        for _ in range(random.randrange(1, 3)):
            at = random.randrange(len(data) + 1)
            scene.port.receive(data[:at], "evil", scene.now)
            scene.port.receive(data[at:], "evil", scene.now)
        if i % 50 == 0:
            ask(data=True)
            write(data="x" * random.randrange(200))
            good.send(topic, string(str(i)))
            scene.step(random.choice((1, 1, 30, 400)))
            heard += len(hear())
        if i % 400 == 399:
            scene.port.down("evil", "gone", scene.now)
            scene.step(random.choice((1, 40_000)))
            scene.port.up("evil", scene.now)
    assert heard == 30
    assert len(scene.findings.snapshot()) <= scene.findings.capacity + 10
