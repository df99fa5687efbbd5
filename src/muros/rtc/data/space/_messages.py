"""Which ROS message carries which RTC data type, and how: a table.

Values are walked by the names of their members; no IDL is needed. Where a message has a header, its stamp is the
value's `tm`; where it has none, a value that comes has a `tm` of zero (see `timestamp_policy`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final, NamedTuple

from muros import interfaces
from muros.rtc.data._types import AnyDataType, DataError, type_label

__all__ = ["TYPES", "Row", "codec_of", "default_message"]

Fill = Callable[[Any, Any], None]
"""Fills the second object from the first."""


class Form(NamedTuple):
    """How a value and a message become each other."""

    to_message: Fill
    to_value: Fill


@dataclass(frozen=True, slots=True)
class Row:
    """One message type that carries a data type."""

    message: str
    """`std_msgs/Int32`"""
    form: Form


class _Leaf(NamedTuple):
    """What becomes of a member that is no structure."""

    to_message: Callable[[Any], Any] = lambda value: value
    to_value: Callable[[Any], Any] = lambda value: value


PLAIN: Final = _Leaf()
LIST: Final = _Leaf(list, list)
OCTETS: Final = _Leaf(bytes, bytes)
CHAR: Final = _Leaf(ord, chr)
CHARS: Final = _Leaf(lambda text: text.encode("latin-1"), lambda data: bytes(data).decode("latin-1"))
SHORT_RANGE: Final = 0xFFFF
"""Pixels of a camera image's width and height at most: they are unsigned shorts."""


def members(*pairs: str, leaf: _Leaf = PLAIN) -> Form:
    """Members by their paths: `"data.vx linear.x"` says that the value's one is the message's other."""
    paths = [(inside, outside) for inside, outside in map(str.split, pairs)]
    to_message = [_mover(inside, outside, leaf.to_message) for inside, outside in paths]
    to_value = [_mover(outside, inside, leaf.to_value) for inside, outside in paths]
    return Form(_all(to_message), _all(to_value))


def joined(*forms: Form) -> Form:
    """One after the other."""
    return Form(_all([form.to_message for form in forms]), _all([form.to_value for form in forms]))


def within(value_path: str, message_path: str, form: Form) -> Form:
    """A form of members further down."""
    value_part = attrgetter(value_path) if value_path else _itself
    message_part = attrgetter(message_path) if message_path else _itself
    return Form(
        lambda value, message: form.to_message(value_part(value), message_part(message)),
        lambda message, value: form.to_value(message_part(message), value_part(value)),
    )


def _mover(source: str, target: str, convert: Callable[[Any], Any]) -> Fill:
    read = attrgetter(source)
    path, _, name = target.rpartition(".")
    holder = attrgetter(path) if path else _itself

    def move(giver: Any, taker: Any) -> None:
        setattr(holder(taker), name, convert(read(giver)))

    return move


def _all(fills: Iterable[Fill]) -> Fill:
    steps = tuple(fills)

    def fill(giver: Any, taker: Any) -> None:
        for step in steps:
            step(giver, taker)

    return fill


def _itself(value: Any) -> Any:
    return value


# ---- what is more than moving


def _rpy_to_quaternion(angles: Any, q: Any) -> None:
    """Roll, pitch, yaw about the fixed axes x, y, z."""
    sr, cr = math.sin(angles.r / 2), math.cos(angles.r / 2)
    sp, cp = math.sin(angles.p / 2), math.cos(angles.p / 2)
    sy, cy = math.sin(angles.y / 2), math.cos(angles.y / 2)
    q.x = sr * cp * cy - cr * sp * sy
    q.y = cr * sp * cy + sr * cp * sy
    q.z = cr * cp * sy - sr * sp * cy
    q.w = cr * cp * cy + sr * sp * sy


def _quaternion_to_rpy(q: Any, angles: Any) -> None:
    angles.r = math.atan2(2 * (q.w * q.x + q.y * q.z), 1 - 2 * (q.x * q.x + q.y * q.y))
    angles.p = math.asin(max(-1.0, min(1.0, 2 * (q.w * q.y - q.z * q.x))))
    angles.y = _yaw(q)


def _yaw(q: Any) -> float:
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))


def _heading_to_quaternion(pose: Any, message: Any) -> None:
    q = message.orientation
    q.x = q.y = 0.0
    q.z, q.w = math.sin(pose.heading / 2), math.cos(pose.heading / 2)


def _quaternion_to_heading(message: Any, pose: Any) -> None:
    pose.heading = _yaw(message.orientation)


ENCODINGS: Final = {"mono8": 8, "mono16": 16, "rgb8": 24, "bgr8": 24, "rgba8": 32, "bgra8": 32, "yuv422": 16}
"""Bits of a pixel by the encoding's name."""

BY_BITS: Final = {8: "mono8", 16: "mono16", 24: "bgr8", 32: "bgra8"}
"""The encoding of an image whose `format` names none."""


def _image_to_message(image: Any, message: Any) -> None:
    name = image.format.strip().lower()
    encoding = name if name in ENCODINGS else BY_BITS.get(image.bpp)
    if encoding is None:
        raise DataError(
            f"CameraImage: {image.bpp} bits a pixel in format {image.format!r} are no ROS encoding; "
            f"set format to one of {', '.join(ENCODINGS)}"
        )
    message.width, message.height, message.encoding = image.width, image.height, encoding
    message.step = image.width * ENCODINGS[encoding] // 8
    message.is_bigendian = 0
    message.data = bytes(image.pixels)


def _message_to_image(message: Any, image: Any) -> None:
    if max(message.width, message.height) > SHORT_RANGE:
        raise DataError(f"CameraImage: {message.width} x {message.height} pixels are too many for it")
    image.width, image.height, image.format = message.width, message.height, message.encoding
    image.bpp = ENCODINGS.get(message.encoding, 8 * message.step // max(1, message.width))
    image.fDiv = 0.0
    image.pixels = bytes(message.data)


def _scan_to_message(scan: Any, message: Any) -> None:
    message.ranges = list(scan.ranges)
    message.scan_time = 1.0 / scan.config.frequency if scan.config.frequency > 0 else 0.0


def _message_to_scan(message: Any, scan: Any) -> None:
    scan.ranges = list(message.ranges)
    scan.config.frequency = 1.0 / message.scan_time if message.scan_time > 0 else 0.0


# ---- the table

RPY: Final = Form(_rpy_to_quaternion, _quaternion_to_rpy)
XYZ: Final = members("x x", "y y", "z z")
XYZW: Final = members("x x", "y y", "z z", "w w")
POSE_2D: Final = joined(
    members("position.x position.x", "position.y position.y"),
    Form(_heading_to_quaternion, _quaternion_to_heading),
)
POSE_3D: Final = joined(within("position", "position", XYZ), within("orientation", "orientation", RPY))
VELOCITY_2D: Final = members("vx linear.x", "vy linear.y", "va angular.z")
VELOCITY_3D: Final = joined(
    members("vx linear.x", "vy linear.y", "vz linear.z"),
    members("vr angular.x", "vp angular.y", "va angular.z"),
)
DATA: Final = members("data data")

INTEGERS: Final = ("Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32", "UInt64")
FLOATS: Final = ("Float32", "Float64")


def _std(default: str, others: Iterable[str] = (), form: Form = DATA, suffix: str = "") -> tuple[Row, ...]:
    names = dict.fromkeys((default, *others))
    return tuple(Row(f"std_msgs/{name}{suffix}", form) for name in names)


def _list(default: str, others: Iterable[str] = (), leaf: _Leaf = LIST) -> tuple[Row, ...]:
    return _std(default, others, members("data data", leaf=leaf), "MultiArray")


def _geometry(form: Form, *places: str) -> tuple[Row, ...]:
    """Rows for messages of geometry_msgs, each with the path to what the form fills: `"PoseStamped pose"`."""
    return tuple(
        Row(f"geometry_msgs/{name}", within("data", path, form))
        for name, _, path in (place.partition(" ") for place in places)
    )


TYPES: Final[dict[str, tuple[Row, ...]]] = {
    "TimedState": _std("Int16", INTEGERS),
    "TimedShort": _std("Int16", INTEGERS),
    "TimedLong": _std("Int32", INTEGERS),
    "TimedUShort": _std("UInt16", INTEGERS),
    "TimedULong": _std("UInt32", INTEGERS),
    "TimedFloat": _std("Float32", FLOATS),
    "TimedDouble": _std("Float64", FLOATS),
    "TimedOctet": _std("UInt8", ("Byte",)),
    "TimedChar": _std("UInt8", ("Char",), members("data data", leaf=CHAR)),
    "TimedBoolean": _std("Bool"),
    "TimedString": _std("String"),
    "TimedWString": _std("String"),
    "TimedShortSeq": _list("Int16", INTEGERS),
    "TimedLongSeq": _list("Int32", INTEGERS),
    "TimedUShortSeq": _list("UInt16", INTEGERS),
    "TimedULongSeq": _list("UInt32", INTEGERS),
    "TimedFloatSeq": _list("Float32", FLOATS),
    "TimedDoubleSeq": _list("Float64", FLOATS),
    "TimedOctetSeq": _list("UInt8", ("Byte",), OCTETS),
    "TimedCharSeq": _list("UInt8", (), CHARS),
    "TimedPoint2D": _geometry(members("x x", "y y"), "PointStamped point", "Point"),
    "TimedPoint3D": _geometry(XYZ, "PointStamped point", "Point", "Vector3"),
    "TimedVector2D": _geometry(members("x x", "y y"), "Vector3Stamped vector", "Vector3"),
    "TimedVector3D": _geometry(XYZ, "Vector3Stamped vector", "Vector3", "Point"),
    "TimedQuaternion": _geometry(XYZW, "QuaternionStamped quaternion", "Quaternion"),
    "TimedOrientation3D": _geometry(RPY, "QuaternionStamped quaternion", "Quaternion"),
    "TimedPose2D": _geometry(POSE_2D, "PoseStamped pose", "Pose"),
    "TimedPose3D": _geometry(POSE_3D, "PoseStamped pose", "Pose"),
    "TimedVelocity2D": _geometry(VELOCITY_2D, "Twist", "TwistStamped twist"),
    "TimedVelocity3D": _geometry(VELOCITY_3D, "Twist", "TwistStamped twist"),
    "TimedAcceleration2D": _geometry(members("ax linear.x", "ay linear.y"), "Accel", "AccelStamped accel"),
    "TimedAcceleration3D": _geometry(
        members("ax linear.x", "ay linear.y", "az linear.z"), "Accel", "AccelStamped accel"
    ),
    "TimedAngularVelocity3D": _geometry(
        members("avx x", "avy y", "avz z"), "Vector3Stamped vector", "Vector3"
    ),
    "TimedRGBColour": (Row("std_msgs/ColorRGBA", within("data", "", members("r r", "g g", "b b"))),),
    "Velocity2D": (Row("geometry_msgs/Twist", VELOCITY_2D),),
    "Velocity3D": (Row("geometry_msgs/Twist", VELOCITY_3D),),
    "CameraImage": (Row("sensor_msgs/Image", Form(_image_to_message, _message_to_image)),),
    "RangeData": (
        Row(
            "sensor_msgs/LaserScan",
            joined(
                members("config.minAngle angle_min", "config.maxAngle angle_max"),
                members("config.angularRes angle_increment"),
                members("config.minRange range_min", "config.maxRange range_max"),
                Form(_scan_to_message, _message_to_scan),
            ),
        ),
    ),
}
"""Message types by data type, the default first."""


def default_message(repository_id: str) -> str:
    """The message type that carries a data type unless a connection says otherwise, "" if there is none."""
    rows = TYPES.get(_name_of(repository_id), ())
    return rows[0].message if rows else ""


def codec_of(data_type: AnyDataType, message: str, frame_id: str = "") -> AnyDataType | None:
    """What makes octets of a `message` of the data type's values, None if such a message cannot carry them."""
    wanted = message.replace("/msg/", "/")
    for row in TYPES.get(_name_of(data_type.repository_id), ()):
        if row.message == wanted:
            return _MessageCodec(data_type, row, frame_id)
    return None


def _name_of(repository_id: str) -> str:
    return type_label(repository_id).removeprefix("RTC/")


class _MessageCodec:
    """A data type whose wire form is a ROS message, with its encapsulation header."""

    def __init__(self, data_type: AnyDataType, row: Row, frame_id: str) -> None:
        self._data_type = data_type
        self._form = row.form
        self._message: type[Any] = interfaces.message(row.message)
        self._frame_id = frame_id
        self.repository_id = data_type.repository_id
        self.python_class = data_type.python_class
        self.message_type: str = self._message.TYPE
        """`std_msgs/msg/Int32`"""

    def default(self) -> Any:
        return self._data_type.default()

    def encode(self, value: Any, little: bool) -> bytes:
        message = self._message()
        try:
            self._form.to_message(value, message)
            header, tm = getattr(message, "header", None), getattr(value, "tm", None)
            if header is not None:
                header.frame_id = self._frame_id
                if tm is not None:
                    header.stamp.sec, header.stamp.nanosec = tm.sec, tm.nsec
            octets: bytes = message.serialize(big_endian=not little, header=True)
        except (interfaces.CdrError, AttributeError, TypeError, ValueError) as error:
            raise DataError(f"{self.repository_id} as {self.message_type}: {error}") from None
        return octets

    def decode(self, octets: bytes, little: bool) -> Any:
        value = self._data_type.default()
        try:
            message = self._message.deserialize(octets, header=True)
            self._form.to_value(message, value)
            header, tm = getattr(message, "header", None), getattr(value, "tm", None)
            if header is not None and tm is not None:
                tm.sec, tm.nsec = header.stamp.sec & 0xFFFFFFFF, header.stamp.nanosec
        except (interfaces.CdrError, AttributeError, TypeError, ValueError, ZeroDivisionError) as error:
            raise DataError(f"{self.message_type} as {self.repository_id}: {error}") from None
        return value
