"""ROS 1 message classes: recorded payloads, all standard types beside the converters, what programs see."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros import interfaces
from muros.cli import main
from muros.interfaces import InterfaceError, converter, ros1_name
from muros.rosserial import types
from muros.rosserial.messages import MessageError
from muros.rosserial.node_handle import parse
from tests.interfaces.samples import NAMES, encode, sample
from tests.rosserial_client.test_replay import compare

VECTORS = Path(__file__).parents[1] / "vectors/rosserial"
ROWS: list[dict[str, Any]] = json.loads((VECTORS / "payloads_ros1.json").read_text())["rows"]
SERVICES = ("std_srvs/SetBool", "std_srvs/Trigger", "rosserial_msgs/RequestParam")


def written(message: Any) -> bytes:
    """A message's ROS 1 bytes."""
    buf = bytearray(message.size() + 2)
    assert message.write(buf, 2) == len(buf)
    return bytes(buf[2:])


def halved(name: str) -> str:
    """``std_srvs/SetBoolRequest`` of a recording as muros writes it."""
    found = [f"{s}_{half}" for s in SERVICES for half in ("Request", "Response") if f"{s}{half}" == name]
    return found[0] if found else name


@pytest.mark.parametrize("row", ROWS, ids=[f"{i}-{row['type']}" for i, row in enumerate(ROWS)])
def test_recorded_payloads(row: dict[str, Any]) -> None:
    kind = types.message(halved(row["type"]))
    raw = bytes.fromhex(row["ros1_hex"])
    message = parse(kind, raw, 0, len(raw))
    assert written(message) == raw
    compare(message, row["value"])
    if not row["type"].endswith(("Request", "Response")):
        assert row["md5"] == kind.MD5


def test_every_common_type_beside_the_converter() -> None:
    random, done = Random(9), 0
    for name in NAMES:
        ros1 = ros1_name(name)
        try:
            convert = converter(ros1)
        except InterfaceError:
            continue
        raw = convert.to_ros1(encode(sample(name, random), name)[4:], seq=5)
        kind = types.message(ros1)
        message = parse(kind, raw, 0, len(raw))
        assert written(message) == raw, name
        assert convert.md5 == kind.MD5
        assert kind() == parse(kind, written(kind()), 0, kind().size())
        done += 1
    assert done > 100


@given(
    st.sampled_from(["sensor_msgs/JointState", "tf2_msgs/TFMessage", "std_msgs/Float64MultiArray"]),
    st.binary(),
)
def test_foreign_bytes_raise_one_exception(name: str, raw: bytes) -> None:
    kind = types.message(name)
    try:
        message = parse(kind, raw, 0, len(raw))
    except MessageError:
        return
    assert written(message) == raw


def test_constants_defaults_and_odd_names(tmp_path: Path) -> None:
    (tmp_path / "odd_msgs/msg").mkdir(parents=True)
    (tmp_path / "odd_msgs/msg/Odd.msg").write_text(
        "uint8 UP=1\nuint8[2] pair\nbool[3] flags\ntime[] when\nduration gap\nstring[2] names\nint32 size\n"
        "Header[2] heads\nEmpty e\n"
    )
    (tmp_path / "odd_msgs/msg/Empty.msg").write_text("std_msgs/Empty other\n")
    interfaces.add_path(tmp_path)
    odd = types.message("odd_msgs/Odd")
    assert odd.UP == 1
    message = odd(size_=7, when=[(1, 2)], gap=(-1, 5), names=["a", ""], flags=[True, False, True])
    assert parse(odd, written(message), 0, message.size()) == message
    assert "size_=7" in repr(message)
    assert message != odd()
    with pytest.raises(MessageError, match="3 elements, 2 needed"):
        written(odd(names=["a", "b", "c"]))
    files = types.write(["odd_msgs/Odd"], tmp_path)
    text = (tmp_path / "ros1/odd_msgs.py").read_text()
    assert "from ros1.std_msgs import Empty as std_msgs_Empty" in text
    assert len(files) == 3
    for file in files:
        compile(file.read_text(), str(file), "exec")


def test_unknown_types() -> None:
    with pytest.raises(InterfaceError, match="did you mean"):
        types.message("std_msgs/Strung")
    with pytest.raises(InterfaceError):
        types.service("std_srvs/SetBoole")
    assert types.service("std_srvs/SetBool") is types.service("std_srvs/SetBool")


def test_the_command_writes_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["interface", "generate", "--ros1", "std_msgs/msg/String", "std_srvs/SetBool", "std_msgs/Time"]
    assert main([*words, "-o", str(tmp_path)]) == 0
    printed = capsys.readouterr().out.split()
    assert [Path(name).name for name in printed] == ["__init__.py", "std_msgs.py", "std_srvs.py"]
    text = (tmp_path / "ros1/std_msgs.py").read_text()
    assert "class String(Message):" in text
    assert "class Time(Message):" in text
    assert main(["interface", "generate", "--ros1", "std_msgs/Strung", "-o", str(tmp_path)]) == 1
    assert "did you mean std_msgs/msg/String?" in capsys.readouterr().err
