"""Formats of names."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rtc.formats import Fields, expand

FIELDS = Fields("Foo0", "Foo", "1.2", "AIST", "test", "robot", "manager", "4711")


@pytest.mark.parametrize(
    ("form", "text"),
    [
        ("%h.host_cxt/%n.rtc", "robot.host_cxt/Foo0.rtc"),
        ("%t %m %v %V %c %M", "Foo Foo 1.2 AIST test manager"),
        ("./rtc%p.log", "./rtc4711.log"),
        ("100%%", "100%"),
        ("%%n", "%n"),
        ("%x %", "%x %"),
        ("a${ROOM}b%n", "akitchenbFoo0"),
        ("${NONE}%n", "Foo0"),
        ("${open %n", "${open Foo0"),
    ],
)
def test_letters_and_variables(form: str, text: str) -> None:
    assert expand(form, FIELDS, {"ROOM": "kitchen"}) == text


def test_what_is_filled_in_is_not_looked_at_again() -> None:
    assert expand("%n ${A}", Fields(instance="%p${A}", pid="1"), {"A": "%n"}) == "%p${A} %n"


@given(st.text(st.characters(exclude_characters="%$")))
def test_a_text_without_letters_stands_for_itself(form: str) -> None:
    assert expand(form, FIELDS, {}) == form
