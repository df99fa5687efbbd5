"""Every recorded session of the reference agent, replayed against ours: one test a scenario, named after it."""

import json
from collections.abc import Iterable
from typing import Any

import pytest

from tests.agent.replay import ACKNACK, HEARTBEAT, VECTORS, Bench, load, replay

SCENARIOS = sorted(path.stem for path in (VECTORS / "xrce").glob("*.json"))


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_recorded_session(scenario: str) -> None:
    recorded = load(scenario)
    expected, given, bench = replay(recorded, stop_at_failure=True)
    KNOWN_DIFFERENCES.get(scenario, lambda expected, given: None)(expected, given)
    assert given == expected
    theirs = heartbeats(bytes.fromhex(p["hex"]) for p in recorded["packets"] if p["dir"] == "a>c")
    ours = heartbeats(message for _, _, message in bench.wire.sent)
    assert ours - theirs == OTHER_MOMENT.get(scenario, set())
    assert not any(finding.code == "watcher-error" for finding in bench.findings.snapshot())


def _matched_topic(expected: dict[Any, Any], given: dict[Any, Any]) -> None:
    """The reference with Fast DDS calls every topic the same; its other middleware, as we do, compares names."""
    statuses = expected[0, 0x81, 0x80][0]
    statuses[6] = statuses[6][:-2] + b"\x81\x00"
    statuses[7] = statuses[7][:-2] + b"\x00\x00"


def _unanswered_heartbeats(expected: dict[Any, Any], given: dict[Any, Any]) -> None:
    """The reference was busy for 350 ms here and lost two of three HEARTBEATs from its queue; we answer each."""
    stream = given[0, 0x81, 0, ACKNACK]
    assert stream[:4] == [bytes.fromhex("810000000a0105000100000080")] * 4
    del stream[:2]


def heartbeats(messages: Iterable[bytes]) -> set[bytes]:
    """What HEARTBEATs there are; how many and which of them come is a matter of time, what they say is none."""
    return {m for m in messages if len(m) > 8 and m[4 if m[0] >= 0x80 else 8] == HEARTBEAT}


OTHER_MOMENT = {"hard_liveliness_client": {bytes.fromhex("810000000b0105000000050080")}}
"""HEARTBEATs that the reference did not send: it told of message 4 before it sent 5, and lost those after it."""

KNOWN_DIFFERENCES: dict[str, Any] = {
    "creation_modes": _matched_topic,
    "hard_liveliness_client": _unanswered_heartbeats,
}


def test_session_capture() -> None:
    """A whole session of a client that does what micro-ROS does; each answer must have come by the recorded row."""
    rows = json.loads((VECTORS / "rmw" / "session_capture.json").read_text())["rows"]
    packets = [
        {"t_ms": 5 * n, "dir": "c>a" if row[0] == "tx" else "a>c", "hex": row[2]}
        for n, row in enumerate(rows)
        if row[0] in ("tx", "rx")
    ]
    recorded = {"scenario": "session_capture", "agent": "2.4.2", "packets": packets}
    expected, given, _ = replay(recorded)
    assert given == expected


def test_hard_liveliness_probes_then_removes() -> None:
    recorded = json.loads((VECTORS / "rmw" / "hard_liveliness.json").read_text())
    timing = recorded["timing"]
    bench = Bench()
    bench.receive(bytes.fromhex(recorded["create_client_datagram"]))
    bench.take()
    bench.advance(timing["first_probe_after_ms"] - 250)
    assert bench.take() == []
    bench.advance(timing["first_probe_after_ms"] + 250)
    probe = bytes.fromhex(recorded["agent_probe"])
    assert bench.take()[0] == probe
    bench.receive(bytes.fromhex(recorded["client_answer"]))
    assert bench.take() == []
    bench.advance(bench.now + timing["deleted_after_ms"] + 400)
    assert bench.take() == [probe] * timing["tries"]
    assert not bench.core.clients
    assert bench.events[-1].text().startswith("client 0xCAFEBABE gone: silent for")
    goodbye = bytes.fromhex("81000000030104000002fffe")
    bench.receive(goodbye)
    assert bench.take() == [bytes.fromhex("81000000050106000002fffe0000")]
