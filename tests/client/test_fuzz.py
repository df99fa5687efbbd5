"""A client whose agent says anything: every recorded session with what the agent said changed, locators of any bytes.

What may happen is that samples are lost or that the client counts and reconnects, never that it raises or that its
memory grows.
"""

import random
import struct
import zlib
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.client.discovery import InfoError, locators_untrusted
from muros.client.link import CONNECTED, CONNECTING, LOST, WAITING
from tests.agent.test_fuzz import mutate
from tests.client.replay import Puppet
from tests.client.test_replay import RECORDED

MUTANTS = 5
LARGEST = 4096
"""The longest sample that is joined, in bytes: shorter than those that some recordings hold."""
ACCEPTED = bytes.fromhex("8100000004010b000000585243450100010f00")


def puppet_of(accepted: bytes) -> Puppet:
    """A client that was accepted with this message."""
    key = accepted[4:8] if accepted[0] < 0x80 else b"\xaa\xbb\xcc\xdd"
    puppet = Puppet(b"\x80\0\0\0\0\1\x10\0XRCE\1\0\1\x0f" + key + bytes((accepted[0],)) + b"\0\xfc\x01")
    puppet.session.largest = LARGEST
    puppet.feed(accepted, 0)
    assert puppet.session.state == CONNECTED
    return puppet


def accepts(message: bytes) -> bool:
    """Whether it is a good STATUS_AGENT."""
    body = message[4 if message[0] >= 0x80 else 8 :]
    return body[:1] == b"\x04" and body[4] == 0


def is_bounded(session: Any) -> None:
    """Streams are in order, and no more is kept than their windows hold."""
    assert session.state in (WAITING, CONNECTING, CONNECTED, LOST)
    assert len(session.inputs) <= 255
    for number, stream in session.inputs.items():
        if number >= 0x80:
            assert not stream.busy
            assert len(stream.early) <= stream.window
            assert all(len(message) <= stream.mtu for message in stream.early.values())
            assert stream.fragments is None or len(stream.fragments.data) <= LARGEST
    for stream in session.outputs.values():
        assert stream.next - stream.first & 0xFFFF <= stream.history


@pytest.mark.parametrize("name", sorted(RECORDED))
def test_mutations_of_what_an_agent_said(name: str) -> None:
    told = [
        (bytes.fromhex(packet["hex"]), packet.get("client", 0))
        for packet in RECORDED[name]["packets"]
        if packet["dir"] == "a>c"
    ]
    accepted = next((message for message, _ in told if accepts(message)), ACCEPTED)
    for mutant in range(MUTANTS):
        dice = random.Random(zlib.crc32(name.encode()) + mutant)
        puppet = puppet_of(accepted)
        for message, _ in mutate(told, dice):
            puppet.session.now = puppet.now = puppet.now + dice.randint(0, 60)
            puppet.session.deliver(message, 0, len(message))
            assert puppet.session.raised is None
            puppet.session.spin_once(puppet.now)
            is_bounded(puppet.session)


submessages = st.tuples(
    st.sampled_from([0, 1, 0x80]), st.integers(0, 16), st.integers(0, 15), st.binary(max_size=40)
)


@given(st.lists(submessages, max_size=20))
def test_any_submessages(told: list[tuple[int, int, int, bytes]]) -> None:
    """Behind a good header with the right number, so that every byte is looked at."""
    puppet = puppet_of(ACCEPTED)
    session = puppet.session
    numbers = {0: 0, 1: 0, 0x80: 0}
    for stream, kind, flags, body in told:
        head = struct.pack("<BBHBBH", 0x81, stream, numbers[stream], kind, flags | 1, len(body))
        numbers[stream] += 1 if stream else 0
        session.now = puppet.now = puppet.now + 5
        session.deliver(head + body, 0, len(head) + len(body))
        assert session.raised is None
        session.spin_once(puppet.now)
        is_bounded(session)


@given(st.binary(max_size=120), st.integers(0, 80), st.binary(max_size=8))
def test_locators_of_any_bytes(data: bytes, at: int, changed: bytes) -> None:
    recorded = bytes.fromhex(
        next(p["hex"] for p in RECORDED["raw_discovery"]["packets"] if p["dir"] == "a>c")
    )
    for told in (data, recorded + data, recorded[:at] + changed + recorded[at + len(changed) :]):
        with suppress(InfoError):
            found = locators_untrusted(told)
            assert len(found) <= 64
            assert all(isinstance(host, str) for host, _ in found)
