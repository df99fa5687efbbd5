"""Plays a recorded session to a board of ours: what the host sent goes in, what the board sent has to come out.

The program of the recorded boards echoes ``h/NAME`` on ``b/NAME`` and serves ``b/set_bool``, ``b/trigger`` and
``b/empty_srv``; what else a board sends (a publication, a log, a question) is begun here when the recording has it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from muros.rosserial import types
from muros.rosserial.device import Device
from muros.rosserial.messages import (
    TopicInfo,
    log_untrusted,
    parameter_request_untrusted,
    topic_info_untrusted,
)
from muros.rosserial.node_handle import parse
from muros.rosserial.packets import ANY_VERSION, Decoder

CLOCK_ERROR = 60
"""Milliseconds by which the recorded time of a frame and the board's own may differ."""

VECTORS = Path(__file__).parents[1] / "vectors/rosserial"


def recording(name: str) -> dict[str, Any]:
    """A recorded session."""
    read: dict[str, Any] = json.loads((VECTORS / f"{name}.json").read_text())
    return read


class Raw:
    """A payload as it is."""

    def __init__(self, payload: bytes) -> None:
        self.payload = payload

    def size(self) -> int:
        return len(self.payload)

    def write(self, buf: bytearray, off: int) -> int:
        buf[off : off + len(self.payload)] = self.payload
        return off + len(self.payload)


def opened(frame: bytes) -> tuple[int, bytes]:
    """The topic id and the payload of a frame of either version."""
    found: list[tuple[int, bytes]] = []
    decoder = Decoder(
        4096, lambda at, buf, off, n: found.append((at, bytes(buf[off : off + n]))), ANY_VERSION
    )
    decoder.feed(frame, len(frame), 0)
    assert len(found) == 1, frame.hex()
    return found[0]


class Player:
    """One recording and the board that answers to it."""

    def __init__(
        self, record: dict[str, Any], version: int = 0xFE, ignored: frozenset[int] = frozenset()
    ) -> None:
        self.record = record
        self.version = version
        self.ignored = ignored
        """Numbers of frames that are neither played nor expected."""
        self.infos: dict[int, tuple[int, TopicInfo]] = {}
        for number, frame in enumerate(record["frames"]):
            if number in ignored:
                continue
            topic_id, payload = opened(bytes.fromhex(frame["hex"])) if frame["kind"] == "frame" else (99, b"")
            if frame["dir"] == "b2h" and topic_id <= 5:
                info = topic_info_untrusted(payload, 0, len(payload))
                self.infos.setdefault(info.topic_id, (topic_id, info))
        self.sent: list[bytes] = []
        self.heard: list[tuple[str, Any]] = []
        self.now = 0
        self.reset()

    def reset(self) -> None:
        """The board starts anew."""
        event = self.record["board_events"][0]
        self.device = Device(self._send, event["in"], event["out"], version=self.version)
        for topic_id, (endpoint, info) in sorted(self.infos.items()):
            made = (
                self.device.subscriber(
                    info.topic_name,
                    info.message_type,
                    info.md5sum,
                    partial(self._take, endpoint, info),
                    endpoint,
                )
                if endpoint & 1
                else self.device.publisher(info.topic_name, info.message_type, info.md5sum, endpoint)
            )
            assert made == topic_id

    def play(self) -> int:
        """Plays it all; returns how many frames of the board were as recorded."""
        resets = [step["t_ms"] for step in self.record["steps"] if "a new one starts" in step["step"]]
        same = 0
        for number, frame in enumerate(self.record["frames"]):
            if frame["kind"] != "frame" or number in self.ignored:
                continue
            if resets and frame["t_ms"] > resets[0]:
                resets.pop(0)
                self.reset()
            raw = bytes.fromhex(frame["hex"])
            if frame["dir"] == "h2b":
                self.now = max(self.now, int(frame["t_ms"]))
                self.device.feed(raw, len(raw), self.now)
                continue
            if not self.sent:
                self._begin(raw, frame["t_ms"])
            assert self.sent, f"frame {number}: nothing sent: {frame['note']}"
            assert self.sent.pop(0).hex() == raw.hex(), f"frame {number}: {frame['note']}"
            same += 1
        assert not self.sent
        return same

    def _begin(self, raw: bytes, t_ms: float) -> None:
        """What the recorded board did of its own accord."""
        topic_id, payload = opened(raw)
        self.now = max(self.now, math.ceil(t_ms))
        if topic_id == 10:  # as soon as it is due by our clock, which may be a little after the recorded one
            for _ in range(CLOCK_ERROR):
                if not self.sent:
                    self.device.tick(self.now)
                    self.now += 1
            return
        if topic_id == 7:
            level, text = log_untrusted(payload, 0, len(payload))
            if "larger than buffer" in text.decode():
                assert self.device.publish(125, Raw(bytes(300))) == -1
            else:
                self.device.log(level, text)
        elif topic_id == 6:
            self.device.request_parameter(parameter_request_untrusted(payload, 0, len(payload)).encode())
        else:
            assert self.device.publish(topic_id, Raw(payload)) == len(raw)

    def _send(self, buf: Any, off: int, n: int) -> None:
        self.sent.append(bytes(buf[off : off + n]))

    def _take(self, endpoint: int, info: TopicInfo, buf: bytearray, off: int, n: int) -> None:
        name = info.topic_name.partition("/")[2]
        if endpoint == 1:
            message = parse(types.message(info.message_type), buf, off, n)
            self.heard.append((name, message))
            back = [at for at, (_, other) in self.infos.items() if other.topic_name == f"b/{name}"]
            assert self.device.publish(back[0], message) > 0
            return
        kind = types.service(info.message_type)
        if endpoint == 5:
            self.heard.append((name, parse(kind.Response, buf, off, n)))
            return
        request = parse(kind.Request, buf, off, n)
        answers: dict[str, Callable[[], Any]] = {
            "set_bool": lambda: kind.Response(True, f"board got {request.data:d}"),
            "trigger": lambda: kind.Response(True, "triggered"),
            "empty_srv": kind.Response,
        }
        sends = [
            at
            for at, (kind_, other) in self.infos.items()
            if kind_ == 2 and other.topic_name == info.topic_name
        ]
        self.device.publish(sends[0], answers[name]())
