"""The programs of the guide to state machines do what is said of them."""

from __future__ import annotations

from pathlib import Path

from tests.test_guides import Guided, programs

LINES = ["locked", "open for 50 cents", "locked", "4 events, now Locked"]


def test_a_machine_turns(tmp_path: Path) -> None:
    machine, _ = programs("docs/rtc-state-machines.md")
    running = Guided(machine, 0, tmp_path)
    try:
        assert running.end() == (0, "")
        assert running.lines == LINES
    finally:
        running.stop()


def test_a_component_has_one(tmp_path: Path) -> None:
    machine, component = programs("docs/rtc-state-machines.md")
    machine, _, _ = machine.partition("machine = Machine")
    (tmp_path / "turnstile.py").write_text(machine.replace("cents += cents", "cents += cents.data"))
    source = component.replace(
        "    run(Gate)", "    print([e.name for e in Gate.machine.top.__subclasses__()] == [])"
    )
    running = Guided(source, 0, tmp_path)
    try:
        assert running.end() == (0, "")
        assert running.lines == ["True"]
    finally:
        running.stop()
