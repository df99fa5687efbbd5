"""muros.compat gives the same answers on every runtime."""

from muros.compat import copy, ticks_add, ticks_diff, ticks_ms, ticks_us
from tests.board.harness import allocates


def test_ticks_move_forwards() -> None:
    start = ticks_ms()
    assert ticks_diff(ticks_ms(), start) >= 0
    start = ticks_us()
    assert ticks_diff(ticks_us(), start) >= 0


def test_ticks_add_and_diff_are_inverse() -> None:
    now = ticks_ms()
    for delta in (0, 1, 1000, 0x1FFFFFF0):
        assert ticks_diff(ticks_add(now, delta), now) == delta
        assert ticks_diff(now, ticks_add(now, delta)) == -delta


def test_copy_moves_exactly_n_bytes() -> None:
    target = bytearray(b"........")
    copy(target, 2, b"abcdef", 1, 3)
    assert bytes(target) == b"..bcd..."


def test_copy_of_nothing_changes_nothing() -> None:
    target = bytearray(b"..")
    copy(target, 2, b"abc", 3, 0)
    assert bytes(target) == b".."


def test_copy_and_ticks_do_not_allocate() -> None:
    target = bytearray(32)
    source = bytearray(32)

    def call() -> None:
        copy(target, 0, source, 8, 16)
        ticks_diff(ticks_add(5, 7), 3)

    assert allocates(call) == 0
