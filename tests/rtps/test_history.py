"""What a writer keeps: the last of each instance or everything, in order, however it is dropped."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rtps._endpoint import NEVER
from muros.rtps._history import History, Sample


def numbers(history: History) -> list[int]:
    return [sample.sequence for sample in history]


def filled(depth: int | None, *instances: bytes, lifespan: int = NEVER) -> History:
    """A history with one sample for each of `instances`, numbered from 1."""
    history = History(depth)
    for number, instance in enumerate(instances, 1):
        history.add(Sample(number, (b"",), instance=instance, expires=min(NEVER, number + lifespan)))
    return history


def test_the_last_samples_of_each_instance_are_kept() -> None:
    history = filled(2, b"a", b"b", b"a", b"a", b"b", b"b")
    assert numbers(history) == [3, 4, 5, 6]
    assert history.first() == 3


def test_without_a_depth_all_are_kept() -> None:
    assert numbers(filled(None, *[b""] * 50)) == list(range(1, 51))


def test_a_depth_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 1"):
        History(0)


def test_what_everybody_has_can_be_dropped() -> None:
    history = filled(None, *[b""] * 5)
    history.drop_to(3)
    assert numbers(history) == [4, 5]
    history.drop_to(99)
    assert (numbers(history), history.first()) == ([], None)


def test_nothing_is_left_of_instances_that_are_dropped() -> None:
    history = filled(2, *[b"%d" % number for number in range(100)])
    history.drop_to(100)
    assert history._instances == {}


def test_an_instance_that_ended_is_forgotten_once_everybody_knows() -> None:
    history = filled(3, b"a", b"b", b"a")
    history.add(Sample(4, (b"",), instance=b"a", last=True))
    history.end_to(3)
    assert numbers(history) == [1, 2, 3, 4]
    history.end_to(4)
    assert numbers(history) == [2]


@pytest.mark.parametrize("depth", [1, 3, None])
def test_an_instance_that_came_back_after_its_end_is_kept(depth: int | None) -> None:
    history = History(depth)
    history.add(Sample(1, (b"",), instance=b"a", last=True))
    history.add(Sample(2, (b"",), instance=b"a"))
    history.end_to(2)
    assert numbers(history) == [2]


def test_samples_die_when_their_time_is_over() -> None:
    history = filled(None, b"", b"", b"", lifespan=10)
    assert history.expire(11) == 12
    assert numbers(history) == [2, 3]
    assert history.expire(100) == NEVER
    assert numbers(history) == []


@given(
    st.sampled_from([1, 2, 5, None]),
    st.lists(
        st.one_of(
            st.tuples(st.just("add"), st.sampled_from([b"a", b"b", b"c"]), st.integers(1, 4)),
            st.tuples(st.just("drop"), st.integers(0, 60), st.none()),
        ),
        max_size=40,
    ),
)
def test_a_history_holds_what_a_simple_model_holds(
    depth: int | None, steps: list[tuple[str, bytes | int, int | None]]
) -> None:
    history, model, number = History(depth), dict[int, bytes](), 0
    for step, what, gap in steps:
        if step == "add":
            assert isinstance(what, bytes)
            assert gap is not None
            number += gap  # what was not kept leaves holes
            history.add(Sample(number, (b"",), instance=what))
            model[number] = what
            same = [n for n, instance in model.items() if instance == what]
            for old in same[: -depth if depth else 0]:
                del model[old]
        else:
            assert isinstance(what, int)
            history.drop_to(what)
            model = {n: instance for n, instance in model.items() if n > what}
        assert numbers(history) == list(model)
        assert history.first() == min(model, default=None)
        assert len(history) == len(model)
        assert all((sample := history.get(n)) is not None and sample.sequence == n for n in model)
