"""The log of a manager, and its timer."""

import logging
import re
import threading
from pathlib import Path

import pytest

from muros.findings import Finding, Severity
from muros.rtc.formats import Fields
from muros.rtc.manager._logger import LEVELS, Log
from muros.rtc.manager._timer import Timer
from muros.rtc.properties import ConfError, Properties


def log(folder: Path, **texts: str) -> Log:
    properties = Properties({"file_name": f"{folder}/Rtc%p.log", **texts})
    return Log(properties, Fields(pid="4711", manager="m"), {})


def test_a_line(tmp_path: Path) -> None:
    one = log(tmp_path, date_format="%Y-%m-%d %H:%M:%S.%Q")
    one.child("Foo0").warning("%d left", 3)
    one.child("a.b").debug("not at this level")
    one.logger.info("plain")
    one.close()
    first, second = (tmp_path / "Rtc4711.log").read_text().splitlines()
    assert logging.getLevelName(logging.WARNING) == "WARNING"  # others' logs stay as they are
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3} WARN: Foo0: 3 left", first)
    assert second.endswith(" INFO: manager: plain")


@pytest.mark.parametrize("level", [name for name in LEVELS if name != "SILENT"])
def test_a_level_lets_through_itself_and_what_is_graver(tmp_path: Path, level: str) -> None:
    one = log(tmp_path, log_level=level.lower())
    for name, number in LEVELS.items():
        if name != "SILENT":
            one.logger.log(number, name)
    one.close()
    names = list(LEVELS)[1:]
    lines = (tmp_path / "Rtc4711.log").read_text().splitlines()
    assert [line.rpartition(" ")[2] for line in lines] == names[: names.index(level) + 1]


def test_silent_is_silent(tmp_path: Path) -> None:
    one = log(tmp_path, log_level="SILENT")
    one.logger.critical("x")
    one.close()
    assert (tmp_path / "Rtc4711.log").read_text() == ""


def test_no_log_at_all(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    one = log(tmp_path, enable="NO")
    one.logger.critical("x")
    one.close()
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")


def test_standard_output_and_files_together(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = log(tmp_path, file_name=f"stdout, {tmp_path}/a.log")
    one.finding(Finding("c", "Foo0", "Foo0 is full", remedy="Read it", severity=Severity.ERROR))
    one.close()
    out = capsys.readouterr().out
    assert "ERROR: finding: Foo0 is full." in out
    assert (tmp_path / "a.log").read_text() == out
    one.logger.error("after the end")
    assert capsys.readouterr().out == ""


def test_wrong_levels_and_files(tmp_path: Path) -> None:
    before = list(logging.getLogger("muros.rtc").handlers)
    with pytest.raises(ConfError, match="there is no 'LOUD'; the levels are SILENT, FATAL,"):
        log(tmp_path, log_level="LOUD")
    with pytest.raises(
        ConfError, match=r"logger.file_name: .*none/x.log cannot be written: No such file or directory"
    ):
        log(tmp_path, file_name=f"{tmp_path}/none/x.log")
    assert logging.getLogger("muros.rtc").handlers == before


def test_tasks_come_back_and_end() -> None:
    errors: list[Exception] = []
    timer = Timer(errors.append)
    thrice, once = threading.Semaphore(0), threading.Event()

    def task() -> None:
        thrice.release()
        raise ValueError("a task that raises goes on")

    cancel = timer.every(0.001, task)
    timer.after(0, once.set)
    assert once.wait(10)
    for _ in range(3):
        assert thrice.acquire(timeout=10)
    cancel()
    timer.close()
    assert len(errors) >= 3
    timer.after(0, lambda: errors.append(AssertionError("closed")))
    assert all(isinstance(error, ValueError) for error in errors)


def test_a_task_called_off_does_not_run() -> None:
    timer = Timer(lambda error: None)
    ran: list[str] = []
    done = threading.Event()
    timer.after(0.01, lambda: ran.append("called off"))()
    timer.after(0.02, done.set)
    assert done.wait(10)
    timer.close()
    assert ran == []


def test_a_task_may_close_the_timer() -> None:
    timer = Timer(lambda error: None)
    done = threading.Event()

    def task() -> None:
        timer.close()
        done.set()

    timer.after(0, task)
    assert done.wait(10)
    with pytest.raises(ValueError, match="more than 0"):
        timer.every(0, timer.close)
