"""Logging on hosts: it shows on standard error, knows where in the program it was called, and takes any text."""

from __future__ import annotations

import sys
import threading
import time as clock
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

from muros.rclc import logger
from muros.rclc.host.checks import WrongValueError

if TYPE_CHECKING:
    from muros.rclc.host.context import Node

LEVELS = {"debug": 10, "info": 20, "warn": 30, "error": 40, "fatal": 50}


class _Thread(threading.local):
    busy = False


class Logger(logger.Logger):
    """Made by ``Node.logger``; see ``muros.rclc.logger.Logger``. Any thread may log."""

    def __init__(self, *arguments: Any) -> None:
        self._thread = _Thread()
        super().__init__(*arguments)

    @property
    def _busy(self) -> bool:
        """Whether this thread publishes a text right now."""
        return self._thread.busy

    @_busy.setter
    def _busy(self, busy: bool) -> None:
        self._thread.busy = busy

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
    level: int | str | None,
    time: Callable[[], tuple[int, int]] | None,
    show: Callable[[str], object] | None,
    services: bool,
) -> Logger:
    """A logger of a node. Raises ValueError for a level that there is not."""
    arguments = node.context.arguments
    name = logger.name_of(node)
    if level is None:
        level = arguments.level(name) or logger.INFO
    number = LEVELS.get(level, 0) if isinstance(level, str) else level
    if not isinstance(number, int) or not 1 <= number <= 255:
        raise WrongValueError(f"level is {level!r}: it must be one of {', '.join(LEVELS)}")
    kind = import_module("muros.interfaces").message("rcl_interfaces/msg/Log")
    if not arguments.stdout and show is show_on_stderr:
        show = None
    publisher = node.publisher(kind, "/rosout", "rosout") if arguments.rosout else _Nowhere()
    made = Logger(name, publisher, kind, number, time or system_time, show)
    loggers = node.__dict__.setdefault("_loggers", [])
    loggers.append(made)
    if services and node.resolve_service("~/get_logger_levels") not in node.context.services:
        LevelServices(node, loggers)
    return made


class LevelServices:
    """The two services by which others ask for the levels of a node's loggers, and set them."""

    def __init__(self, node: Node, loggers: list[Logger]) -> None:
        interfaces = import_module("muros.interfaces")
        self._loggers = loggers
        self._level = interfaces.message("rcl_interfaces/msg/LoggerLevel")
        self._result = interfaces.message("rcl_interfaces/msg/SetLoggerLevelsResult")
        self._get = interfaces.service("rcl_interfaces/srv/GetLoggerLevels")
        self._set = interfaces.service("rcl_interfaces/srv/SetLoggerLevels")
        node.service(self._get, "~/get_logger_levels", self.get, "parameters")
        node.service(self._set, "~/set_logger_levels", self.set, "parameters")

    def get(self, request: Any) -> Any:
        """GetLoggerLevels: 0, unset, for a logger that is none of the node's."""
        levels = {made.name: made.level for made in self._loggers}
        answers = [self._level(name=name, level=levels.get(name, 0)) for name in request.names]
        return self._get.Response(levels=answers)

    def set(self, request: Any) -> Any:
        """SetLoggerLevels: each by itself."""
        return self._set.Response(results=[self._set_one(asked) for asked in request.levels])

    def _set_one(self, asked: Any) -> Any:
        found = [made for made in self._loggers if made.name == asked.name]
        if not found:
            names = ", ".join(sorted({made.name for made in self._loggers}))
            return self._result(successful=False, reason=f"no logger {asked.name!r} here, only {names}")
        level = asked.level or logger.INFO  # 0 unsets it
        if not 1 <= level <= 255:
            return self._result(successful=False, reason=f"there is no level {level}")
        for made in found:
            made.level = level
        return self._result(successful=True, reason="")


class _Nowhere:
    """What a logger publishes to with ``--disable-rosout-logs``."""

    def publish(self, message: Any, /) -> bool:
        """Drops it."""
        return True

    def destroy(self) -> None:
        """There is nothing."""


def system_time() -> tuple[int, int]:
    """The system's time in seconds and nanoseconds."""
    return divmod(clock.time_ns(), 1_000_000_000)


def show_on_stderr(line: str) -> None:
    """Prints a line; a program without a standard error does without."""
    if sys.stderr is not None:
        print(line, file=sys.stderr, flush=True)


_OURS = (__file__, logger.__file__)
