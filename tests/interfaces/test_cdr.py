"""The codecs of host classes: byte for byte those of rosbags, safe with foreign bytes, clear about wrong values."""

from __future__ import annotations

import copy
import pickle
import tracemalloc
from array import array
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from muros import interfaces
from muros.cdr import CdrError
from muros.interfaces import Message, MessageBase, message
from tests.interfaces.samples import DISTRO, NAMES, STORE, encode, sample

EVERYTHING = """
bool flag true
byte octet
char letter
int8 a -1
uint8 b
int16 c
uint16 d
int32 e
uint32 f
int64 g
uint64 h
float32 i
float64 j 0.5
string text "it's"
string<=5 short
wstring wide
wstring<=2 narrow
string[2] pair
string<=3[<=2] few
wstring[] wides
bool[3] bools
bool[] flags
uint8[3] rgb
byte[<=4] bytes_
int32[2] two [1, 2]
float64[<=2] doubles
int64[] longs
std_msgs/Empty nothing
std_msgs/Empty[] nothings
geometry_msgs/Point[2] corners
std_msgs/Header[<=2] headers
uint8 from
builtin_interfaces/Time size
""".replace("bytes_", "data")


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("definitions")
    (folder / "every_msgs" / "msg").mkdir(parents=True)
    (folder / "every_msgs" / "msg" / "Everything.msg").write_text(EVERYTHING)
    interfaces.add_path(folder)
    return message("every_msgs/msg/Everything")


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=6)
@given(seed=st.integers(0, 2**64))
def test_same_bytes_as_rosbags_both_ways(name: str, seed: int) -> None:
    theirs = sample(name, Random(seed))
    ours = message(name, DISTRO)
    for big_endian in (False, True):
        data = encode(theirs, name, big_endian)
        read = ours.deserialize(data, header=True)
        assert read.serialize(big_endian=big_endian, header=True) == data
        assert read == ours.deserialize(data[4:], big_endian=big_endian)
        back = STORE.deserialize_cdr(read.serialize(big_endian=big_endian, header=True), name)
        assert encode(back, name, big_endian) == data


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=3)
@given(seed=st.integers(0, 2**64))
def test_buffers_take_what_serialize_makes(name: str, seed: int) -> None:
    body = encode(sample(name, Random(seed)), name)[4:]
    ours = message(name, DISTRO)
    read = ours()
    read.read(b"\xff" * 5 + body + b"\xff" * 9, 5, len(body))
    assert read.size() == len(body)
    buffer = bytearray(b"\xaa" * (len(body) + 7))
    assert read.write(buffer, 7) == len(buffer)
    assert buffer == b"\xaa" * 7 + body
    with pytest.raises(CdrError):
        read.write(buffer, 8)


@settings(max_examples=300)
@given(name=st.sampled_from(NAMES), data=st.binary(max_size=200), big_endian=st.booleans())
def test_foreign_bytes_give_a_message_or_one_exception(name: str, data: bytes, big_endian: bool) -> None:
    ours = message(name, DISTRO)
    try:
        read = ours.deserialize(data, big_endian=big_endian)
    except CdrError:
        return
    again = read.serialize(big_endian=big_endian)
    # An empty message may come without its byte; a string without its NUL, which then takes up to 8 with padding.
    assert len(again) <= 3 * len(data) + 1
    assert ours.deserialize(again, big_endian=big_endian).serialize() == read.serialize()


@settings(max_examples=200)
@given(data=st.data(), seed=st.integers(0, 2**32), name=st.sampled_from(NAMES))
def test_damaged_bodies_give_a_message_or_one_exception(data: st.DataObject, seed: int, name: str) -> None:
    body = bytearray(encode(sample(name, Random(seed)), name)[4:])
    for _ in range(3):
        body[data.draw(st.integers(0, len(body) - 1))] = data.draw(st.sampled_from([0, 1, 127, 128, 255]))
    cut = data.draw(st.integers(0, len(body)))
    for part in (bytes(body), bytes(body[:cut])):
        try:
            message(name, DISTRO).deserialize(part).serialize()
        except CdrError:
            continue


@pytest.mark.parametrize(
    "name", ["std_msgs/msg/Float64MultiArray", "sensor_msgs/msg/JointState", "tf2_msgs/msg/TFMessage"]
)
def test_lying_counts_take_no_memory(name: str) -> None:
    ours = message(name, DISTRO)
    honest = len(ours().serialize())
    tracemalloc.start()
    try:
        for at in range(0, honest, 4):
            for lie in (2**32 - 1, 2**31, 1_000_000):
                body = bytearray(honest + 64)
                body[at : at + 4] = lie.to_bytes(4, "little")
                with pytest.raises(CdrError):
                    ours.deserialize(bytes(body))
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


def test_everything_a_definition_may_hold_goes_there_and_back(everything: Any) -> None:
    value = everything(
        octet=255,
        letter=65,
        h=2**64 - 1,
        text="äöü",
        short="12345",
        wide="Straße \U0001f916",
        narrow="ß",
        pair=["a", ""],
        few=["abc"],
        wides=["", "x"],
        bools=[True, False, True],
        flags=[False, True],
        rgb=[1, 2, 3],
        data=b"\x01\x02",
        doubles=[0.5],
        longs=range(3),
        nothings=[message("std_msgs/msg/Empty")()],
        headers=[message("std_msgs/msg/Header")(frame_id="map")],
        from_=7,
    )
    for big_endian in (False, True):
        again = everything.deserialize(value.serialize(big_endian), big_endian)
        assert again == value
        assert again.serialize(big_endian) == value.serialize(big_endian)
    assert value.size() == len(value.serialize())
    assert again.flag is True
    assert again.bools == [True, False, True]
    assert again.longs == array("q", [0, 1, 2])
    assert again.rgb == b"\1\2\3"
    assert (again.a, again.j, again.text) == (-1, 0.5, "äöü")
    assert again.size_ == message("builtin_interfaces/msg/Time")()
    assert copy.deepcopy(again) == again
    assert pickle.loads(pickle.dumps(again)) == again


def test_defaults(everything: Any) -> None:
    value = everything()
    assert (value.flag, value.a, value.j, value.text, value.b) == (True, -1, 0.5, "it's", 0)
    assert value.two == array("i", [1, 2])
    assert value.corners[0] is not value.corners[1]
    assert everything().corners[0] is not value.corners[0]
    assert message("geometry_msgs/msg/Quaternion")().w == 1.0
    assert message("sensor_msgs/msg/NavSatStatus")().status == -2
    assert message("sensor_msgs/msg/NavSatStatus", "humble")().status == 0


def test_wide_strings_are_utf16_units_in_four_bytes_each(everything: Any) -> None:
    wide = message("example_interfaces/msg/WString")
    assert wide(data="A\u00df").serialize() == bytes.fromhex("02000000 41000000 df000000")
    assert wide(data="\U0001f916").serialize() == bytes.fromhex("02000000 3ed80000 16dd0000")
    assert wide(data="A").serialize(big_endian=True) == bytes.fromhex("00000001 00000041")
    for bad in ("01000000 00000100", "01000000 3ed80000", "02000000 41000000"):
        with pytest.raises(CdrError):
            wide.deserialize(bytes.fromhex(bad))


def test_an_empty_message_is_one_byte_and_may_come_without() -> None:
    empty = message("std_msgs/msg/Empty")
    assert empty().serialize() == b"\0"
    assert empty().size() == 1
    for body in (b"", b"\0", b"\5", b"\0\0\0\0"):
        assert empty.deserialize(body) == empty()
    with pytest.raises(CdrError):
        empty.deserialize(bytes(5))


def test_padding_behind_the_body_is_ignored_and_more_is_refused() -> None:
    int8 = message("std_msgs/msg/Int8")
    for rest in range(4):
        assert int8.deserialize(b"\xff" + bytes(rest)).data == -1
    with pytest.raises(
        CdrError, match=r"std_msgs/msg/Int8: malformed body: 4 bytes left over: is it of another"
    ):
        int8.deserialize(bytes(5))


@pytest.mark.parametrize(
    ("body", "problem"),
    [
        ("05000000 61626364", "at least 9 needed"),
        ("04000000 61626364", "does not end with NUL"),
        ("03000000 c32800", "invalid continuation byte"),
        ("0000", "2 bytes are too few"),
    ],
)
def test_malformed_strings(body: str, problem: str) -> None:
    with pytest.raises(CdrError, match=problem):
        message("std_msgs/msg/String").deserialize(bytes.fromhex(body))
    assert message("std_msgs/msg/String").deserialize(bytes(4)).data == ""


@pytest.mark.parametrize(
    ("name", "fields", "problem"),
    [
        ("std_msgs/msg/Int32", {"data": 1 << 31}, "std_msgs/msg/Int32.data: 2147483648 does not fit int32"),
        ("std_msgs/msg/UInt8", {"data": "1"}, "std_msgs/msg/UInt8.data: '1' does not fit uint8"),
        ("std_msgs/msg/String", {"data": 5}, "std_msgs/msg/String.data: a str is due, not int"),
        ("std_msgs/msg/Header", {"stamp": 5}, "std_msgs/msg/Header.stamp: 5 is no builtin_interfaces/Time"),
        ("sensor_msgs/msg/LaserScan", {"ranges": ["x"]}, r"LaserScan.ranges\[0\]: 'x' does not fit float"),
        ("sensor_msgs/msg/LaserScan", {"ranges": 5}, r"LaserScan.ranges: 5 is no sequence of float"),
        ("sensor_msgs/msg/LaserScan", {"ranges": np.zeros((2, 2))}, "does not fit float"),
        (
            "sensor_msgs/msg/Imu",
            {"orientation_covariance": [0.0]},
            "Imu.orientation_covariance: 1 elements, 9 needed",
        ),
        ("sensor_msgs/msg/JointState", {"name": [b"a", 1]}, r"JointState.name\[1\]: a str is due, not int"),
        (
            "tf2_msgs/msg/TFMessage",
            {"transforms": [None]},
            r"TFMessage.transforms\[0\]: None is no geometry_msgs/Tran",
        ),
        (
            "rcl_interfaces/msg/ParameterDescriptor",
            {"integer_range": [1, 2]},
            "2 elements, at most 1|is no rcl_inter",
        ),
    ],
)
def test_values_that_do_not_fit_are_named(name: str, fields: dict[str, Any], problem: str) -> None:
    value = message(name, DISTRO)(**fields)
    for write in (
        value.serialize,
        lambda: value.serialize(big_endian=True),
        lambda: value.write(bytearray(999)),
    ):
        with pytest.raises(CdrError, match=problem):
            write()


def test_bounds_hold_in_both_directions(everything: Any) -> None:
    for fields in (
        {"short": "123456"},
        {"narrow": "abc"},
        {"few": ["a"] * 3},
        {"few": ["abcd"]},
        {"data": bytes(5)},
    ):
        with pytest.raises(CdrError):
            everything(**fields).serialize()
    unbounded = message("std_msgs/msg/String")(data="a" * 257).serialize()
    with pytest.raises(CdrError):
        message("micro_ros_msgs/msg/Node").deserialize(unbounded + bytes(11))


def test_numbers_may_come_as_lists_arrays_numpy_and_ranges() -> None:
    scan = message("sensor_msgs/msg/LaserScan")
    wanted = scan(ranges=array("f", [1, 2, 3])).serialize()
    for ranges in (
        [1, 2, 3],
        (1.0, 2.0, 3.0),
        range(1, 4),
        np.array([1, 2, 3]),
        np.arange(1, 4, dtype=np.float32),
    ):
        value = scan(ranges=ranges)
        assert value.serialize() == wanted
        assert value.size() == len(wanted)
        assert value == scan.deserialize(wanted)
    strided = np.arange(2, 8, dtype=np.float32)[::2] / 2
    assert scan(ranges=strided).serialize() == wanted
    longs = message("std_msgs/msg/Int64MultiArray")
    assert longs(data=np.array([1, -1])).serialize() == longs(data=[1, -1]).serialize()


def test_numbers_are_buffers() -> None:
    scan = message("sensor_msgs/msg/LaserScan")
    ranges = scan.deserialize(scan(ranges=[1, 2]).serialize()).ranges
    assert np.frombuffer(ranges, dtype=np.float32).tolist() == [1.0, 2.0]
    ranges.append(3.0)
    assert ranges.tolist() == [1, 2, 3]


def test_bytes_may_come_in_many_forms_and_are_views_of_what_cannot_change() -> None:
    octets = message("std_msgs/msg/UInt8MultiArray")
    wanted = octets(data=b"\1\2\3").serialize()
    for data in (
        bytearray(b"\1\2\3"),
        memoryview(b"\1\2\3"),
        [1, 2, 3],
        np.array([1, 2, 3], np.uint8),
        range(1, 4),
    ):
        assert octets(data=data).serialize() == wanted
    assert octets(data=np.array([[1, 2], [3, 4]], np.uint8)[:, 0]).serialize()[-2:] == b"\1\3"
    large = octets(data=bytes(1 << 16)).serialize()
    assert octets.deserialize(large).data.obj is large
    changing = bytearray(large)
    view = octets.deserialize(memoryview(changing)).data
    changing[-1] = 7
    assert view[-1] == 0
    assert octets.deserialize(b"\0\1\0\0" + large, header=True).data == bytes(1 << 16)


@pytest.mark.parametrize("header", ["", "00", "00010000"[:6], "0002 0000", "0103 0000"])
def test_only_plain_encapsulations_are_read(header: str) -> None:
    with pytest.raises(CdrError, match=r"encapsulation|too few"):
        message("std_msgs/msg/Int8").deserialize(bytes.fromhex(header), header=True)


def test_reading_never_leaves_the_slice() -> None:
    int32 = message("std_msgs/msg/Int32")()
    for off, count in ((0, 5), (2, 3), (-1, 2), (5, 0)):
        with pytest.raises(CdrError):
            int32.read(bytes(4), off, count)
    with pytest.raises(CdrError):
        message("std_msgs/msg/String")().read(b"\5\0\0\0abcd\0", 0, 8)


def test_classes_tell_what_they_are() -> None:
    imu: Any = message("sensor_msgs/msg/Imu")
    assert imu is message("sensor_msgs/Imu")
    assert MessageBase in imu.__bases__
    assert (imu.TYPE, imu.__name__, imu.__module__) == ("sensor_msgs/msg/Imu", "Imu", "sensor_msgs.msg")
    fields = imu.get_fields_and_field_types()
    assert fields["header"] == "std_msgs/Header"
    assert fields["orientation_covariance"] == "double[9]"
    node = message("micro_ros_msgs/msg/Entity")
    assert list(node.get_fields_and_field_types().values()) == [
        "octet",
        "string<256>",
        "sequence<string<256>>",
    ]
    assert (node.PUBLISHER, node.SERVICE_CLIENT) == (0, 3)
    with pytest.raises(AttributeError):
        imu().no_such_field = 1
    assert message("std_msgs/msg/Int32")() != message("std_msgs/msg/Int64")()


def test_repr_is_readable_and_short() -> None:
    assert repr(message("std_msgs/msg/Int32")(3)) == "std_msgs.msg.Int32(data=3)"
    cloud = message("sensor_msgs/msg/PointCloud2")
    value = cloud.deserialize(cloud(data=bytes(1 << 20)).serialize())
    assert len(repr(value)) < 1000
    assert "1048576 in all" in repr(value)


def test_service_and_action_classes() -> None:
    add = interfaces.service("example_interfaces/AddTwoInts")
    assert add.TYPE == "example_interfaces/srv/AddTwoInts"
    assert add.Request.TYPE == "example_interfaces/srv/AddTwoInts_Request"
    assert add.Request(a=1, b=2).serialize() == bytes.fromhex("0100000000000000 0200000000000000")
    fibonacci = interfaces.action("example_interfaces/action/Fibonacci")
    goal = fibonacci.SendGoal.Request(goal=fibonacci.Goal(order=3))
    assert goal.serialize() == bytes(16) + b"\3\0\0\0"
    assert fibonacci.FeedbackMessage.TYPE == "example_interfaces/action/Fibonacci_FeedbackMessage"
    assert interfaces.load("example_interfaces/Fibonacci") is fibonacci
    event = message("example_interfaces/srv/AddTwoInts_Event", DISTRO)
    assert event.deserialize(event().serialize()) == event()


def test_a_service_needs_no_event_of_older_distributions() -> None:
    assert interfaces.service("std_srvs/SetBool", "humble").Response.TYPE == "std_srvs/srv/SetBool_Response"


def test_names_that_python_or_muros_needs_get_an_underscore(tmp_path: Path) -> None:
    (tmp_path / "odd_msgs" / "msg").mkdir(parents=True)
    (tmp_path / "odd_msgs" / "msg" / "A.msg").write_text(
        "int8 self\nint8 class\nfloat64[] array\nuint8[2] bytes\nint8[2] range\nint8 m\nint8 o 3\nN N\nint8 READ=1\n"
    )
    (tmp_path / "odd_msgs" / "msg" / "N.msg").write_text("string text\nint8 TYPE=5\nint8 A=6\n")
    interfaces.add_path(tmp_path)
    odd: Any = message("odd_msgs/msg/A")
    value = odd(self_=1, class_=2, array=[0.5])
    value.N.text = "x"
    again = odd.deserialize(value.serialize())
    assert (again.self_, again.class_, again.array[0], again.o, again.N.text) == (1, 2, 0.5, 3, "x")
    assert again == value
    assert (value.N.TYPE, value.N.TYPE_, value.N.A, odd.READ) == ("odd_msgs/msg/N", 5, 6, 1)


def test_definition_is_a_message() -> None:
    assert isinstance(interfaces.definition("std_msgs/msg/Int32"), Message)


def test_adding_a_folder_keeps_the_classes_there_are(tmp_path: Path) -> None:
    before = message("std_msgs/msg/Header")
    (tmp_path / "late_msgs" / "msg").mkdir(parents=True)
    (tmp_path / "late_msgs" / "msg" / "A.msg").write_text("Header h\n")
    interfaces.add_path(tmp_path)
    assert type(message("late_msgs/msg/A")().h) is before is message("std_msgs/msg/Header")
    interfaces.add_path(tmp_path)  # again, unchanged
    assert message("std_msgs/msg/Header") is before
    (tmp_path / "other" / "late_msgs" / "msg").mkdir(parents=True)
    (tmp_path / "other" / "late_msgs" / "msg" / "A.msg").write_text("int8 b\n")
    interfaces.add_path(tmp_path / "other")
    assert message("late_msgs/msg/A")(b=1).b == 1


def test_threads_share_one_class() -> None:
    with ThreadPoolExecutor(8) as pool:
        made = list(
            pool.map(lambda _: message("visualization_msgs/msg/InteractiveMarker", "kilted"), range(8))
        )
    assert len(set(made)) == 1
