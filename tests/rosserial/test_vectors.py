"""Recorded sessions of real boards, played to the server in virtual time, in both directions.

What the board sent goes in at the recorded time; what it published has to come out in the graph. What the recorded host
sent on the board's topics is published, called or answered in the graph, and the server has to send the same bytes.
Besides that, whatever the recordings hold: every request for the time and for a parameter is answered at once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from muros import interfaces
from muros.interfaces import Converter
from muros.rosserial.constants import ID_FIRST_TOPIC, ID_LOG, ID_PARAMETER_REQUEST, ID_PUBLISHER, ID_TIME
from muros.rosserial.messages import (
    MessageError,
    TopicInfo,
    log_untrusted,
    parameter_request_untrusted,
    time_untrusted,
    topic_info_untrusted,
    values_untrusted,
)
from muros.rosserial.packets import ANY_VERSION, VERSION_HYDRO, Decoder, finish, frame, head_size
from muros.rosserial.server import BoardLog
from muros.space import Qos, Topic
from tests.rosserial.scene import VECTORS, Scene, vector

SESSIONS = (
    "session_full_python_pty",
    "session_full_python_tcp",
    "session_full_cpp_pty",
    "session_full_python_hydro_client",
    "types_all_echo",
    "types_float64_avr",
    "faults_python_pty",
    "faults_cpp_pty",
    "lost_sync_cut_20s",
    "board_reset",
    "board_reset_cpp",
    "refused_topics",
    "oversize_python",
    "oversize_cpp",
    "groovy_client_ff_request",
    "groovy_client_hydro_server",
    "hydro_client_ff_request",
    "hydro_client_ff_then_fe_at_once",
)
PARAMETERS = {
    "conf.i": 42,
    "conf.neg": -7,
    "conf.f": 0.5,
    "conf.s": "text",
    "conf.b": True,
    "conf.il": [1, 2, 3],
    "conf.fl": [0.5, 1.5],
    "conf.sl": ["a", "bc"],
}
NOT_DELIVERED = {"b/bad", "b/unk"}
"""Topics of the recordings that are refused: a wrong sum, an unknown type."""


def frames_in(data: bytes) -> list[tuple[int, bytes]]:
    """The topic ids and payloads of all frames in some bytes, of either version."""
    found: list[tuple[int, bytes]] = []
    decoder = Decoder(
        65535, lambda at, buf, off, n: found.append((at, bytes(buf[off : off + n]))), ANY_VERSION
    )
    decoder.feed(data, len(data), 0)
    decoder.tick(10_000)
    return found


class Replay:
    """A recording at work. ``sent`` are the frames of the server, ``expected`` those it has to send on topics."""

    def __init__(self, name: str, piece: int = 0) -> None:
        self.record = vector(name)
        self.piece = piece
        self.scene = Scene(PARAMETERS)
        self.infos: dict[tuple[bool, int], tuple[int, TopicInfo]] = {}
        self.published: dict[str, list[bytes]] = {}
        self.expected: list[tuple[int, bytes]] = []
        self.sent: list[tuple[int, bytes]] = []
        self.heard: dict[str, list[bytes]] = {}
        self.logs: list[tuple[int, str]] = []
        self._writers: dict[str, Any] = {}
        self._callers: dict[str, Any] = {}
        self._answers: dict[str, list[bytes]] = {}
        versions = [
            bytes.fromhex(each["hex"])[1] for each in self.record["frames"] if each["kind"] == "frame"
        ]
        self.version = max(versions, key=versions.count)
        self._learn()

    def run(self) -> None:
        """Plays it."""
        scene, frames = self.scene, self.record["frames"]
        begin = min(each["t_ms"] for each in frames)
        scene.port.up("a", scene.now)
        start = scene.now
        self._prepare()
        for each in frames:
            due = start + int(each["t_ms"] - begin)
            if due > scene.now:
                scene.step(due - scene.now)
            data = bytes.fromhex(each["hex"])
            before = len(scene.link.sent)
            if each["dir"] == "b2h":
                for i in range(0, len(data), self.piece or len(data)):
                    scene.port.receive(data[i : i + (self.piece or len(data))], "a", scene.now)
                self._at_once(each, data, before)
            elif each["kind"] == "frame":
                self._host(data)
        scene.step(500)
        for data in scene.link.sent:
            self.sent += frames_in(data)

    def _learn(self) -> None:
        """What the board will name, and the answers that the host will give."""
        for each in self.record["frames"]:
            if each["kind"] != "frame":
                continue
            for topic_id, body in frames_in(bytes.fromhex(each["hex"])):
                out = each["dir"] == "b2h"
                if out and topic_id <= 5:
                    try:
                        info = topic_info_untrusted(body, 0, len(body))
                    except MessageError:
                        continue
                    self.infos.setdefault((topic_id in (0, 2, 4), info.topic_id), (topic_id, info))
                elif out and topic_id == ID_LOG:
                    level, text = log_untrusted(body, 0, len(body))
                    self.logs.append((level, text.decode()))
                elif out and self._of(True, topic_id) and self.infos[True, topic_id][0] == 0:
                    self.published.setdefault(self.infos[True, topic_id][1].topic_name, []).append(body)
                elif not out and self._of(False, topic_id) and self.infos[False, topic_id][0] == 5:
                    self._answers.setdefault(self.infos[False, topic_id][1].topic_name, []).append(body)

    def _of(self, out: bool, topic_id: int) -> bool:
        return (out, topic_id) in self.infos

    def _prepare(self) -> None:
        """Everybody in the graph whom the recorded board meets."""
        other = self.scene.other
        for (out, _), (half, info) in self.infos.items():
            name = "/" + info.topic_name
            if half in (0, 1) and info.topic_name in NOT_DELIVERED:
                continue
            if half in (0, 1):
                converter = interfaces.converter(info.message_type)
                topic = Topic(interfaces.dds_topic(name), interfaces.dds_type_name(converter.ros2_type))
                if out:
                    heard = self.heard.setdefault(info.topic_name, [])
                    self._read(other.reader(topic, Qos(depth=1000), None), converter, heard)
                else:
                    self._writers[info.topic_name] = (other.writer(topic, Qos(depth=1000)), converter)
            elif half == 3:
                kinds = interfaces.service_converter(info.message_type)
                requester = other.requester(
                    self.scene.service(name, kinds.ros2_type), None, lambda n, data: None
                )
                self._callers[info.topic_name] = (requester, kinds.request)
            elif half == 5:
                self._serve(info)

    def _read(self, reader: Any, converter: Converter, heard: list[bytes]) -> None:
        def take() -> None:
            while (sample := reader.take()) is not None:
                heard.append(converter.to_ros1(sample.data))

        previous = self.scene.step

        def step(ms: int = 1) -> None:
            previous(ms)
            take()

        self.scene.step = step  # type: ignore[method-assign]

    def _serve(self, info: TopicInfo) -> None:
        kinds = interfaces.service_converter(info.message_type)
        answers = iter(self._answers.get(info.topic_name, []))

        def answer(identity: bytes, data: bytes) -> None:
            body = next(answers, None)
            if body is not None:
                replier.reply(identity, kinds.response.to_cdr(body))
                self.expected.append((info.topic_id, body))

        replier = self.scene.other.replier(
            self.scene.service("/" + info.topic_name, kinds.ros2_type), None, answer
        )

    def _host(self, data: bytes) -> None:
        """What the recorded host sent is wanted by somebody in the graph."""
        for topic_id, body in frames_in(data):
            if topic_id < ID_FIRST_TOPIC or not self._of(False, topic_id):
                continue
            half, info = self.infos[False, topic_id]
            if half == 1:
                writer, converter = self._writers[info.topic_name]
                writer.write(converter.to_cdr(body))
            elif half == 3:
                requester, converter = self._callers[info.topic_name]
                requester.send(converter.to_cdr(body))
            else:
                continue
            if len(body) <= info.buffer_size:
                self.expected.append((topic_id, body))
            self.scene.step()

    def _at_once(self, each: dict[str, Any], data: bytes, before: int) -> None:
        """What must be answered before any time passes."""
        if each["kind"] != "frame" or data[1] != self.version:
            return  # a frame of the other version is noise
        answers = [found for sent in self.scene.link.sent[before:] for found in frames_in(sent)]
        for topic_id, body in frames_in(data):
            if topic_id == ID_TIME:
                stamps = [time_untrusted(a, 0, len(a)) for at, a in answers if at == ID_TIME]
                assert stamps == [divmod(self.scene.wall(), 10**9)]
            elif topic_id == ID_PARAMETER_REQUEST:
                name = parameter_request_untrusted(body, 0, len(body)).strip("/").replace("/", ".")
                (values,) = [
                    values_untrusted(a, 0, len(a)) for at, a in answers if at == ID_PARAMETER_REQUEST
                ]
                wanted = PARAMETERS.get(name, [])
                items = wanted if isinstance(wanted, list) else [wanted]
                texts = [text.decode() for text in values.strings]
                assert items in (values.ints, values.floats, texts) or (not items and not values.size() > 12)


def without_seq(name: str, infos: dict[tuple[bool, int], tuple[int, TopicInfo]], body: bytes) -> bytes:
    """A body as it comes back from the graph: headers there have no sequence numbers."""
    for half, info in infos.values():
        if half in (0, 1) and info.topic_name == name:
            converter = interfaces.converter(info.message_type)
            return converter.to_ros1(converter.to_cdr(body))
    raise KeyError(name)


@pytest.mark.parametrize("piece", [0, 1, 7])
@pytest.mark.parametrize("name", SESSIONS)
def test_sessions(name: str, piece: int) -> None:
    replay = Replay(name, piece)
    replay.run()
    for topic, bodies in replay.published.items():
        if topic in NOT_DELIVERED:
            continue
        expected = []
        for body in bodies:
            try:
                expected.append(without_seq(topic, replay.infos, body))
            except interfaces.CdrError:
                continue  # "string whose inner length is too big": no message
        heard = replay.heard[topic]
        if name.startswith(
            "faults"
        ):  # the recording's own reader took a string for the rest of a damaged frame
            heard = [body for body in heard if body in expected]
        assert heard == expected, topic
    topics = {info.topic_id: info.topic_name for (out, _), (half, info) in replay.infos.items() if half == 1}
    sent = [(at, body) for at, body in replay.sent if at >= ID_FIRST_TOPIC]
    plain = [(at, without_seq(topics[at], replay.infos, body) if at in topics else body) for at, body in sent]
    wanted = [
        (at, without_seq(topics[at], replay.infos, body) if at in topics else body)
        for at, body in replay.expected
    ]
    assert plain == wanted
    told = [(event.level, event.message) for event in replay.scene.said(BoardLog)]
    assert told == replay.logs


def test_every_recorded_session_is_played() -> None:
    recorded = {path.stem for path in VECTORS.glob("*.json") if "frames" in vector(path.stem)}
    assert recorded == set(SESSIONS)


@pytest.mark.parametrize("name", ["faults_python_pty", "faults_cpp_pty"])
def test_after_every_recorded_fault_no_string_is_lost(name: str) -> None:
    """The real servers lost up to two of them; see ``strings_lost_before_recovery`` in the recordings."""
    replay = Replay(name)
    replay.run()
    heard = b"\n".join(replay.heard["b/str"])
    for fault in replay.record["faults"]:
        assert f"{fault['fault']} #0".encode() in heard


def frames_of(name: str) -> Iterator[tuple[str, bytes]]:
    for each in vector(name)["frames"]:
        if each["kind"] == "frame":
            yield each["dir"], bytes.fromhex(each["hex"])


@pytest.mark.parametrize("name", SESSIONS)
def test_every_recorded_frame_is_made_again_byte_for_byte(name: str) -> None:
    for _, data in frames_of(name):
        version = data[1]
        ((topic_id, body),) = frames_in(data)
        assert frame(topic_id, body, version) == data
        buf = bytearray(len(data) + 2)
        at = 2 + head_size(version)
        buf[at : at + len(body)] = body
        assert finish(buf, 2, topic_id, len(body), version) == len(buf)
        assert buf[2:] == data


@pytest.mark.parametrize("name", SESSIONS)
def test_every_recorded_topic_info_is_made_again_byte_for_byte(name: str) -> None:
    for way, data in frames_of(name):
        ((topic_id, body),) = frames_in(data)
        if way == "b2h" and ID_PUBLISHER <= topic_id <= 5 and len(body) > 4:
            info = topic_info_untrusted(body, 0, len(body))
            made = bytearray(info.size())
            info.write(made, 0)
            assert made == body


def test_one_answer_satisfies_every_way_to_ask_for_a_parameter() -> None:
    """Real boards of four releases take the value of the kind they asked for out of an answer with all kinds."""
    from muros.rosserial.server._parameters import answer_of

    full = [row for row in vector("param_answer_kinds")["rows"] if row["ints"] and row["floats"]]
    assert full
    for row in full:
        assert row["getParam_returned"]
        value = row["ints"][0] if len(row["ints"]) == 1 else row["ints"]
        body, fits = answer_of(value, 24 if not row["strings"] else 512)
        assert fits
        values = values_untrusted(body, 0, len(body))
        assert (values.ints, values.floats) == (row["ints"], row["floats"])
        assert bool(values.strings) == bool(row["strings"])


def test_the_probe_is_the_one_that_every_real_board_understood() -> None:
    from muros.rosserial.server._board import PROBE

    rows = vector("probe_both_versions")["rows"]
    ours = [
        row for row in rows if row["bytes"] == PROBE[:-1].hex()
    ]  # the last byte parts it from what follows
    assert {row["client"] for row in ours} == {row["client"] for row in rows}
    assert all(row["negotiated"] for row in ours)


def test_lines_that_boards_drop_frames_on_are_warned_about() -> None:
    """Where a real board received fewer strings than were sent, the server warns, and nowhere that it got all."""
    for row in vector("slow_line_20ms")["rows"]:
        scene = Scene(baud=row["baud"])
        scene.port.up("a", scene.now)
        info = TopicInfo(100, "h/str", "std_msgs/String", interfaces.md5("std_msgs/String"), 2048)
        body = bytearray(info.size())
        info.write(body, 0)
        scene.port.receive(frame(1, bytes(body), VERSION_HYDRO), "a", scene.now)
        scene.step(10)
        text = "x" * (row["payload"] - 4)
        scene.writer("/h/str", "std_msgs/msg/String")(data=text)
        scene.step(400)
        assert ("slow-line" in scene.codes()) == (row["received"] < row["sent"] or row["frame_ms"] > 20)
