"""The one heap of times."""

from hypothesis import given
from hypothesis import strategies as st

from muros.rtps._agenda import Agenda, Timed
from muros.rtps._endpoint import NEVER


class Bell(Timed):
    def __init__(self, *next_times: int) -> None:
        super().__init__()
        self.rung: list[int] = []
        self.next_times = list(next_times)

    def wake(self, now: int) -> int:
        self.rung.append(now)
        return self.next_times.pop(0) if self.next_times else NEVER


def test_what_is_due_is_woken_and_says_when_again() -> None:
    agenda, bell = Agenda(), Bell(20, 20)
    agenda.at(bell, 10)
    assert agenda.next == 10
    agenda.run(9)
    assert bell.rung == []
    agenda.run(15)
    assert (bell.rung, agenda.next) == ([15], 20)
    agenda.run(25)  # asks for a time in the past: once a turn
    assert (bell.rung, agenda.next) == ([15, 25], 20)
    agenda.run(26)
    assert bell.rung == [15, 25, 26]
    assert agenda.next is None


def test_nearer_times_count_and_farther_ones_do_not() -> None:
    agenda, bell = Agenda(), Bell()
    for at in (30, 20, 40):
        agenda.at(bell, at)
    agenda.run(50)
    assert bell.rung == [50]
    assert (agenda.next, len(agenda)) == (None, 0)


def test_the_forgotten_are_not_woken() -> None:
    agenda, bell, other = Agenda(), Bell(), Bell()
    agenda.at(bell, 10)
    agenda.at(other, 20)
    agenda.forget(bell)
    assert agenda.next == 20
    agenda.run(30)
    assert (bell.rung, other.rung) == ([], [30])
    agenda.at(bell, 40)
    agenda.run(40)
    assert bell.rung == [40]


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 50)), max_size=60))
def test_nobody_is_late_or_woken_twice(asked: list[tuple[int, int]]) -> None:
    agenda, bells = Agenda(), [Bell() for _ in range(5)]
    wanted: dict[int, int] = {}
    for now, (index, after) in enumerate(asked):
        agenda.at(bells[index], now + after)
        wanted[index] = min(wanted.get(index, NEVER), now + after)
        due = [index for index, at in wanted.items() if at <= now]
        before = [len(bell.rung) for bell in bells]
        agenda.run(now)
        assert [len(bell.rung) - before[i] for i, bell in enumerate(bells)] == [
            int(i in due) for i in range(5)
        ]
        for index in due:
            del wanted[index]
        assert agenda.next == min(wanted.values(), default=None)
