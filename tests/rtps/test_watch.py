"""Deadlines and owners, by themselves."""

from muros.rtps._agenda import Agenda
from muros.rtps._watch import Deadlines, Owners

A, B, C = b"A" * 16, b"B" * 16, b"C" * 16


class Watch:
    def __init__(self, period: int = 100, limit: int = 3) -> None:
        self.agenda = Agenda()
        self.missed: list[tuple[int, bytes]] = []
        self.deadlines = Deadlines(
            period, limit, self.agenda, lambda total, one: self.missed.append((total, one))
        )

    def run(self, until: int) -> None:
        while (at := self.agenda.next) is not None and at <= until:
            self.agenda.run(at)


def test_a_deadline_is_missed_once_in_each_period() -> None:
    watch = Watch()
    watch.deadlines.touch(b"", 0)
    watch.run(99)
    assert watch.missed == []
    watch.run(350)
    assert watch.missed == [(1, b""), (2, b""), (3, b"")]
    watch.deadlines.touch(b"", 360)
    watch.run(459)
    assert len(watch.missed) == 3


def test_periods_that_were_slept_through_count_at_once() -> None:
    watch = Watch()
    watch.deadlines.touch(b"", 0)
    watch.agenda.run(470)
    assert watch.missed == [(4, b"")]
    assert watch.agenda.next == 500


def test_the_one_that_was_silent_longest_makes_way() -> None:
    watch = Watch(limit=2)
    for now, instance in enumerate((A, B, A, C)):
        watch.deadlines.touch(instance, now)
    assert len(watch.deadlines) == 2
    watch.run(150)
    assert {instance for _, instance in watch.missed} == {A, C}


def test_what_has_ended_or_stopped_is_not_due() -> None:
    watch = Watch()
    watch.deadlines.touch(A, 0)
    watch.deadlines.touch(B, 0)
    watch.deadlines.end(A)
    watch.run(120)
    assert watch.missed == [(1, B)]
    watch.deadlines.stop()
    watch.run(1000)
    assert watch.missed == [(1, B)]
    watch.deadlines.touch(C, 1000)
    watch.run(1100)
    assert watch.missed == [(1, B), (2, C)]


def test_the_strongest_owns_and_among_equals_the_lowest_guid() -> None:
    owners = Owners(10)
    for writer, strength in ((A, 1), (B, 1), (C, 5)):
        owners.add(writer, strength)
    assert [owners.admits(writer, b"x") for writer in (B, A, B, C, A)] == [True, True, False, True, False]
    assert owners.admits(B, b"y")
    owners.release(C)
    assert owners.admits(B, b"x")
    owners.drop(A)
    assert not owners.admits(A, b"x")
    owners.add(B, 0)
    owners.free(b"x")
    assert owners.admits(B, b"x")


def test_owners_are_remembered_for_so_many_instances() -> None:
    owners = Owners(2)
    owners.add(A, 1)
    owners.add(B, 2)
    for instance in (b"1", b"2", b"3"):
        assert owners.admits(B, instance)
    assert len(owners) == 2
    assert owners.admits(A, b"1")  # forgotten
    assert not owners.admits(A, b"3")
