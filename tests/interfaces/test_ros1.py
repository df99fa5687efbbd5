"""Conversion between ROS 1 serialisation and CDR: recorded payloads, every standard type against rosbags, drift."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.stores.ros1_noetic import FIELDDEFS as NOETIC_TYPES

from muros import interfaces
from muros.interfaces import (
    CdrError,
    InterfaceError,
    Registry,
    converter,
    message,
    ros1_name,
    ros2_message,
    ros2_service,
    service_converter,
)
from muros.interfaces._model import attribute
from tests.interfaces.samples import DISTRO, NAMES, STORE, encode, sample

VECTORS = Path(__file__).parents[1] / "vectors/rosserial"
ROWS: list[dict[str, Any]] = json.loads((VECTORS / "payloads_ros1.json").read_text())["rows"]
SUMS: dict[str, Any] = json.loads((VECTORS / "md5_noetic.json").read_text())
OLD_BATTERY = "476f837fa6771f6e16e3bf4ef96f8770"
COMMON = sorted(
    name for name in NAMES if name in NOETIC_TYPES and not name.startswith(("builtin_interfaces/", "rcl_"))
)


def ros1_type(row: dict[str, Any]) -> str:
    """The type of a row, whose halves of services are written as ROS 1's Python calls them."""
    name: str = row["type"]
    for half in ("Request", "Response"):
        if name.endswith(half) and "srv" in name + "_srv" * name.startswith("rosserial_msgs/RequestParam"):
            return f"{name.removesuffix(half)}_{half}"
    return name


def fill(target: Any, values: dict[str, Any]) -> None:
    """Sets the fields of a ROS 2 message to what a recording says in words of ROS 1."""
    for name, value in values.items():
        name = {"secs": "sec", "nsecs": "nanosec"}.get(name, name)
        if name == "seq" and "Header" in target.TYPE:
            continue
        if isinstance(value, dict):
            fill(getattr(target, name), value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            inner = target.get_fields_and_field_types()[name].removeprefix("sequence<").removesuffix(">")
            setattr(target, name, [message(inner)() for _ in value])
            for each, one in zip(getattr(target, name), value, strict=True):
                fill(each, one)
        else:
            setattr(target, attribute(name), value)


def expected(row: dict[str, Any]) -> Any:
    """The ROS 2 message that a row describes."""
    made = message(ros2_message(ros1_type(row)))()
    values = row["value"]
    if row["type"] in ("std_msgs/Time", "std_msgs/Duration"):
        values = dict(values["data"])
        values["secs"] = (values["secs"] + (1 << 31)) % (1 << 32) - (1 << 31)
    if row["type"] == "std_msgs/Byte":
        values = {"data": values["data"] & 255}
    if row["type"] == "std_msgs/ByteMultiArray":
        values = {**values, "data": bytes(v & 255 for v in values["data"])}
    fill(made, values)
    return made


@pytest.mark.parametrize("row", ROWS, ids=[f"{i}-{row['type']}" for i, row in enumerate(ROWS)])
def test_recorded_payloads_both_ways(row: dict[str, Any]) -> None:
    convert = converter(
        ros1_type(row), row["md5"] if not row["type"].endswith(("Request", "Response")) else None
    )
    raw, cdr = bytes.fromhex(row["ros1_hex"]), expected(row).serialize()
    seq = row["value"].get("header", row["value"] if "Header" in row["type"] else {}).get("seq", 0)
    assert convert.to_cdr(raw) == cdr
    assert convert.to_cdr(memoryview(bytearray(raw))) == cdr
    assert convert.to_ros1(cdr, seq) == raw
    assert convert.to_ros1(cdr + bytes(3), seq) == raw  # as transports pad it
    assert convert.least_size <= len(raw)
    assert convert.ros1_size in (None, len(raw))


@pytest.mark.parametrize("name", SUMS["messages"])
def test_sums_of_noetic_are_spoken(name: str) -> None:
    full = ros2_message(name)
    if name.partition("/")[0] in interfaces.packages() and interfaces.known(full):
        assert converter(name, SUMS["messages"][name]).drift == ""


@pytest.mark.parametrize("name", SUMS["services"])
def test_services_of_noetic(name: str) -> None:
    known = SUMS["services"][name]
    if not interfaces.known(ros2_service(name)):
        with pytest.raises(InterfaceError, match="unknown type"):
            service_converter(name)
        return
    made = service_converter(name, known["request"], known["response"])
    assert (made.md5, made.request.md5, made.response.md5) == (
        known["service"],
        known["request"],
        known["response"],
    )
    assert made.request.drift == made.response.drift == ""


def test_every_common_type_converts_as_rosbags() -> None:
    """All types with one layout byte for byte; a type that differs comes back whole."""
    random, same = Random(5), 0
    for name in COMMON:
        convert = converter(ros1_name(name))
        for _ in range(8):
            cdr = encode(sample(name, random), name)
            there = convert.to_ros1(cdr[4:])
            try:
                theirs = bytes(STORE.cdr_to_ros1(cdr, name))
                back = bytes(STORE.ros1_to_cdr(theirs, name))
            except Exception:  # rosbags has no conversion of types that differ
                theirs = back = b""
            if theirs and len(theirs) == len(there) and name not in DIFFERENT:
                same += 1
                assert there == theirs, name
                assert name in WITH_DURATIONS or convert.to_cdr(there) == back[4:], name
            again = convert.to_cdr(there)
            assert name in WITH_DURATIONS or convert.to_ros1(again) == there, name
            assert convert.to_cdr(convert.to_ros1(again)) == again, name
            if name not in DIFFERENT | WITH_DURATIONS:
                assert message(name).deserialize(again) == message(name).deserialize(cdr[4:]), name
    assert len(COMMON) > 80
    assert same > 8 * 80


DIFFERENT = {
    "sensor_msgs/msg/Range",
    "shape_msgs/msg/SolidPrimitive",
    "visualization_msgs/msg/InteractiveMarker",
    "visualization_msgs/msg/InteractiveMarkerControl",
    "visualization_msgs/msg/InteractiveMarkerInit",
    "visualization_msgs/msg/InteractiveMarkerUpdate",
    "visualization_msgs/msg/Marker",
    "visualization_msgs/msg/MarkerArray",
}
"""Types with fields that ROS 1 lacks."""

WITH_DURATIONS = {
    name
    for name in COMMON
    if "builtin_interfaces/msg/Duration" in Registry().closure(Registry().message(name))
}
"""Types with durations, which do not stay as they are when their nanoseconds are more than a second."""


@pytest.mark.parametrize("name", sorted(DIFFERENT & set(NAMES)))
def test_ros1_reads_what_differs(name: str) -> None:
    """The bytes for ROS 1 are a message of Noetic's definition, its fields those of the ROS 2 message."""
    noetic = get_typestore(Stores.ROS1_NOETIC)
    random = Random(name)
    for _ in range(10):
        cdr = encode(sample(name, random), name)
        convert = converter(ros1_name(name))
        there = convert.to_ros1(cdr[4:], seq=3)
        old = noetic.deserialize_ros1(there, name)
        new = message(name).deserialize(convert.to_cdr(there))
        for field in NOETIC_TYPES[name][1]:
            if field[1][1] in (("string", 0), ("float32", 0), ("int32", 0), ("uint8", 0)):
                assert getattr(new, field[0]) == getattr(old, field[0])


def test_header_takes_the_counter() -> None:
    convert = converter("sensor_msgs/Imu")
    raw = convert.to_ros1(message("sensor_msgs/msg/Imu")().serialize(), seq=0x01020304)
    assert raw[:4] == b"\x04\x03\x02\x01"


def test_durations_borrow() -> None:
    convert = converter("std_msgs/Duration")
    for sec, nsec in ((-1, -500_000_000), (0, -1), (5, 2_000_000_001), (-(1 << 31), -1), (3, 0)):
        read = message("builtin_interfaces/msg/Duration").deserialize(
            convert.to_cdr(struct.pack("<ii", sec, nsec))
        )
        total = sec * 10**9 + nsec
        assert 0 <= read.nanosec < 10**9
        assert (read.sec * 10**9 + read.nanosec - total) % (1 << 32) in (0, (10**9 << 32) % (1 << 32))
    assert converter("std_msgs/Duration").to_ros1(struct.pack("<iI", -1, 5)) == struct.pack("<ii", -1, 5)


def test_any_true_is_true() -> None:
    assert converter("std_msgs/Bool").to_cdr(b"\x05") == b"\x01"
    assert converter("std_srvs/SetBool_Request").to_cdr(b"\xff") == b"\x01"


def test_text_passes_whatever_it_is() -> None:
    raw = b"\x03\0\0\0\xff\0\xfe"
    convert = converter("std_msgs/String")
    assert convert.to_cdr(raw) == b"\x04\0\0\0\xff\0\xfe\0"
    assert convert.to_ros1(b"\x04\0\0\0\xff\0\xfe\0") == raw
    assert convert.to_ros1(b"\0\0\0\0") == bytes(4)


def test_old_battery_state() -> None:
    convert = converter("sensor_msgs/BatteryState", OLD_BATTERY)
    assert convert.drift == "an older definition without temperature and cell_temperature"
    assert convert.md5 == OLD_BATTERY
    state = message("sensor_msgs/msg/BatteryState")(
        voltage=12.5, cell_voltage=[4.0], location="slot", percentage=0.5
    )
    old = convert.to_ros1(state.serialize())
    assert len(old) == len(converter("sensor_msgs/BatteryState").to_ros1(state.serialize())) - 8
    read = message("sensor_msgs/msg/BatteryState").deserialize(convert.to_cdr(old))
    assert math.isnan(read.temperature)
    assert (read.voltage, read.percentage, read.location, list(read.cell_voltage)) == (
        12.5,
        0.5,
        "slot",
        [4.0],
    )


def test_small_drift_is_understood_and_named(tmp_path: Path) -> None:
    home = Registry()
    (tmp_path / "drift_msgs/msg").mkdir(parents=True)
    definition = tmp_path / "drift_msgs/msg/State.msg"

    def sum_of(text: str) -> str:
        definition.write_text(text)
        home.add_path(tmp_path)
        return interfaces._hashes.ros1_md5(home, "drift_msgs/msg/State")

    constant, changed = (
        sum_of("uint8 A=1\nint32 x\nint32 y\n"),
        sum_of("uint8 A=1\nuint8 B=2\nint32 x\nint16 y\n"),
    )
    fields, far = sum_of("uint8 A=1\nuint8 B=2\nint32 x\n"), sum_of("string text\n")
    sum_of("uint8 A=1\nuint8 B=2\nint32 x\nint32 y\n")
    interfaces.add_path(tmp_path)
    assert converter("drift_msgs/State", constant).drift == "the same fields, without constant B"
    assert converter("drift_msgs/State", fields).drift == "an older definition without y"
    with pytest.raises(InterfaceError, match=r"State.y is int16 in ROS 1 and int32 in ROS 2"):
        converter("drift_msgs/State", changed)
    with pytest.raises(InterfaceError, match=f"has md5 sum {far} there"):
        converter("drift_msgs/State", far)


def test_users_own_types(tmp_path: Path) -> None:
    (tmp_path / "old_msgs/msg").mkdir(parents=True)
    (tmp_path / "old_msgs/msg/Own.msg").write_text(
        "Header header\ntime[] when\nduration[2] gap\nbool[] flags\nInner[] inner\nfloat64 last\nstd_msgs/Empty e\n"
    )
    (tmp_path / "old_msgs/msg/Inner.msg").write_text(
        "uint8 a\nstring b\ngeometry_msgs/Point32[] c\nint64 d\n"
    )
    interfaces.add_path(tmp_path)
    convert = converter("old_msgs/Own")
    raw = b"".join(
        (
            struct.pack("<III", 9, 1, 2) + b"\x02\0\0\0ab",
            struct.pack("<IIIII", 2, 1, 2, 3, 4),
            struct.pack("<iiii", 1, -1, -5, 6),
            b"\x03\0\0\0\x00\x07\x01",
            b"\x02\0\0\0"
            + b"\x01"
            + b"\x01\0\0\0z"
            + struct.pack("<I3f", 1, 1.0, 2.0, 3.0)
            + struct.pack("<q", -1),
            b"\x02" + bytes(4) + bytes(4) + struct.pack("<q", 2),
            struct.pack("<d", 0.5),
        )
    )
    cdr = convert.to_cdr(raw)
    read = message("old_msgs/msg/Own").deserialize(cdr)
    assert read.serialize() == cdr
    assert [(gap.sec, gap.nanosec) for gap in read.gap] == [(0, 999_999_999), (-5, 6)]
    assert list(read.flags) == [False, True, True]
    assert [(i.a, i.b, [p.z for p in i.c], i.d) for i in read.inner] == [(1, "z", [3.0], -1), (2, "", [], 2)]
    assert read.last == 0.5
    assert convert.to_cdr(convert.to_ros1(cdr, 9)) == cdr


def test_a_folder_that_is_added_later_counts(tmp_path: Path) -> None:
    for version, text in enumerate(("int32 x\n", "int32 x\nint32 y\n")):
        folder = tmp_path / str(version)
        (folder / "late_msgs/msg").mkdir(parents=True)
        (folder / "late_msgs/msg/Late.msg").write_text(text)
        interfaces.add_path(folder)
        assert converter("late_msgs/Late").ros1_size == 4 * (version + 1)
        assert converter("late_msgs/Late") is converter("late_msgs/Late")


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("Byte", "no ROS 1 type name"),
        ("std_msgs/msg/Byte", "no ROS 1 type name"),
        ("std_msgs/Bite", "did you mean"),
        ("std_srvs/SetBool", "unknown type"),
        ("../etc/passwd", "type name"),
        ("", "type name"),
    ],
)
def test_bad_names(name: str, error: str) -> None:
    with pytest.raises(InterfaceError, match=error):
        converter(name)


def test_names() -> None:
    assert ros2_message("tf/tfMessage") == "tf2_msgs/msg/TFMessage"
    assert ros2_message("rospy_tutorials/AddTwoInts_Request") == "example_interfaces/srv/AddTwoInts_Request"
    assert service_converter("rospy_tutorials/AddTwoInts").md5 == "6a2e34150c00229791cc89ff309fff21"
    assert ros1_name("builtin_interfaces/msg/Time") == "std_msgs/Time"
    assert ros1_name("std_srvs/srv/SetBool") == "std_srvs/SetBool"
    assert ros1_name("tf2_msgs/msg/TFMessage") == "tf2_msgs/TFMessage"
    with pytest.raises(InterfaceError, match="no full type name"):
        ros1_name("std_msgs/Byte")


FUZZED = (
    "sensor_msgs/JointState",
    "nav_msgs/Path",
    "diagnostic_msgs/DiagnosticArray",
    "visualization_msgs/Marker",
)


@given(st.sampled_from(FUZZED), st.binary(max_size=200), st.booleans())
def test_foreign_bytes_raise_one_exception(name: str, raw: bytes, up: bool) -> None:
    convert = converter(name)
    try:
        made = (convert.to_cdr if up else convert.to_ros1)(raw)
    except CdrError:
        return
    (convert.to_ros1 if up else convert.to_cdr)(made)  # what was taken is a message


@given(st.integers(0, 2**32 - 1), st.sampled_from(FUZZED), st.data())
def test_cut_or_longer_messages_are_refused(seed: int, name: str, data: st.DataObject) -> None:
    full, convert = ros2_message(name), converter(name)
    raw = convert.to_ros1(encode(sample(full, Random(seed)), full)[4:])
    cut = data.draw(st.integers(0, len(raw) - 1))
    for bad in (raw[:cut], raw + b"\0"):
        with pytest.raises(CdrError, match=name):
            convert.to_cdr(bad)


def test_counts_beyond_the_message_cost_nothing() -> None:
    convert = converter("sensor_msgs/JointState")
    for count in (0xFFFFFFFF, 0x7FFFFFFF, 1 << 28):
        with pytest.raises(CdrError, match="at least"):
            convert.to_cdr(bytes(16) + struct.pack("<I", count))


def test_other_distributions() -> None:
    assert DISTRO != "foxy"
    assert converter("sensor_msgs/Range", distro="foxy") is not converter("sensor_msgs/Range")
    old = message("sensor_msgs/msg/Range", "foxy")(range=2.5)
    raw = converter("sensor_msgs/Range", distro="foxy").to_ros1(old.serialize())
    assert (
        message("sensor_msgs/msg/Range").deserialize(converter("sensor_msgs/Range").to_cdr(raw)).range == 2.5
    )
