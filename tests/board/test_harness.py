"""The harness itself: a broken one would let every other test of this folder pass."""

from muros.compat import MPY
from tests.board.harness import allocates, raises


def test_raises_lets_the_expected_exception_pass() -> None:
    with raises(OSError) as caught:
        raise OSError(11)
    assert isinstance(caught.value, OSError)


def test_raises_complains_when_nothing_is_raised() -> None:
    complained = False
    try:
        with raises(OSError):
            pass
    except AssertionError:
        complained = True
    assert complained


def test_raises_lets_other_exceptions_through() -> None:
    seen = False
    try:
        with raises(OSError):
            raise ValueError
    except ValueError:
        seen = True
    assert seen


def test_allocates_sees_an_allocation() -> None:
    used = allocates(lambda: bytearray(100))
    assert used >= 100 if MPY else used == 0


def test_allocates_sees_nothing_where_there_is_nothing() -> None:
    assert allocates(lambda: None) == 0
