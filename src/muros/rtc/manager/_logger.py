"""The log of a manager and its components, on Python's `logging`: levels, files and forms as `rtc.conf` says.

All of the room logs under the logger `muros.rtc`; `logger("muros.rtc").getChild("Foo0")` is that of a component. Levels
are those of the RTC world; the finer ones lie below DEBUG.
"""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from muros.findings import Finding, Severity
from muros.rtc.formats import Fields, expand
from muros.rtc.properties import ConfError, Properties, is_yes, split_list

__all__ = ["LEVELS", "LOGGER_NAME", "Log"]

LOGGER_NAME: Final = "muros.rtc"
"""The logger above those of managers and components."""

LEVELS: Final[Mapping[str, int]] = {
    "SILENT": logging.CRITICAL + 10,
    "FATAL": logging.CRITICAL,
    "ERROR": logging.ERROR,
    "WARN": logging.WARNING,
    "INFO": logging.INFO,
    "DEBUG": logging.DEBUG,
    "TRACE": 8,
    "VERBOSE": 6,
    "PARANOID": 4,
}
"""Names of levels as `logger.log_level` has them. SILENT lets nothing through."""

_NAMES: Final = {number: name for name, number in LEVELS.items()}

SEVERITIES: Final = {
    Severity.INFO: logging.INFO,
    Severity.WARNING: logging.WARNING,
    Severity.ERROR: logging.ERROR,
}


class Log:
    """Where the log goes: opens the files that `logger.*` names, and closes them.

    ConfError for a level that there is none of, and for a file that cannot be written.
    """

    def __init__(
        self, properties: Properties, fields: Fields, environment: Mapping[str, str] | None = None
    ) -> None:
        self.logger: Final = logging.getLogger(LOGGER_NAME)
        self._handlers: list[logging.Handler] = [logging.NullHandler()]
        self._level_before = self.logger.level
        level = level_of(properties.get("log_level", "INFO"))
        if is_yes(properties.get("enable", "YES")):
            form = _LineFormatter(properties.get("date_format", ""))
            for name in split_list(properties.get("file_name", "")):
                handler = _open(expand(name, fields, os.environ if environment is None else environment))
                handler.setFormatter(form)
                self._handlers.append(handler)
        for handler in self._handlers:
            handler.setLevel(level)
            self.logger.addHandler(handler)
        self.logger.setLevel(level)

    def child(self, name: str) -> logging.Logger:
        """The logger of a component or of a part of the manager."""
        return self.logger.getChild(name.replace(".", "_"))

    def finding(self, finding: Finding) -> None:
        """Log a finding, for `Findings.on_finding`."""
        level = SEVERITIES[finding.severity]
        if self.logger.isEnabledFor(level):
            self.logger.getChild("finding").log(level, "%s", finding.format().removeprefix("finding: "))

    def close(self) -> None:
        """Write what is left and let go of the files."""
        for handler in self._handlers:
            self.logger.removeHandler(handler)
            handler.close()
        self._handlers.clear()
        self.logger.setLevel(self._level_before)


def level_of(text: str) -> int:
    """The level of Python's logging for a name of `rtc.conf`. ConfError for an unknown one."""
    try:
        return LEVELS[text.strip().upper()]
    except KeyError:
        raise ConfError(
            f"logger.log_level: there is no {text!r}; the levels are {', '.join(LEVELS)}"
        ) from None


class _LineFormatter(logging.Formatter):
    """`Nov 21 23:10:15 INFO: Foo0: message`; the date is that of `logger.date_format`, `%Q` in it milliseconds."""

    def __init__(self, date_format: str) -> None:
        super().__init__("%(asctime)s %(level)s: %(source)s: %(message)s")
        self._date_format = date_format or "%b %d %H:%M:%S"

    def formatTime(self, record: logging.LogRecord, datefmt: str | None = None) -> str:  # noqa: N802
        form = self._date_format.replace("%Q", f"{int(record.msecs):03d}").replace("%q", "000")
        return time.strftime(form, time.localtime(record.created))

    def format(self, record: logging.LogRecord) -> str:
        # Names of levels are the process's; only these lines have those of the RTC world.
        record.level = _NAMES.get(record.levelno, record.levelname)
        record.source = record.name.removeprefix(LOGGER_NAME).lstrip(".") or "manager"
        return super().format(record)


def _open(name: str) -> logging.Handler:
    if name.lower() in ("stdout", "stderr"):
        return logging.StreamHandler(sys.stdout if name.lower() == "stdout" else sys.stderr)
    try:
        return logging.FileHandler(Path(name), encoding="utf-8", errors="backslashreplace")
    except OSError as error:
        raise ConfError(
            f"logger.file_name: {name} cannot be written: {error.strerror}; name another file, or stdout"
        ) from error
