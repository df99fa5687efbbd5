"""Types of boards in the graph: older definitions, renamed ones, and the user's own."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import pytest

from muros import interfaces
from tests.rosserial.scene import RosLib, Scene, string

OLD_BATTERY = "476f837fa6771f6e16e3bf4ef96f8770"
NEW_BATTERY = "4ddae7f048e32fda22cac764685e3974"


def battery(temperature: bool) -> bytes:
    """A sensor_msgs/BatteryState in ROS 1, with or without the temperature that came with Noetic."""
    body = struct.pack("<III", 9, 1_700_000_000, 5) + string("base")
    body += struct.pack("<f", 12.5) + (struct.pack("<f", 31.0) if temperature else b"")
    body += struct.pack("<fffff", 1.0, 2.0, 3.0, 4.0, 0.5) + bytes((1, 2, 3, 1))
    body += struct.pack("<I", 2) + struct.pack("<ff", 4.0, 4.25)
    if temperature:
        body += struct.pack("<I", 0)
    return body + string("rear") + string("42")


@pytest.mark.parametrize(("md5", "drift"), [(OLD_BATTERY, True), (NEW_BATTERY, False)])
def test_batteries_of_every_age(md5: str, drift: bool) -> None:
    scene = Scene()
    board = RosLib(scene)
    publisher = board.publisher("battery", "sensor_msgs/BatteryState", md5)
    board.plug()
    scene.until(lambda: board.connected)
    hear = scene.reader("/battery", "sensor_msgs/msg/BatteryState")
    scene.step(400)
    body = battery(not drift)
    board.send(publisher, body)
    scene.step(2)
    (state,) = hear()
    assert state.voltage == 12.5
    assert math.isnan(state.temperature) if drift else state.temperature == 31.0
    assert list(state.cell_voltage) == [4.0, 4.25]
    assert (state.location, state.serial_number, state.header.stamp.sec) == ("rear", "42", 1_700_000_000)
    told = [finding for finding in scene.told if finding.code == "old-definition"]
    assert bool(told) == drift
    if drift:
        assert "temperature" in told[0].why


def test_headers_get_numbers_on_the_way_to_the_board() -> None:
    scene = Scene()
    board = RosLib(scene)
    imu = board.subscriber("imu", "sensor_msgs/Imu")
    board.plug()
    scene.until(lambda: board.connected)
    write = scene.writer("/imu", "sensor_msgs/msg/Imu")
    scene.step(400)
    for _ in range(3):
        write()
        scene.step(2)
    assert [struct.unpack_from("<I", body)[0] for body in board.taken(imu)] == [1, 2, 3]


def test_renamed_types_meet_their_namesakes() -> None:
    scene = Scene()
    board = RosLib(scene)
    tf = board.publisher("/tf", "tf/tfMessage", "94810edda583a504dfda3829e70d7eec")
    now = board.publisher("now", "std_msgs/Time", "cd7166c74c552c311fbcc2fe5a7bc289")
    board.plug()
    scene.until(lambda: board.connected)
    frames = scene.reader("/tf", "tf2_msgs/msg/TFMessage")
    times = scene.reader("/now", "builtin_interfaces/msg/Time")
    scene.step(400)
    transform = (
        struct.pack("<III", 3, 10, 20) + string("odom") + string("base") + struct.pack("<7d", *range(7))
    )
    board.send(tf, struct.pack("<I", 1) + transform)
    board.send(now, struct.pack("<II", 1_700_000_000, 7))
    scene.step(2)
    (message,) = frames()
    assert message.transforms[0].child_frame_id == "base"
    assert message.transforms[0].transform.rotation.w == 6.0
    assert [(time.sec, time.nanosec) for time in times()] == [(1_700_000_000, 7)]


def test_types_of_ones_own(tmp_path: Path) -> None:
    package = tmp_path / "rosserial_robot_msgs"
    (package / "msg").mkdir(parents=True)
    (package / "srv").mkdir()
    (package / "msg" / "Wheel.msg").write_text("uint8 LEFT=0\nuint8 side\nfloat32[2] speed\nstring name\n")
    (package / "srv" / "Spin.srv").write_text("Wheel wheel\n---\nbool done\n")
    interfaces.add_path(tmp_path)
    scene = Scene()
    board = RosLib(scene)
    wheel = board.publisher(
        "wheel", "rosserial_robot_msgs/Wheel", interfaces.md5("rosserial_robot_msgs/msg/Wheel")
    )
    response, request = board.server("spin", "rosserial_robot_msgs/Spin")
    board.plug()
    scene.until(lambda: board.connected)
    hear = scene.reader("/wheel", "rosserial_robot_msgs/msg/Wheel")
    call, answers = scene.client("/spin", "rosserial_robot_msgs/srv/Spin")
    scene.step(400)
    body = b"\x01" + struct.pack("<ff", 0.5, -0.5) + string("front")
    board.send(wheel, body)
    made = interfaces.message("rosserial_robot_msgs/msg/Wheel")(side=1, speed=[0.5, -0.5], name="front")
    call(wheel=made)
    scene.step(3)
    assert hear() == [made]
    assert board.taken(request) == [body]
    board.send(response, b"\x01")
    scene.step(3)
    assert [answer.done for answer in answers] == [True]


def test_what_differs_is_said_field_by_field_where_it_is_known() -> None:
    scene = Scene()
    board = RosLib(scene)
    board.publisher("imu", "sensor_msgs/Imu", "f" * 32)
    board.plug()
    scene.step(400)
    (told,) = [finding for finding in scene.told if finding.code == "topic-refused"]
    assert "sensor_msgs/Imu" in told.what
    assert interfaces.md5("sensor_msgs/Imu") in told.why
