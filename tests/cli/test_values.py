"""Messages as YAML and CSV, and back."""

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from muros import interfaces
from muros.cli._tool import CommandError
from muros.cli._values import Look, fill, hex_dump, pick, read_yaml, to_csv, to_yaml
from muros.interfaces import FieldType, Kind

ALL = Look(truncate=None)

KINDS = (
    "std_msgs/msg/String",
    "std_msgs/msg/Byte",
    "std_msgs/msg/Empty",
    "sensor_msgs/msg/LaserScan",
    "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/CompressedImage",
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/PointCloud2",
    "rcl_interfaces/msg/ParameterEvent",
    "diagnostic_msgs/msg/DiagnosticArray",
    "example_interfaces/srv/AddTwoInts_Request",
    "std_msgs/msg/UInt8MultiArray",
)

INTEGERS = {
    **{f"int{n}": (-(1 << n - 1), (1 << n - 1) - 1) for n in (8, 16, 32, 64)},
    **{f"uint{n}": (0, (1 << n) - 1) for n in (8, 16, 32, 64)},
    "byte": (0, 255),
    "char": (0, 255),
}


def one(kind: FieldType) -> st.SearchStrategy[Any]:
    if kind.nested:
        return plain(kind.base)
    if kind.base in INTEGERS:
        return st.integers(*INTEGERS[kind.base])
    if kind.base == "bool":
        return st.booleans()
    if kind.base.startswith("float"):
        return st.floats(width=32 if kind.base == "float32" else 64, allow_nan=False)
    return st.text(max_size=12)


def values(kind: FieldType) -> st.SearchStrategy[Any]:
    if kind.kind is Kind.ONE:
        return one(kind)
    low, high = (kind.count, kind.count) if kind.kind is Kind.ARRAY else (0, min(kind.count or 3, 3))
    return st.lists(one(kind), min_size=low, max_size=high)


def plain(name: str) -> st.SearchStrategy[dict[str, Any]]:
    """Values for all fields of a message."""
    fields = interfaces.registry().message(name).fields
    return st.fixed_dictionaries({field.name: values(field.type) for field in fields})


@pytest.mark.parametrize("name", KINDS)
@settings(max_examples=30)
@given(data=st.data())
def test_what_echo_prints_pub_reads(name: str, data: st.DataObject) -> None:
    made = interfaces.message(name)
    message, again = made(), made()
    fill(message, data.draw(plain(name)))
    message = made.deserialize(message.serialize())
    fill(again, read_yaml(to_yaml(message, ALL)))
    assert again == message
    assert again.serialize() == message.serialize()


@given(st.text())
def test_values_from_the_command_line_are_yaml_or_one_line_of_error(text: str) -> None:
    message = interfaces.message("geometry_msgs/msg/PoseStamped")()
    try:
        fill(message, read_yaml(text))
    except CommandError as error:
        told = str(error)
    else:
        told = ""
        message.serialize()
    assert "\n" not in told


@pytest.mark.parametrize(
    ("name", "text", "field", "value"),
    [
        ("std_msgs/msg/Int32", "{data: 0x10}", "data", 16),
        ("std_msgs/msg/Int32", "data: '12'", "data", 12),
        ("std_msgs/msg/Int32", "data: 12.0", "data", 12),
        ("std_msgs/msg/Int32", "-5", "data", -5),
        ("std_msgs/msg/Float64", "data: 1e-3", "data", 0.001),
        ("std_msgs/msg/Float64", "data: 3", "data", 3.0),
        ("std_msgs/msg/Float64", "data: .inf", "data", math.inf),
        ("std_msgs/msg/Bool", "data: yes", "data", True),
        ("std_msgs/msg/Bool", "data: 0", "data", False),
        ("std_msgs/msg/String", "data: 5", "data", "5"),
        ("std_msgs/msg/String", "data: true", "data", "true"),
        ("std_msgs/msg/String", "Hello", "data", "Hello"),
        ("std_msgs/msg/String", "data:", "data", ""),
        ("std_msgs/msg/Byte", "data: 4", "data", 4),
        ("std_msgs/msg/UInt8MultiArray", "data: [1, 2]", "data", b"\1\2"),
        ("std_msgs/msg/UInt8MultiArray", "data: !!binary aGk=", "data", b"hi"),
        ("std_msgs/msg/UInt8MultiArray", "data: hi", "data", b"hi"),
    ],
)
def test_values_that_are_understood(name: str, text: str, field: str, value: object) -> None:
    message = interfaces.message(name)()
    fill(message, read_yaml(text))
    assert interfaces.message(name).deserialize(message.serialize()).__getattribute__(field) == value


@pytest.mark.parametrize(
    ("name", "text", "error"),
    [
        ("std_msgs/msg/Int32", "data: 1.5", "field data: 1.5 is no int32"),
        ("std_msgs/msg/Int32", "data: [1]", "field data: one int32 is needed, not [1]"),
        ("std_msgs/msg/UInt8", "data: 256", "field data: 256 is out of the range of uint8, 0 to 255"),
        ("std_msgs/msg/Bool", "data: maybe", "field data: 'maybe' is no bool"),
        ("sensor_msgs/msg/LaserScan", "ranges: 5", "field ranges: a list is needed for float32[], not 5"),
        ("sensor_msgs/msg/LaserScan", "ranges: [1, x]", "field ranges[1]: 'x' is no float32"),
        (
            "sensor_msgs/msg/Imu",
            "orientation_covariance: [1, 2]",
            "field orientation_covariance: 2 elements, float64[9] has 9",
        ),
        (
            "geometry_msgs/msg/Twist",
            "{linear: {q: 1}}",
            "geometry_msgs/msg/Vector3 has no field 'q' (it has x, y, z)",
        ),
        ("geometry_msgs/msg/Twist", "{linear: {x: z}}", "field linear.x: 'z' is no float64"),
        (
            "geometry_msgs/msg/Twist",
            "{linear: 5}",
            "field linear: geometry_msgs/msg/Vector3 needs its fields by name, as in '{x: ..., y: ..., z: ...}'",
        ),
        ("std_msgs/msg/String", "{data: [}", "the values are no YAML at line 1, column "),
        ("std_msgs/msg/String", "data: 2026-13-45", "the values are no YAML: month must be in "),
        ("std_msgs/msg/String", "[" * 9000, "the values are no YAML"),
        ("std_msgs/msg/String", "a: 1\n---\nb: 2", "the values are several documents; "),
        ("geometry_msgs/msg/Twist", "&a {linear: *a}", "geometry_msgs/msg/Vector3 has no field 'linear' "),
    ],
)
def test_values_that_do_not_fit(name: str, text: str, error: str) -> None:
    with pytest.raises(CommandError) as raised:
        fill(interfaces.message(name)(), read_yaml(text))
    assert str(raised.value).startswith(error)


def test_times_are_set_when_they_are_known() -> None:
    message = interfaces.message("tf2_msgs/msg/TFMessage")()
    values = "transforms: [{header: auto}, {header: {stamp: now, frame_id: map}}, {header: {frame_id: odom}}]"
    stamps = fill(message, read_yaml(values))
    for stamp in stamps:
        stamp(3 * 10**9 + 7)
    assert [(t.header.stamp.sec, t.header.stamp.nanosec) for t in message.transforms] == [
        (3, 7),
        (3, 7),
        (0, 0),
    ]
    assert [t.header.frame_id for t in message.transforms] == ["", "map", "odom"]


def test_looks() -> None:
    scan = interfaces.message("sensor_msgs/msg/Imu")(header=None)
    scan.header.frame_id = "imu_link"
    short = to_yaml(scan, Look(truncate=3, no_arrays=True))
    assert "frame_id: imu..." in short
    assert "orientation_covariance: '<array type: double[9]>'\n" in short
    assert "frame_id: '<string length: <8>>'\n" in to_yaml(scan, Look(no_strings=True))
    status = interfaces.message("diagnostic_msgs/msg/DiagnosticArray")()
    assert to_yaml(status, Look(no_arrays=True)).endswith(
        "status: '<sequence type: diagnostic_msgs/msg/DiagnosticStatus, length: 0>'\n"
    )
    joint = interfaces.message("sensor_msgs/msg/JointState")(name=["a", "b"], position=[1.0, 2.0])
    assert to_csv(joint, ALL) == "0,0,,a,b,1.0,2.0,,"
    assert to_yaml(joint.name, ALL) == "- a\n- b\n"
    assert pick(joint, "position[-1]") == 2.0
    with pytest.raises(CommandError, match=r"--field position\[2\]: there is no element \[2\]"):
        pick(joint, "position[2]")


def test_hex() -> None:
    assert hex_dump(b"", None) == ""
    assert hex_dump(b"ab\0", None) == f"00000000  {'61 62 00':<23}  {'':<23}  |ab.|\n"
    assert hex_dump(bytes(20), 16).endswith("|................|\n... 20 bytes in all\n")
