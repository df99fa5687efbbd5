"""The ring, against a plain list; push policies, against what they promise."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rtc.codes import BufferStatus
from muros.rtc.data._policies import PushPolicy, Selector
from muros.rtc.data._ring import EmptyPolicy, FullPolicy, Ring

OPERATIONS = st.lists(st.sampled_from(["put", "put", "take", "peek", "drop", "forget", "clear"]), max_size=60)


@given(st.integers(1, 5), st.sampled_from(FullPolicy), st.sampled_from(EmptyPolicy), OPERATIONS)
def test_a_ring_is_a_list_with_policies(
    length: int, full: FullPolicy, empty: EmptyPolicy, operations: list[str]
) -> None:
    ring: Ring[int] = Ring(length, full, empty)
    model: list[int] = []
    last: int | None = None
    lost = 0
    number = 0
    for operation in operations:
        if operation == "put":
            number += 1
            status = ring.put(number)
            if len(model) < length or full is FullPolicy.OVERWRITE:
                assert status is BufferStatus.OK
                lost += len(model) == length
                model = [*model, number][-length:]
            else:
                assert status is BufferStatus.FULL
        elif operation == "take":
            status, value = ring.take()
            if model:
                last = model.pop(0)
                assert (status, value) == (BufferStatus.OK, last)
            elif empty is EmptyPolicy.READBACK and last is not None:
                assert (status, value) == (BufferStatus.OK, last)
            else:
                assert (status, value) == (BufferStatus.EMPTY, None)
        elif operation == "drop":
            ring.drop(2)
            model = model[2:]
        elif operation == "forget":
            ring.forget_last()
            last = None
        elif operation == "clear":
            ring.clear()
            model, last = [], None
        else:
            first = ring.peek()
            assert (first and first[1]) == (model[0] if model else None)
        assert (len(ring), ring.full, ring.overwritten) == (len(model), len(model) >= length, lost)
        assert ring.last == last


def test_a_value_sent_is_dropped_by_its_number_not_by_its_place() -> None:
    ring: Ring[str] = Ring(2)
    for text in "ab":
        ring.put(text)
    first = ring.peek()
    assert first == (0, "a")
    ring.put("c")  # overwrites a, which is being sent
    ring.drop_through(0)
    assert [ring.take()[1], ring.take()[1]] == ["b", "c"]


@given(st.integers(1, 8), st.integers(0, 12), st.integers(0, 8))
def test_drop_through(length: int, puts: int, number: int) -> None:
    ring: Ring[int] = Ring(length)
    for value in range(puts):
        ring.put(value)
    standing = list(range(max(0, puts - length), puts))
    ring.drop_through(number)
    rest = [value for value in standing if value > number]
    assert [ring.take()[1] for _ in range(len(ring))] == rest
    if number in standing and not rest:
        assert ring.last == number


def test_a_ring_holds_something() -> None:
    with pytest.raises(ValueError, match="at least 1"):
        Ring(0)
    with pytest.raises(ValueError, match="0 or more"):
        Selector(PushPolicy.SKIP, -1)


@dataclass
class Sender:
    """What a publisher does with a ring and a selector, without its thread."""

    selector: Selector
    ring: Ring[int] = field(default_factory=lambda: Ring(1000))
    sent: list[int] = field(default_factory=list)

    def run(self, fails: bool = False) -> None:
        while True:
            step = self.selector.step(len(self.ring))
            self.ring.drop(step.drop)
            first = self.ring.peek() if step.send else None
            if first is None or fails:
                return
            self.sent.append(first[1])
            self.selector.sent()
            self.ring.drop_through(first[0])
            if not self.selector.goes_on:
                return


PASSES = st.lists(st.tuples(st.integers(0, 5), st.booleans()), max_size=30)


@given(st.sampled_from(PushPolicy), st.integers(0, 3), PASSES)
def test_what_policies_send(policy: PushPolicy, skip: int, passes: list[tuple[int, bool]]) -> None:
    """However the writes fall on the passes, and whichever passes fail."""
    sender = Sender(Selector(policy, skip))
    written = 0
    newest_at_good_passes: list[int] = []
    for count, fails in passes:
        for _ in range(count):
            written += 1
            sender.ring.put(written)
        waiting = len(sender.ring) > 0
        sender.run(fails)
        if waiting and not fails:
            newest_at_good_passes.append(written)
    everything = list(range(1, written + 1))
    if policy is PushPolicy.ALL:
        assert [*sender.sent, *(sender.ring.take()[1] for _ in range(len(sender.ring)))] == everything
    elif policy is PushPolicy.FIFO:
        assert sender.sent == everything[: len(newest_at_good_passes)]
    elif policy is PushPolicy.NEW:
        assert sender.sent == newest_at_good_passes
    else:
        assert sender.sent == everything[skip :: skip + 1][: len(sender.sent)]
        sender.run()
        assert sender.sent == everything[skip :: skip + 1]
