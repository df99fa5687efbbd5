"""What the reference client did, our client core does with the same bytes, for every recorded session."""

from pathlib import Path
from typing import Any

import pytest

from muros.client.link import CONNECTED
from tests.client.replay import VECTORS, Puppet, by_stream, load, replay, submessages

RECORDED = {path.stem: load(f"xrce/{path.name}") for path in sorted(Path(VECTORS / "xrce").glob("*.json"))}
SCENARIOS = [
    name for name, recorded in RECORDED.items() if recorded["client"].startswith("reference C client")
]
RAW = [
    name
    for name, recorded in RECORDED.items()
    if "raw_" in name
    and any(bytes.fromhex(p["hex"])[4] == 4 for p in recorded["packets"] if p["dir"] == "a>c")
]
ACKNACK, DATA, FRAGMENT = 10, 9, 13


def test_every_kind_of_scenario_is_there() -> None:
    assert len(SCENARIOS) >= 50
    assert len(RAW) >= 40
    assert {"pubsub_bin_reliable", "fragments_lost", "reconnect", "timesync", "ping"} <= set(SCENARIOS)


@pytest.mark.parametrize("name", SCENARIOS)
def test_scenario(name: str) -> None:
    theirs, ours, _ = replay(RECORDED[name])
    assert ours == theirs


def test_second_client_of_two() -> None:
    theirs, ours, _ = replay(RECORDED["example_hello_world_two_clients"], client=1)
    assert ours == theirs


@pytest.mark.parametrize("name", ["pubsub_bin_reliable", "fragments", "request_reply_bin"])
def test_samples_come_out_as_the_reference_client_got_them(name: str) -> None:
    recorded = RECORDED[name]
    _, _, puppets = replay(recorded)
    assert puppets[0].got == samples(recorded)
    assert len(puppets[0].got) >= 2


def test_a_difference_is_seen() -> None:
    recorded = RECORDED["pubsub_bin_reliable"]
    changed = [dict(packet) for packet in recorded["packets"]]
    place = next(i for i, p in enumerate(changed) if p["dir"] == "a>c" and p["hex"].startswith("81800700"))
    changed[place]["dropped"] = True
    theirs, ours, _ = replay({**recorded, "packets": changed})
    assert ours != theirs


@pytest.mark.parametrize("name", RAW)
def test_agent_side_of_raw_scenario(name: str) -> None:
    """Fed with everything an agent said to a hand-made client, ours hands on each sample once and acknowledges."""
    recorded = RECORDED[name]
    said = [bytes.fromhex(p["hex"]) for p in recorded["packets"] if p["dir"] == "a>c"]
    accepted = next(message for message in said if message[4] == 4 and message[8] < 0x80)
    session_id = accepted[0]
    hello = b"\x80\0\0\0\0\1\x10\0XRCE\1\0\1\x0f\xaa\xbb\xcc\xdd" + bytes((session_id, 0, 0xFC, 0x01))
    puppet = Puppet(hello, mtu=65535, history=256)
    for message in said[said.index(accepted) :]:
        if message[0] == session_id:
            puppet.feed(message, 0)
    assert puppet.session.state == CONNECTED
    assert sorted(puppet.got) == sorted(
        samples(recorded, session_id)
    )  # streams have no order among each other
    numbers = {
        int.from_bytes(message[2:4], "little") for message in said if message[:2] == bytes((session_id, 0x80))
    }
    if numbers:
        answers = [m for m in puppet.wire.sent if m[1] == 0 and m[4] == ACKNACK]
        first = int.from_bytes(answers[-1][8:10], "little")
        assert first == next(n for n in range(70_000) if n not in numbers)


def test_session_as_the_middleware_of_micro_ros_drives_it() -> None:
    capture = load("rmw/session_capture.json")
    packets = [
        {"dir": {"tx": "c>a", "rx": "a>c"}[row[0]], "hex": row[2], "t_ms": i}
        for i, row in enumerate(capture["rows"])
        if row[0] in ("tx", "rx")
    ]
    theirs, ours, puppets = replay({"packets": packets})
    assert ours == theirs
    events = [row[2] for row in capture["rows"] if row[0] == "event"]
    assert len(puppets[0].got) == len(events)


def samples(recorded: dict[str, Any], session_id: int | None = None) -> list[bytes]:
    """The samples an agent sent, by a model of its own: reliable ones by number, the others as they came."""
    reliable: dict[int, bytes] = {}
    others: list[bytes] = []
    for packet in recorded["packets"]:
        message = bytes.fromhex(packet["hex"])
        if packet["dir"] != "a>c" or (session_id is not None and message[0] != session_id):
            continue
        if message[1] >= 0x80:
            number = int.from_bytes(message[2:4], "little")
            if number == 0 and reliable.get(0) not in (None, message):
                others += joined(reliable)
                reliable = {}
            reliable.setdefault(number, message)
        else:
            others += [s.body[4:] for s in submessages(message) if s.kind == DATA]
    return [*others, *joined(reliable)]


def joined(messages: dict[int, bytes]) -> list[bytes]:
    """The samples in numbered messages, fragments put together."""
    found: list[bytes] = []
    run = b""
    for number in sorted(messages):
        for submessage in submessages(messages[number]):
            if submessage.kind == FRAGMENT:
                run += submessage.body
                if submessage.flags & 2:
                    found.append(run[8:])
                    run = b""
            elif submessage.kind == DATA:
                found.append(submessage.body[4:])
    return found


def test_by_stream_keeps_streams_apart() -> None:
    messages = [
        bytes.fromhex("8180000007010800000a001501020304"),
        bytes.fromhex("8101000007010800000a001501020304"),
    ]
    assert len(by_stream(messages)) == 2
