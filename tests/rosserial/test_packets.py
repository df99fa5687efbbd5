"""Frames in damaged streams: properties of the decoder. See also ``tests/board/test_rosserial.py``."""

from __future__ import annotations

from random import Random

from hypothesis import assume, given
from hypothesis import strategies as st

from muros.rosserial.messages import (
    MessageError,
    TopicInfo,
    log_untrusted,
    parameter_request_untrusted,
    time_untrusted,
    topic_info_untrusted,
    values_untrusted,
)
from muros.rosserial.packets import ANY_VERSION, VERSION_GROOVY, VERSION_HYDRO, Decoder, frame

VERSIONS = st.sampled_from([VERSION_HYDRO, VERSION_GROOVY])
PAYLOADS = st.binary(max_size=80) | st.lists(st.sampled_from([0xFF, 0xFE, 0, 1]), max_size=40).map(bytes)
FRAMES = st.lists(st.tuples(st.integers(0, 0xFFFF), PAYLOADS), max_size=8)
NOISE = st.binary(max_size=30) | st.lists(st.sampled_from([0xFF, 0xFE, 0, 1, 8]), max_size=30).map(bytes)


def read(
    data: bytes, version: int, sizes: list[int] | None = None, capacity: int = 512
) -> list[tuple[int, bytes]]:
    """All frames in some bytes that come in pieces, and then no more for a long time."""
    found: list[tuple[int, bytes]] = []
    decoder = Decoder(
        capacity, lambda at, buf, off, n: found.append((at, bytes(buf[off : off + n]))), version
    )
    at, i = 0, 0
    while at < len(data):
        n = sizes[i % len(sizes)] if sizes else len(data)
        decoder.feed(data[at : at + n], len(data[at : at + n]), 0)
        at, i = at + n, i + 1
    now = 0
    for _ in range(len(data) + 10):
        wait = decoder.tick(now)
        if wait < 0:
            break
        now += wait
    assert decoder.pending == 0
    return found


@given(FRAMES, VERSIONS, st.lists(st.integers(1, 40), min_size=1))
def test_what_was_framed_is_found_whatever_the_pieces(
    frames: list[tuple[int, bytes]], version: int, sizes: list[int]
) -> None:
    stream = b"".join(frame(at, body, version) for at, body in frames)
    assert read(stream, version, sizes) == frames


@given(st.lists(st.tuples(NOISE, st.integers(0, 0xFFFF), PAYLOADS), max_size=6), VERSIONS)
def test_no_good_frame_is_lost_behind_noise(parts: list[tuple[bytes, int, bytes]], version: int) -> None:
    stream = b"".join(noise + frame(at, body, version) for noise, at, body in parts)
    good = [(at, body) for _, at, body in parts]
    found = read(stream, version)
    assume(not [each for each in found if each not in good])  # noise that is a frame by chance may hide one
    assert found == good


@given(st.binary(max_size=300) | NOISE, st.sampled_from([VERSION_HYDRO, VERSION_GROOVY, ANY_VERSION]))
def test_noise_harms_nobody_and_the_pieces_do_not_matter(data: bytes, version: int) -> None:
    whole = read(data, version)
    assert read(data, version, [1]) == whole
    assert read(data, version, [3, 7, 1]) == whole


@given(PAYLOADS, st.integers(0, 0xFFFF), st.integers(0, 7), st.data())
def test_no_single_bit_error_passes(body: bytes, at: int, bit: int, data: st.DataObject) -> None:
    """An additive checksum finds every error of one bit; version 0xFE, whose length has a checksum of its own."""
    good = bytearray(frame(at, body))
    i = data.draw(st.integers(0, len(good) - 1))
    good[i] ^= 1 << bit
    assert (at, body) not in read(bytes(good), VERSION_HYDRO)


def test_how_much_damage_the_checksum_lets_through() -> None:
    """Two errors may cancel each other: of frames with several wrong bits one in some two hundred passes."""
    random = Random(1)
    passed = tried = 0
    good = frame(125, b"\x10\x00\x00\x000123456789abcdef")
    for _ in range(20_000):
        bad = bytearray(good)
        for _ in range(3):
            bad[random.randrange(5, len(bad))] ^= 1 << random.randrange(8)
        if bad == good:
            continue
        tried += 1
        passed += any(body != good[7:-1] for at, body in read(bytes(bad), VERSION_HYDRO))
    assert 0 < passed / tried < 0.02


def test_bytes_made_to_cost_time_cost_little() -> None:
    """Beginnings that promise the longest frame each, one inside the other: each byte pays for a few, no more."""
    summed = 0

    class Counting(bytearray):
        def __getitem__(self, key: object) -> object:  # type: ignore[override]
            nonlocal summed
            if isinstance(key, slice):
                summed += key.stop - key.start
            return super().__getitem__(key)  # type: ignore[call-overload]

    decoder = Decoder(4096)
    decoder._buf = Counting(decoder._buf)
    evil = b"\xff\xfe\x00\x10" + bytes((~0x10 & 255,))
    data = evil * 40_000
    for off in range(0, len(data), 4096):
        decoder.feed(data[off : off + 4096], len(data[off : off + 4096]), 0)
    assert summed < 40 * len(data)
    decoder.feed(frame(1, b"good") * 3000, 3000 * 12, 1)
    assert decoder.frames > 2000


@given(st.binary(max_size=80))
def test_parsers_raise_one_kind_of_error(data: bytes) -> None:
    for parse in (
        topic_info_untrusted,
        log_untrusted,
        parameter_request_untrusted,
        values_untrusted,
        time_untrusted,
    ):
        for off in (0, 3):
            try:
                parse(bytes(off) + data + b"tail", off, len(data))
            except MessageError:
                continue


@given(st.integers(0, 0xFFFF), st.text(max_size=20), st.text(max_size=20), st.integers(-(2**31), 2**31 - 1))
def test_topic_infos_survive(topic_id: int, name: str, kind: str, size: int) -> None:
    info = TopicInfo(topic_id, name, kind, "0" * 32, size)
    buf = bytearray(info.size())
    assert info.write(buf, 0) == len(buf)
    assert vars(topic_info_untrusted(buf, 0, len(buf))) == vars(info)
