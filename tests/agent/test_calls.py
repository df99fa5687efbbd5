"""Calls to come: in order, taken back, and never piling up."""

import random

from muros.agent._calls import Call, Calls


def test_calls_are_made_in_order_of_time_then_of_asking() -> None:
    calls, made = Calls(), list[str]()
    for tick, name in ((30, "c"), (10, "a"), (10, "b"), (40, "d")):
        calls.at(tick, lambda name=name: made.append(name))  # type: ignore[misc]
    assert calls.next() == 10
    calls.run(9)
    assert made == []
    calls.run(30)
    assert made == ["a", "b", "c"]
    assert calls.next() == 40
    calls.run(1000)
    assert made == ["a", "b", "c", "d"]
    assert calls.next() is None
    assert len(calls) == 0


def test_a_call_that_asks_for_itself_again_does_not_hang() -> None:
    calls, made = Calls(), list[int]()

    def again() -> None:
        made.append(len(made))
        calls.at(5, again)

    calls.at(5, again)
    calls.run(5)
    assert made == [0]
    calls.run(5)
    assert made == [0, 1]


def test_a_call_may_take_back_another_that_is_due() -> None:
    calls, made = Calls(), list[str]()
    second: list[Call] = []
    calls.at(1, lambda: calls.cancel(second[0]))
    second.append(calls.at(1, lambda: made.append("second")))
    calls.at(1, lambda: made.append("third"))
    calls.run(1)
    assert made == ["third"]
    calls.cancel(second[0])
    assert len(calls) == 0
    assert calls.next() is None


def test_what_is_taken_back_does_not_pile_up() -> None:
    dice = random.Random(1)
    calls, living, made = Calls(), list[Call](), list[int]()
    for n in range(10_000):
        living.append(calls.at(dice.randrange(100_000), lambda n=n: made.append(n)))  # type: ignore[misc]
        if len(living) > 10:
            calls.cancel(living.pop(dice.randrange(len(living))))
        assert len(calls) <= 2 * 64 + 2 * 10 + 3
    calls.run(100_000)
    assert len(made) == 10
    assert len(calls) == 0
