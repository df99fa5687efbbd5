"""Logging on hosts: it shows on standard error, knows where in the program it was called, and takes any text."""

from __future__ import annotations

import sys
import time as clock
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

from muros.rclc import logger
from muros.rclc.host_checks import WrongValueError

if TYPE_CHECKING:
    from muros.rclc.hosts import Node

LEVELS = {"debug": 10, "info": 20, "warn": 30, "error": 40, "fatal": 50}


class Logger(logger.Logger):
    """Made by ``Node.logger``; see ``muros.rclc.logger.Logger``."""

    def log(self, level: int, text: str) -> bool:
        """Publishes a text of a level, and whatever else is given as its text. Raises ValueError for no level."""
        if not isinstance(level, int) or not 1 <= level <= 255:
            raise WrongValueError(f"level is {level!r}: it must be a number from 10 (debug) to 50 (fatal)")
        return super().log(level, str(text))

    def locate(self, message: Any) -> None:
        """Says where in the program this is."""
        frame = sys._getframe(1)
        while frame.f_back is not None and frame.f_code.co_filename in _OURS:
            frame = frame.f_back
        message.file = frame.f_code.co_filename
        message.function = frame.f_code.co_name
        message.line = frame.f_lineno


def make(
    node: Node,
    level: int | str,
    time: Callable[[], tuple[int, int]] | None,
    show: Callable[[str], object] | None,
) -> Logger:
    """A logger of a node. Raises ValueError for a level that there is not."""
    number = LEVELS.get(level, 0) if isinstance(level, str) else level
    if not isinstance(number, int) or not 1 <= number <= 255:
        raise WrongValueError(f"level is {level!r}: it must be one of {', '.join(LEVELS)}")
    kind = import_module("muros.interfaces").message("rcl_interfaces/msg/Log")
    made = logger.begin(Logger, node, kind, number, time or system_time, show)
    assert isinstance(made, Logger)
    return made


def system_time() -> tuple[int, int]:
    """The system's time in seconds and nanoseconds."""
    return divmod(clock.time_ns(), 1_000_000_000)


def show_on_stderr(line: str) -> None:
    """Prints a line; a program without a standard error does without."""
    if sys.stderr is not None:
        print(line, file=sys.stderr, flush=True)


_OURS = (__file__, logger.__file__)
