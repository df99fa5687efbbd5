"""Board classes: the bytes of host classes on CPython and on MicroPython, within a board's heap."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from muros import interfaces
from muros.cdr import CdrError, Fields
from muros.interfaces import InterfaceError, MessageBase, Registry, message
from muros.interfaces.board import constants_in, generate, sources, without_constants
from tests.interfaces.samples import DISTRO, NAMES, encode, sample
from tests.micropython.gauge import heap_cost, run_gauge
from tests.micropython.runtimes import require
from tests.micropython.tree import Tree, board_tree, compiled, write
from tests.micropython.unix import run_mpy

ODD = "int8 self\nint8 class\nfloat64[] array\nuint8[2] bytes\nint8[2] range\nN N\nN[2] two\nstring[2] pair\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """All standard messages as board packages, importable under their own names meanwhile."""
    folder = tmp_path_factory.mktemp("board")
    generate([*NAMES, "example_interfaces/srv/AddTwoInts", "micro_ros_msgs/msg/Graph"], folder)
    packages = {path.name for path in folder.iterdir()}
    hidden = {name: sys.modules.pop(name) for name in [*sys.modules] if name.partition(".")[0] in packages}
    sys.path.insert(0, str(folder))
    yield folder
    sys.path.remove(str(folder))
    for name in [*sys.modules]:
        if name.partition(".")[0] in packages:
            del sys.modules[name]
    sys.modules.update(hidden)


def board_class(folder: Path, name: str) -> Any:
    package, kind, type_name = name.split("/")
    module = importlib.import_module(f"{package}.{kind}")
    assert (module.__file__ or "").startswith(str(folder))
    return getattr(module, type_name)


def filled(board: Any, host: MessageBase) -> Any:
    """The board message with the values of a host message."""
    for name in host.__slots__:
        value = getattr(host, name)
        if isinstance(value, MessageBase):
            filled(getattr(board, name), value)
        elif isinstance(value, list) and value and isinstance(value[0], MessageBase):
            setattr(board, name, [filled(_blank(item), item) for item in value])
        else:
            setattr(board, name, bytes(value) if isinstance(value, memoryview) else value)
    return board


def _blank(host: MessageBase) -> Fields:
    made = Fields()
    for name in host.__slots__:
        value = getattr(host, name)
        setattr(made, name, _blank(value) if isinstance(value, MessageBase) else None)
    return made


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=4)
@given(seed=st.integers(0, 2**64))
def test_same_bytes_as_host_classes(folder: Path, name: str, seed: int) -> None:
    host = message(name, DISTRO).deserialize(encode(sample(name, Random(seed)), name), header=True)
    body = host.serialize()
    board = filled(board_class(folder, name)(), host)
    buffer = bytearray(b"\xaa" * (len(body) + 12))
    assert board.size() == len(body)
    assert board.write(buffer, 8) == 8 + len(body)
    assert bytes(buffer[8:-4]) == body
    again = board_class(folder, name)()
    again.read(buffer, 8, len(body))
    assert _written(again) == body
    assert _written(board_class(folder, name)()) == message(name, DISTRO)().serialize()


@settings(max_examples=300)
@given(name=st.sampled_from(NAMES), data=st.binary(max_size=120), off=st.integers(0, 9))
def test_foreign_bytes_give_a_message_or_one_exception(
    folder: Path, name: str, data: bytes, off: int
) -> None:
    board = board_class(folder, name)()
    host = message(name, DISTRO)
    try:
        board.read(bytearray(b"\xff" * off + data + b"\xff" * 40), off, len(data))
    except CdrError:
        with pytest.raises(CdrError):
            host.deserialize(data)
    else:
        assert _written(board) == host.deserialize(data).serialize()


def test_users_write_the_same_on_both_floors(folder: Path) -> None:
    for imu_class in (message("sensor_msgs/msg/Imu"), board_class(folder, "sensor_msgs/msg/Imu")):
        imu = imu_class()
        imu.header.frame_id = "base"
        imu.linear_acceleration.x = 1.0
        imu.orientation_covariance[8] = 0.5
        assert _written(imu)[-80:-72] == bytes(8)
        assert imu_class.TYPE == "sensor_msgs/msg/Imu"
        imu.read(_written(imu), 0, len(_written(imu)))
        assert (imu.header.frame_id, imu.linear_acceleration.x, imu.orientation_covariance[8]) == (
            "base",
            1.0,
            0.5,
        )
    text = board_class(folder, "std_msgs/msg/String")(data="ä")
    for data in ("b", b"b", bytearray(b"b")):
        text.data = data
        assert _written(text) == b"\2\0\0\0b\0"
    add = board_class(folder, "example_interfaces/srv/AddTwoInts")
    assert _written(add.Request(a=1, b=-1)) == bytes.fromhex("0100000000000000 ffffffffffffffff")
    assert add.TYPE == "example_interfaces/srv/AddTwoInts"
    assert add.Response.TYPE == "example_interfaces/srv/AddTwoInts_Response"
    vector = board_class(folder, "geometry_msgs/msg/Vector3")
    twist = board_class(folder, "geometry_msgs/msg/Twist")(linear=vector(x=2.0))
    assert _written(twist)[:8] == bytes.fromhex("0000000000000040")
    assert board_class(folder, "diagnostic_msgs/msg/DiagnosticStatus").ERROR == 2
    scan = board_class(folder, "sensor_msgs/msg/LaserScan")(ranges=[1.0], intensities=(2.0, 3.0))
    assert _written(scan)[-20:].hex() == "010000000000803f020000000000004000004040"


def test_wrong_values_are_refused(folder: Path) -> None:
    imu = board_class(folder, "sensor_msgs/msg/Imu")(orientation_covariance=[0.0])
    with pytest.raises(CdrError, match="1 elements, 9 needed"):
        _written(imu)
    entity = board_class(folder, "micro_ros_msgs/msg/Graph")()
    entity.nodes = [
        filled(_blank(host), host) for host in (message("micro_ros_msgs/msg/Node")(node_name="a" * 257),)
    ]
    with pytest.raises(CdrError, match="256 bytes, 257 needed"):
        entity.write(bytearray(999), 0)


def test_only_what_is_named_is_full(tmp_path: Path) -> None:
    files = sources(["std_msgs/Header"])
    assert sorted(path for path in files if "__init__" not in path) == [
        "builtin_interfaces/msg/_Time.py",
        "std_msgs/msg/_Header.py",
    ]
    assert "def write(" in files["std_msgs/msg/_Header.py"]
    assert "def write(" not in files["builtin_interfaces/msg/_Time.py"]
    generate(["builtin_interfaces/msg/Time"], tmp_path)
    written = generate(["std_msgs/msg/Header"], tmp_path)
    assert tmp_path / "builtin_interfaces/msg/_Time.py" in written
    assert "def write(" in (tmp_path / "builtin_interfaces/msg/_Time.py").read_text()


def test_long_lists_of_constants_stay_only_where_a_program_names_them() -> None:
    name = "sensor_msgs/msg/BatteryState"
    path = "sensor_msgs/msg/_BatteryState.py"
    assert "POWER_SUPPLY" not in sources([name])[path]
    kept = constants_in("if m.power_supply_status == BatteryState.POWER_SUPPLY_STATUS_FULL: stop()")
    text = sources([name, "sensor_msgs/NavSatStatus"], constants=kept)
    assert "    POWER_SUPPLY_STATUS_FULL = 4\n" in text[path]
    assert text[path].count("POWER_SUPPLY") == 1
    assert "STATUS_FIX" not in text["sensor_msgs/msg/_NavSatStatus.py"]
    assert "    STATUS_FIX = 0\n" in sources(["sensor_msgs/NavSatStatus"])["sensor_msgs/msg/_NavSatStatus.py"]
    assert without_constants(["std_msgs/Header", "diagnostic_msgs/DiagnosticArray"]) == {}
    assert without_constants([name, "lifecycle_msgs/srv/ChangeState"]) == {
        name: 23,
        "lifecycle_msgs/msg/Transition": 30,
    }


def test_what_occurs_often_is_written_once() -> None:
    event = sources(["rcl_interfaces/msg/ParameterEvent"])["rcl_interfaces/msg/_ParameterEvent.py"]
    for verb in ("new", "size", "write", "read"):
        assert event.count(f"def _{verb}_Parameter(") == 1
        assert event.count(f"_{verb}_Parameter(") == 4
    assert "\ndef " not in sources(["geometry_msgs/msg/Twist"])["geometry_msgs/msg/_Twist.py"]


def test_actions_come_with_their_services_when_asked() -> None:
    name = "example_interfaces/action/Fibonacci"
    plain, full = (sources([name], action_services=wanted) for wanted in (False, True))
    assert "SendGoal" not in plain["example_interfaces/action/_Fibonacci.py"]
    space: dict[str, Any] = {}
    exec(full["example_interfaces/action/_Fibonacci.py"], space)
    fibonacci = space["Fibonacci"]
    request = fibonacci.SendGoal.Request(goal=fibonacci.Goal(order=3))
    host = interfaces.action(name)
    assert _written(request) == host.SendGoal.Request(goal=host.Goal(order=3)).serialize()
    feedback = fibonacci.FeedbackMessage(feedback=fibonacci.Feedback(sequence=[1, 1]))
    assert _written(feedback) == host.FeedbackMessage(feedback=host.Feedback(sequence=[1, 1])).serialize()


def test_fields_may_hide_what_constructors_use(tmp_path: Path) -> None:
    (tmp_path / "odd_msgs/msg").mkdir(parents=True)
    (tmp_path / "odd_msgs/msg/A.msg").write_text(ODD)
    (tmp_path / "odd_msgs/msg/N.msg").write_text(
        'string text\nint8 TYPE=5\nfloat32[] f [0.5]\nstring s "x"\n'
    )
    (tmp_path / "odd_msgs/msg/W.msg").write_text("wstring[] w\n")
    registry = Registry()
    registry.add_path(tmp_path)
    space: dict[str, Any] = {}
    exec(sources(["odd_msgs/msg/A"], registry=registry)["odd_msgs/msg/_A.py"], space)
    odd = space["A"](self_=1, array=[0.5])
    odd.two[1].text = "x"
    body = _written(odd)
    again = space["A"]()
    again.read(body, 0, len(body))
    assert _written(again) == body
    assert (again.array[0], again.two[0].text, again.two[1].text, again.N.s) == (0.5, "", "x", "x")
    with pytest.raises(InterfaceError, match="wstring is not supported on boards"):
        sources(["odd_msgs/msg/W"], registry=registry)


# ---- on MicroPython ----

CASES = ("std_msgs/msg/Int32", "std_msgs/msg/String", "geometry_msgs/msg/Twist", "sensor_msgs/msg/Imu",
         "sensor_msgs/msg/JointState", "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2",
         "nav_msgs/msg/Odometry", "diagnostic_msgs/msg/DiagnosticArray", "rcl_interfaces/msg/ParameterEvent",
         "builtin_interfaces/msg/Time", "std_msgs/msg/Empty", "std_msgs/msg/Bool", "std_msgs/msg/Int64",
         "std_msgs/msg/UInt64", "sensor_msgs/msg/BatteryState", "unique_identifier_msgs/msg/UUID",
         "tf2_msgs/msg/TFMessage", "std_msgs/msg/Int16MultiArray", "example_interfaces/msg/Int8")  # fmt: skip

RELAY = """
import json
from binascii import hexlify, unhexlify
for name, body in json.loads(CASES):
    package, kind, type_name = name.split("/")
    made = getattr(__import__(package + "." + kind, None, None, (type_name,)), type_name)()
    body = bytearray(unhexlify(body))
    made.read(bytearray(5) + body + bytearray(b"\\xff" * 9), 5, len(body))
    back = bytearray(b"\\xaa" * (made.size() + 3))
    assert made.write(back, 3) == len(back), name
    assert back[3:] == body, (name, hexlify(back[3:]), hexlify(body))
    for n in range(0, len(body) - 4, 3):
        try:
            made.read(body, 0, n)
        except ValueError as error:
            assert type(error).__name__ == "CdrError", (name, n, error)
        else:
            assert False, (name, n)
print("done")
"""


@cache
def board_files() -> Tree:
    files = sources(CASES)
    return {
        **board_tree(["compat.py", "cdr.py", "cdr_texts.py", "cdr_lists.py", "cdr_rows.py"]),
        **{path: text.encode() for path, text in files.items()},
    }


def relay() -> str:
    bodies = []
    for name in CASES:
        for seed in range(4):
            host = (
                message(name).deserialize(encode(sample(name, Random(seed)), name), header=True)
                if (name in NAMES)
                else message(name)(seed - 2)
            )
            bodies.append((name, host.serialize().hex()))
    return f"CASES = {json.dumps(bodies)!r}\n{RELAY}"


def test_same_bytes_on_micropython_64_bit(tmp_path: Path) -> None:
    require("unix")
    assert run_mpy(relay(), library=[write(board_files(), tmp_path)]) == "done\n"


def test_same_bytes_on_micropython_32_bit() -> None:
    require("gauge")
    require("mpy-cross")
    (step,) = run_gauge(compiled(board_files()), relay())
    assert step.output == "done\n"


ALLOCATION = """
import gc, micropython
from std_msgs.msg import Int32, String
from sensor_msgs.msg import Imu
from geometry_msgs.msg import Twist
from builtin_interfaces.msg import Time
buf = bytearray(400)
imu = Imu()
imu.header.frame_id = "base_link"
imu.linear_acceleration.x = 1.5
made = (Int32(data=5), String(data=b"some bytes"), String(data="some text"), Twist(), Time(sec=7), imu)
def publish():
    for m in made:
        m.size()
        m.write(buf, 4)
number, time = Int32(), Time()
def receive():
    number.read(buf, 0, 4)
    time.read(buf, 0, 8)
    return number.data
publish()
Int32(data=-77).write(buf, 0)
receive()
gc.collect()
micropython.heap_lock()
publish()
value = receive()
micropython.heap_unlock()
print("done")
"""


def test_publishing_and_receiving_numbers_leaves_the_heap_alone(tmp_path: Path) -> None:
    require("unix")
    assert run_mpy(ALLOCATION, library=[write(board_files(), tmp_path)]) == "done\n"
    require("gauge")
    require("mpy-cross")
    assert run_gauge(compiled(board_files()), ALLOCATION)[0].output == "done\n"


def test_cdr_itself_is_small() -> None:
    require("gauge")
    require("mpy-cross")
    assert _least_cost("import muros.cdr", "import muros.compat\n") <= 1000
    assert _least_cost("import muros.cdr_texts", "import muros.cdr\n") <= 1500
    assert _least_cost("import muros.cdr_lists", "import muros.cdr_texts\n") <= 1300
    assert _least_cost("import muros.cdr_rows", "import muros.cdr_lists\n") <= 700


def _least_cost(imported: str, before: str) -> int:
    starts = ("\n".join(f"name_{n} = 0" for n in range(count)) for count in (0, 6, 12, 18, 24, 36, 50, 66))
    return min(heap_cost(compiled(board_files()), imported, before + start) for start in starts)


def _written(value: Any) -> bytes:
    buffer = bytearray(value.size())
    assert value.write(buffer, 0) == len(buffer)
    return bytes(buffer)


def test_shapes_are_there_when_asked_for() -> None:
    names = ["std_msgs/MultiArrayLayout", "std_msgs/Int32"]
    path = "std_msgs/msg/_MultiArrayLayout.py"
    assert 'SHAPE = "dim:[ label:s 4 4 ) 4"' in sources(names, shapes=True)[path]
    assert 'SHAPE = "4"' in sources(names, shapes=True)["std_msgs/msg/_Int32.py"]
    assert not any("SHAPE" in text for text in sources(names).values())
