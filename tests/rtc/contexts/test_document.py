"""The programs of the guide to execution contexts do what is said of them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from muros.rtc.component import Component
from muros.rtc.contexts import CONTEXT_TYPES, ContextOptions, context_specs, make_contexts
from tests.test_guides import Guided, programs

ROOT = Path(__file__).resolve().parents[3]
DOCUMENT = "docs/rtc-contexts.md"

LINES = {
    0: [
        "torque on", "RTC_OK ACTIVE_STATE", "on_execute of Gripper0 raised: ValueError: finger is hot", "torque off",
        "ERROR_STATE", "PRECONDITION_NOT_MET", "checked", "RTC_OK INACTIVE_STATE",
    ],
    1: [r"\d+ Hz, \d+ missed, late by \d+ us \(median\)"],
}  # fmt: skip


@pytest.mark.parametrize("number", LINES)
def test_it_prints_what_it_must(number: int, tmp_path: Path) -> None:
    running = Guided(programs(DOCUMENT)[number], 0, tmp_path)
    try:
        assert running.end() == (0, "")
        assert len(running.lines) == len(LINES[number])
        for line, pattern in zip(running.lines, LINES[number], strict=True):
            assert line == pattern or re.fullmatch(pattern, line), line
    finally:
        running.stop()


def test_no_program_goes_untested() -> None:
    assert len(programs(DOCUMENT)) == len(LINES)


def test_every_kind_and_option_is_there() -> None:
    text = (ROOT / DOCUMENT).read_text()
    for name in CONTEXT_TYPES:
        assert f"`{name}`" in text
    defaults = ContextOptions()
    assert f"| {defaults.patience:g} |" in text
    assert f"| {defaults.activation_timeout:g} |" in text
    named = re.findall(r"^\| (`[a-z_]+`(?:, `[a-z_]+`)*)", text, re.MULTILINE)
    options = {name for cell in named for name in re.findall(r"`(\w+)`", cell)} & set(_options())
    assert options == set(_options())


def test_the_lines_for_rtc_conf_mean_what_they_say() -> None:
    one, several, _ = re.findall(r"```text\n(.*?)```", (ROOT / DOCUMENT).read_text(), re.DOTALL)
    (context,) = make_contexts(_properties(one))
    assert (context.type_name, context.rate) == ("PeriodicExecutionContext", 1000.0)
    specs = context_specs({**Component.spec(), **_properties(several)})
    assert [(spec.name, spec.texts["rate"]) for spec in specs] == [("fast", "1000"), ("slow", "10")]


def _properties(text: str) -> dict[str, str]:
    return dict(line.split(": ", 1) for line in text.splitlines())


def _options() -> tuple[str, ...]:
    from muros.rtc.contexts._registry import _INHERITED

    return ("rate", *(key for key in _INHERITED if key not in ("deactivation_timeout", "reset_timeout")))
