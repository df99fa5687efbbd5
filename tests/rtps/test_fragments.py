"""Samples put together from fragments, in whatever order and company they come."""

from __future__ import annotations

import random

from hypothesis import given
from hypothesis import strategies as st

from muros.rtps._events import DataFrag
from muros.rtps._fragments import FRAGMENT_COST, Assembly, fragments_of
from muros.rtps._parameters import Parameters

SOURCE = b"p" * 12


def piece(sample: bytes, size: int, first: int, count: int = 1, time: int | None = 5) -> DataFrag:
    part = sample[(first - 1) * size : (first - 1 + count) * size]
    return DataFrag(SOURCE, None, time, 4, 3, 7, first, count, size, len(sample), part, None, False)


@given(st.binary(min_size=1, max_size=400), st.integers(1, 90), st.integers(0, 2**32))
def test_any_order_and_any_doubling_makes_the_sample_once(sample: bytes, size: int, seed: int) -> None:
    dice = random.Random(seed)
    total = fragments_of(len(sample), size)
    pieces = []
    for first in range(1, total + 1):
        count = dice.randint(1, total - first + 1) if dice.random() < 0.3 else 1
        pieces += [piece(sample, size, first, count)] * dice.randint(1, 2)
    dice.shuffle(pieces)
    assembly = Assembly(pieces[0], 0)
    for fragment in pieces:
        done = assembly.complete()
        missing = assembly.missing(256)
        cost = assembly.add(fragment)
        assert (cost > 0) is (not done and any(n in missing for n in span(fragment)))
    assert assembly.complete()
    assert assembly.missing(256) == []
    assert assembly.cost == len(sample) + total * FRAGMENT_COST
    whole = assembly.sample()
    assert whole.payload == sample
    assert (whole.source, whole.time, whole.reader, whole.writer, whole.sequence) == (SOURCE, 5, 4, 3, 7)


def span(fragment: DataFrag) -> range:
    return range(fragment.first_fragment, fragment.first_fragment + fragment.fragments_in)


def test_what_is_missing_fits_one_set() -> None:
    sample = bytes(10_000)
    assembly = Assembly(piece(sample, 10, 5), 0)
    assembly.add(piece(sample, 10, 1))
    assembly.add(piece(sample, 10, 5))
    missing = assembly.missing(256)
    assert missing[:4] == [2, 3, 4, 6]
    assert missing[-1] - missing[0] == 255
    assert assembly.missing(256, last=4) == [2, 3, 4]
    assert assembly.missing(256, last=1) == []


def test_a_claim_of_a_huge_sample_costs_what_has_come() -> None:
    fragment = DataFrag(SOURCE, None, None, 4, 3, 7, 2, 1, 4, 2**32 - 1, b"abcd", None, False)
    assembly = Assembly(fragment, 0)
    assert assembly.add(fragment) == assembly.cost == 4 + FRAGMENT_COST
    assert assembly.missing(256)[:2] == [1, 3]


def test_fragments_of_another_cut_do_not_fit() -> None:
    assembly = Assembly(piece(bytes(100), 10, 1), 0)
    assert assembly.fits(piece(bytes(100), 10, 9))
    assert not assembly.fits(piece(bytes(101), 10, 9))
    assert not assembly.fits(piece(bytes(100), 20, 1))


def test_inline_qos_count_wherever_they_come() -> None:
    sample = bytes(20)
    assembly = Assembly(piece(sample, 10, 2), 0)
    assembly.add(piece(sample, 10, 2))
    qos = Parameters()
    assembly.add(piece(sample, 10, 1)._replace(inline_qos=qos))
    assert assembly.sample().inline_qos is qos
