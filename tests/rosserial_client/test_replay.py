"""Our board beside the recorded ones: the same bytes, in the same order, at the same time."""

from __future__ import annotations

from typing import Any

import pytest

from muros.interfaces._model import attribute
from muros.rosserial import types
from muros.rosserial.device import Device
from muros.rosserial.node_handle import parse
from muros.rosserial.packets import ANY_VERSION, VERSION_GROOVY, VERSION_HYDRO
from tests.rosserial_client.replay import Player, Raw, opened, recording


@pytest.mark.parametrize(
    ("name", "frames"),
    [
        ("session_full_python_pty", 46),
        ("session_full_python_tcp", 46),
        ("session_full_python_hydro_client", 43),
        ("session_full_cpp_pty", 55),
        ("board_reset", 16),
        ("board_reset_cpp", 16),
        ("lost_sync_cut_20s", 17),
        ("refused_topics", 20),
        ("types_all_echo", 79),
    ],
)
def test_sessions(name: str, frames: int) -> None:
    player = Player(recording(name))
    assert player.play() >= frames
    assert player.device.malformed == player.device.unknown_ids == 0
    assert player.device.decoder.garbage == 0


def test_all_types_are_read_as_the_host_meant_them() -> None:
    record = recording("types_all_echo")
    player = Player(record)
    player.play()
    assert len(player.heard) == len(record["values"])
    for (name, message), wanted in zip(player.heard, record["values"], strict=True):
        assert wanted["topic"] == f"h/{name}"
        compare(message, wanted["value"])


def compare(message: Any, wanted: dict[str, Any]) -> None:
    """Holds that a message has the fields of a recorded value."""
    for field, value in wanted.items():
        have = getattr(message, attribute(field))
        if isinstance(value, dict) and set(value) == {"secs", "nsecs"}:
            assert have == (value["secs"], value["nsecs"])
        elif isinstance(value, dict):
            compare(have, value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for one, other in zip(have, value, strict=True):
                compare(one, other)
        elif isinstance(value, float | int) and not isinstance(value, bool):
            if field != "seq":  # the publisher of ROS 1 counts
                assert have == pytest.approx(value, rel=1e-6, nan_ok=True)
        elif isinstance(value, list) and value and isinstance(value[0], float):
            assert list(have) == pytest.approx(value, rel=1e-6, nan_ok=True)
        else:
            assert (list(have) if isinstance(value, list) else have) == value


@pytest.mark.parametrize(("name", "frames"), [("faults_python_pty", 39), ("faults_cpp_pty", 25)])
def test_sessions_with_damage_on_the_line(name: str, frames: int) -> None:
    """What was put on the line by hand is left out: the board beside it goes on as recorded."""
    record = recording(name)
    by_hand = {
        number
        for number, frame in enumerate(record["frames"])
        if frame["dir"] == "b2h" and (frame["kind"] != "frame" or unknown(frame))
    }
    player = Player(record, ignored=frozenset(by_hand))
    assert player.play() >= frames


def unknown(frame: dict[str, Any]) -> bool:
    """Whether a board of ours would never send it: unknown ids, a Groovy frame, payloads cut short."""
    raw = bytes.fromhex(frame["hex"])
    topic_id, payload = opened(raw)
    cut = (topic_id < 6 and len(payload) < 40) or (topic_id == 10 and len(payload) != 8)
    return raw[1] == VERSION_GROOVY or topic_id in (199, 65535) or cut


def test_doubles_reach_the_board_whole() -> None:
    record = recording("types_float64_avr")
    heard: list[float] = []
    player = Player(record, ignored=frozenset(n for n, f in enumerate(record["frames"]) if topic(f) == 126))
    player._take = lambda endpoint, info, buf, off, n: heard.append(  # type: ignore[method-assign]
        parse(types.message("std_msgs/Float64"), buf, off, n).data
    )
    player.reset()
    player.play()
    assert heard == [float(trip["sent"]) for trip in record["round_trips"]]


def topic(frame: dict[str, Any]) -> int:
    """The topic id of a recorded frame."""
    return opened(bytes.fromhex(frame["hex"]))[0]


def test_requests_of_both_versions_at_once() -> None:
    """ros_lib understands neither (three time requests are recorded); a board of ours answers its own."""
    record = recording("hydro_client_ff_then_fe_at_once")
    assert not record["second_request_understood"]
    raw = b"".join(bytes.fromhex(frame["hex"]) for frame in record["frames"] if frame["dir"] == "h2b")
    for version in (VERSION_HYDRO, ANY_VERSION):
        device = Device(lambda buf, off, n: None, version=version)
        device.feed(raw, len(raw), 0)
        assert device.connected


def test_groovy_session_whichever_version_is_set() -> None:
    for version in (VERSION_GROOVY, ANY_VERSION):
        assert Player(recording("groovy_client_ff_request"), version).play() == 9


def test_a_groovy_board_does_not_answer_a_hydro_host() -> None:
    player = Player(recording("groovy_client_hydro_server"), VERSION_GROOVY)
    player.play()
    assert not player.device.connected
    assert player.device.decoder.frames == 0


def test_a_hydro_board_is_asked_in_the_wrong_version_first() -> None:
    assert Player(recording("hydro_client_ff_request")).play() == 8


def test_one_burst_reaches_boards_of_any_version() -> None:
    burst = bytes.fromhex("fffe0000ff0000ff00ffff00000000ff00")
    rows = [row for row in recording("probe_both_versions")["rows"] if row["sequence"] == "FE+00+FF"]
    assert len(rows) >= 3
    for version in (VERSION_HYDRO, VERSION_GROOVY, ANY_VERSION):
        sent: list[int] = []
        device = Device(lambda buf, off, n, sent=sent: sent.append(n), version=version)  # type: ignore[misc]
        device.feed(burst, len(burst), 0)
        assert device.connected
        assert sent


@pytest.mark.parametrize("name", ["oversize_python", "oversize_cpp"])
def test_what_is_too_large(name: str) -> None:
    """A message beyond the buffer is not sent, and none of the host's harms the board."""
    record = recording(name)
    frames = record["frames"]
    oversize = {
        number
        for number, frame in enumerate(frames)
        if frame["dir"] == "h2b" and len(frame["hex"]) // 2 > 280 + 8
    }
    player = Player(record, ignored=frozenset(echoes(frames, oversize)))
    assert player.play() > 10
    assert player.device.too_large >= 1
    for number in oversize:
        raw = bytes.fromhex(frames[number]["hex"])
        before = player.device.decoder.frames
        player.device.feed(raw, len(raw), player.now)
        assert player.device.decoder.frames == before
        assert player.device.decoder.too_long >= 1
    player.sent.clear()
    request = bytes.fromhex("fffe0000ff0000ff")
    player.device.feed(request, 8, player.now)
    assert len(player.sent) == 7  # and it hears what comes behind


def echoes(frames: list[dict[str, Any]], oversize: set[int]) -> set[int]:
    """The frames of ``oversize`` and what a board that took them sent back."""
    payloads = [opened(bytes.fromhex(frames[number]["hex"]))[1] for number in oversize]
    same = {
        number
        for number, frame in enumerate(frames)
        if frame["kind"] == "frame" and opened(bytes.fromhex(frame["hex"]))[1] in payloads
    }
    return oversize | same


@pytest.mark.parametrize("row", recording("param_answer_kinds")["rows"], ids=str)
def test_answers_to_parameters(row: dict[str, Any]) -> None:
    device = Device(lambda buf, off, n: None)
    raw = bytes.fromhex(row["answer_hex"])
    device.request_parameter(b"p")
    device.feed(raw, len(raw), 0)
    values = device.values
    assert values is not None
    assert (values.ints, values.floats) == (row["ints"], row["floats"])
    assert [text.decode() for text in values.strings] == row["strings"]


def test_frames_that_ros_lib_loses_on_slow_lines_are_heard() -> None:
    """ros_lib drops what takes longer than 20 ms; a board of ours has no such limit."""
    row = max(recording("slow_line_20ms")["rows"], key=lambda row: row["payload"])
    heard: list[int] = []
    device = Device(lambda buf, off, n: None, input_size=4096)
    device.subscriber("s", "std_msgs/String", "", lambda buf, off, n: heard.append(n))
    other = Device(lambda buf, off, n: None, output_size=8192, max_subscribers=0)
    other.publisher("s", "std_msgs/String", "")
    line: list[bytes] = []
    other._send = lambda buf, off, n: line.append(bytes(buf[off : off + n]))
    other.connected = True
    assert other.publish(100, Raw(bytes(row["payload"]))) > 0
    now = 0
    for byte in line[0]:
        now += 2
        device.feed(bytes((byte,)), 1, now)
        device.tick(now)
    assert heard == [row["payload"]]


def test_float64_of_avr_boards_is_ordinary() -> None:
    """What AVR boards make of a double by hand is read as the double it stands for."""
    for row in recording("avr_float64")["serialize"]:
        if row["exact"]:
            raw = bytes.fromhex(row["wire"])
            message = types.message("std_msgs/Float64")()
            message.read(raw, 0, 8)
            single = types.message("std_msgs/Float32")()
            single.read(bytes.fromhex(row["float_bits"])[::-1], 0, 4)
            assert message.data == pytest.approx(single.data, rel=0, abs=0, nan_ok=True)
