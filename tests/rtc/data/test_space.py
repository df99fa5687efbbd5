"""Data ports as topics of the data space."""

from __future__ import annotations

import contextlib
import json
import math
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros import interfaces
from muros.rtc.codes import DataPortStatus, PeerLostError, ReturnCode
from muros.rtc.data import DataEvent, DataInPort, DataOutPort, DataPort, TransportError, marshaling_types
from muros.rtc.data._types import DataError
from muros.rtc.data.space import _hall, _transport
from muros.rtc.data.space._hall import HALL, Hall
from muros.rtc.data.space._messages import TYPES, codec_of, default_message
from muros.rtc.profiles import ConnectorProfile
from tests.rtc.data.kit import Pair, TimedLong, TimedLongType, long
from tests.rtc.data.test_behaviour import wait_for

LAYOUTS: dict[str, Any] = json.loads(
    (Path(__file__).parents[2] / "vectors" / "rtc" / "idl_types.json").read_text()
)


class Layout:
    """A data type after its recorded layout, with plain objects for values."""

    python_class = SimpleNamespace

    def __init__(self, label: str) -> None:
        self.repository_id = f"IDL:RTC/{label}:1.0"

    def default(self) -> Any:
        return self._made({"struct": self.repository_id}, 0)

    def filled(self, number: int) -> Any:
        """A value of `number` and those after it."""
        return self._made({"struct": self.repository_id}, number)

    def encode(self, value: Any, little: bool) -> bytes:
        raise NotImplementedError

    def decode(self, octets: bytes, little: bool) -> Any:
        raise NotImplementedError

    def _made(self, kind: Any, number: int) -> Any:
        if isinstance(kind, str):
            return {
                "double": number / 8,
                "float": number / 8,
                "string": "text" * (number > 0),
                "wstring": "text" * (number > 0),
                "char": chr(number),
                "boolean": number % 2 == 1,
            }.get(kind, number)
        if "alias" in kind:
            return self._made(kind["of"], number)
        if "sequence" in kind:
            elements = [self._made(kind["sequence"], number + n) for n in range(3)] if number else []
            if kind["sequence"] == "octet":
                return bytes(elements)
            return "".join(elements) if kind["sequence"] == "char" else elements
        layout = LAYOUTS[kind["struct"]]
        return SimpleNamespace(
            **{
                name: self._made(one, number and number + n)
                for n, (name, one) in enumerate(layout["members"])
            }
        )


ROWS = [(label, row.message) for label, rows in TYPES.items() for row in rows]


def test_the_table_names_recorded_types() -> None:
    assert {f"IDL:RTC/{label}:1.0" for label in TYPES} <= set(LAYOUTS)


@pytest.mark.parametrize(("label", "message"), ROWS)
def test_values_go_and_come_back(label: str, message: str) -> None:
    data_type = Layout(label)
    codec = codec_of(data_type, message)
    assert codec is not None
    value = data_type.filled(1)
    if label == "CameraImage":
        value.format, value.bpp, value.fDiv, value.width, value.height = "mono8", 8, 0.0, 3, 1
    elif label == "RangeData":
        value.geometry, value.config.rangeRes = data_type.default().geometry, 0.0
    for little in (True, False):
        octets = codec.encode(value, little)
        assert octets[1] == little, "the encapsulation header tells the endianness"
        assert len(codec.default().__dict__) == len(value.__dict__)
        back = codec.decode(octets, little)
        if hasattr(value, "tm") and not hasattr(interfaces.message(message)(), "header"):
            back.tm = value.tm
        assert flat(back) == pytest.approx(flat(value)), (back, value)


def flat(value: Any) -> list[Any]:
    """The leaves of a value; numbers that messages hold in 32 bits compare with that precision."""
    if isinstance(value, SimpleNamespace):
        return [leaf for one in vars(value).values() for leaf in flat(one)]
    if isinstance(value, list):
        return [leaf for one in value for leaf in flat(one)]
    if isinstance(value, (str, bytes)):
        return list(value.encode() if isinstance(value, str) else value)
    return [value]


def test_what_messages_hold() -> None:
    pose = Layout("TimedPose2D")
    value = pose.default()
    value.tm.sec, value.tm.nsec = 5, 6
    value.data.position.x, value.data.heading = 1.5, math.pi / 2
    codec = codec_of(pose, "geometry_msgs/PoseStamped", "map")
    assert codec is not None
    message = interfaces.message("geometry_msgs/PoseStamped").deserialize(
        codec.encode(value, True), header=True
    )
    assert (message.header.frame_id, message.header.stamp.sec, message.header.stamp.nanosec) == ("map", 5, 6)
    assert message.pose.position.x == 1.5
    assert message.pose.orientation.z == pytest.approx(math.sqrt(0.5))

    image = Layout("CameraImage")
    picture = image.default()
    picture.width, picture.height, picture.bpp, picture.pixels = 2, 1, 24, b"bgrBGR"
    codec = codec_of(image, "sensor_msgs/Image")
    assert codec is not None
    message = interfaces.message("sensor_msgs/Image").deserialize(codec.encode(picture, True), header=True)
    assert (message.encoding, message.step, bytes(message.data)) == ("bgr8", 6, b"bgrBGR")
    picture.format = "RGB8"
    message = interfaces.message("sensor_msgs/Image").deserialize(codec.encode(picture, True), header=True)
    assert message.encoding == "rgb8"


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_angles(r: float, p: float, y: float) -> None:
    data_type = Layout("TimedOrientation3D")
    codec = codec_of(data_type, "geometry_msgs/Quaternion")
    assert codec is not None
    value = data_type.default()
    value.data.r, value.data.p, value.data.y = r, p, y
    back = codec.decode(codec.encode(value, True), True)
    assert (back.data.r, back.data.p, back.data.y) == pytest.approx((r, p, y), abs=1e-6)


@given(st.binary(max_size=80), st.sampled_from(ROWS))
def test_foreign_octets_are_values_or_an_error(octets: bytes, row: tuple[str, str]) -> None:
    codec = codec_of(Layout(row[0]), row[1])
    assert codec is not None
    with contextlib.suppress(DataError):
        codec.decode(octets, True)


def test_values_that_do_not_fit() -> None:
    codec = codec_of(Layout("TimedLong"), "std_msgs/Int8")
    assert codec is not None
    value = codec.default()
    value.data = 200
    with pytest.raises(DataError, match="std_msgs/msg/Int8"):
        codec.encode(value, True)
    image = Layout("CameraImage")
    codec = codec_of(image, "sensor_msgs/Image")
    assert codec is not None
    picture = image.default()
    picture.format = "jpeg"
    with pytest.raises(DataError, match="no ROS encoding"):
        codec.encode(picture, True)
    huge = interfaces.message("sensor_msgs/Image")()
    huge.width = 70000
    with pytest.raises(DataError, match="too many"):
        codec.decode(huge.serialize(header=True), True)


def test_names() -> None:
    assert default_message("IDL:RTC/TimedVelocity2D:1.0") == "geometry_msgs/Twist"
    assert default_message("IDL:RTC/TimedWChar:1.0") == ""
    assert codec_of(Layout("TimedLong"), "std_msgs/String") is None
    assert marshaling_types(TimedLongType()) == ("cdr", "ros2:std_msgs/Int32")


# ---- ports


SPACE = {
    "dataport.interface_type": "space",
    "dataport.dataflow_type": "push",
    "dataport.space.url": "local:",
    "dataport.topic": "numbers",
}


@pytest.fixture
def both() -> Iterator[Pair]:
    pair = Pair()
    yield pair
    pair.out.disconnect_all()
    pair.in_.disconnect_all()
    assert not HALL._rooms, "nobody is left in the hall"
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("muros rtc space")]


def join(port: DataPort[Any], **more: str) -> ReturnCode:
    """Connect the port alone."""
    named = {f"dataport.{key.replace('__', '.')}": text for key, text in more.items()}
    return port.connect(ConnectorProfile("space", "", (port,), {**SPACE, **named}))[0]


def test_ports_meet_at_a_topic(both: Pair) -> None:
    assert join(both.in_) is ReturnCode.RTC_OK, [finding.format() for finding in both.findings]
    assert join(both.out, subscription_type="new") is ReturnCode.RTC_OK
    assert join(both.out, interface_type="ros2") is ReturnCode.RTC_OK
    assert both.out.write(long(12))
    wait_for(lambda: len(both.in_._pushed[0].buffer.ring) == 2)
    assert [both.in_.try_read() for _ in range(2)] == [(DataPortStatus.PORT_OK, long(12))] * 2


def test_many_values_keep_their_order(both: Pair) -> None:
    join(both.in_, inport__buffer__length="1000", qos__depth="1000")
    join(both.out, qos__depth="1000")
    for number in range(500):
        assert both.out.write(long(number))
    wait_for(lambda: len(both.in_._pushed[0].buffer.ring) == 500)
    assert [both.in_.read().data for _ in range(500)] == list(range(500))


def test_why_nothing_comes_is_told(both: Pair) -> None:
    join(both.in_)
    join(both.out, qos="sensor_data")
    wait_for(lambda: bool(both.findings))
    assert "the reader wants reliable, the writer offers best effort" in both.findings[0].format()


def test_an_inport_that_blocks_holds_up_nobody_else(both: Pair) -> None:
    other = Pair()
    entered, leave = threading.Event(), threading.Event()

    def block(*arguments: object) -> None:
        entered.set()
        leave.wait(10)

    both.in_.add_listener(DataEvent.ON_RECEIVED, block)
    join(both.in_)
    join(other.in_)
    join(both.out)
    try:
        both.out.write(long(1))
        assert entered.wait(10)
        both.out.write(long(2))
        wait_for(lambda: len(other.in_._pushed[0].buffer.ring) == 2)
    finally:
        leave.set()
        other.in_.disconnect_all()


@pytest.mark.parametrize(
    ("options", "code", "told"),
    [
        ({"marshaling_type": "ros2:std_msgs/String"}, ReturnCode.RTC_ERROR, "ros2:std_msgs/Int32"),
        ({"marshaling_type": "cdr"}, ReturnCode.BAD_PARAMETER, "type"),
        ({"topic": "no good"}, ReturnCode.BAD_PARAMETER, "no good"),
        ({"space__url": "nosuch:"}, ReturnCode.BAD_PARAMETER, "nosuch"),
        ({"space__url": "dds:many"}, ReturnCode.BAD_PARAMETER, "many"),
        ({"qos": "nosuch"}, ReturnCode.BAD_PARAMETER, "sensor_data"),
        ({"qos__reliability": "nosuch"}, ReturnCode.BAD_PARAMETER, "best_effort"),
        ({"qos__depth": "x"}, ReturnCode.BAD_PARAMETER, "x"),
        ({"node__name": "9"}, ReturnCode.BAD_PARAMETER, "9"),
        ({"dataflow_type": "pull"}, ReturnCode.BAD_PARAMETER, "pull"),
    ],
)
def test_requests_that_cannot_be(both: Pair, options: dict[str, str], code: ReturnCode, told: str) -> None:
    for port in (both.in_, both.out):
        assert join(port, **options) is code
        assert told in both.findings[-1].format()
    assert not both.in_.connectors


def test_a_type_without_a_message_is_refused() -> None:
    codec = TimedLongType()
    codec.repository_id = "IDL:RTC/TimedWChar:1.0"
    port: DataOutPort[TimedLong] = DataOutPort("out", codec)
    assert join(port) is ReturnCode.RTC_ERROR


def test_other_messages_and_names(both: Pair) -> None:
    class Owner:
        instance_name = "Console Out0"

    both.out.owner = both.in_.owner = Owner()
    wider = {"marshaling_type": "ros2:std_msgs/msg/Int64", "topic": ""}
    port: DataInPort[TimedLong] = DataInPort("out", both.codec, owner=Owner())
    assert join(port, **wider) is ReturnCode.RTC_OK, "the topic is called as the port"
    assert join(both.out, **wider, qos="sensor_data", qos__durability="volatile") is ReturnCode.RTC_OK
    (room,) = HALL._rooms.values()
    assert list(room.nodes) == ["Console_Out0"]
    topics = {topic.name: topic.types for topic in room.space.graph.topics}
    assert topics == {"rt/out": ("std_msgs::msg::dds_::Int64_",)}
    port.disconnect_all()


def test_what_the_hall_cannot_take_is_refused(both: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    """The hall's thread stands still: writes go on, until as many wait as may."""
    monkeypatch.setattr(_transport, "BACKLOG", 3)
    join(both.out, space__url="local:")
    entered, go_on = threading.Event(), threading.Event()

    def stand_still() -> None:
        entered.set()
        go_on.wait(10)

    HALL.post(stand_still)
    assert entered.wait(10)
    try:
        assert [both.out.write(long(number)) for number in range(5)] == [True] * 3 + [False] * 2
        assert both.out.status == [DataPortStatus.SEND_FULL]
    finally:
        go_on.set()
    wait_for(lambda: both.out.write(long(9)))


def test_what_an_inport_is_too_slow_for_is_counted(both: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_transport, "BACKLOG", 3)
    entered, go_on = threading.Event(), threading.Event()

    def stand_still(*arguments: object) -> None:
        entered.set()
        go_on.wait(10)

    both.in_.add_listener(DataEvent.ON_RECEIVED, stand_still)
    join(both.in_, qos__depth="100")
    join(both.out, qos__depth="100")
    try:
        both.out.write(long(0))
        assert entered.wait(10)
        for number in range(1, 10):
            wait_for(lambda number=number: both.out.write(long(number)))  # type: ignore[misc]
        wait_for(lambda: "values-overwritten" in both.codes())
    finally:
        go_on.set()
    assert any("rt/numbers dropped" in finding.what for finding in both.findings)


def test_writing_when_the_hall_has_closed() -> None:
    hall = Hall()
    assert not hall.post(lambda: None)
    pair = Pair()
    join(pair.out)
    link = pair.out._out_links[0]
    inlet = link._inlet  # type: ignore[attr-defined]
    pair.out.disconnect_all()
    with pytest.raises(PeerLostError, match="closed"):
        inlet.put(bytes(8))
    inlet.close()


def test_a_space_that_does_not_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_hall, "CALL_TIME", 0.05)
    go_on = threading.Event()

    def never(url: str) -> Any:
        go_on.wait(10)
        raise OSError("too late")

    hall = Hall(never)
    try:
        with pytest.raises(TransportError, match="did not answer"):
            hall.enter("local:", "node", print)
    finally:
        go_on.set()
