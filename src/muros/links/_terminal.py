"""Opening a terminal device as a raw 8N1 line, with errors that say what to do."""

from __future__ import annotations

import errno
import fcntl
import grp
import os
import termios
from bisect import bisect
from contextlib import suppress
from pathlib import Path

from muros.links._door import LinkError
from muros.links._hosts import file_holder

_ABSENT = frozenset({errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.ENOTDIR, errno.EIO})
_CFLAG = 2
_SPEEDS = slice(4, 6)
_CONTROL = 6

BAUD_RATES: dict[int, int] = {
    int(name[1:]): getattr(termios, name)
    for name in dir(termios)
    if name[0] == "B" and name[1:].isdecimal() and name != "B0"  # B0 hangs up
}
"""Bits per second that a line can have here, and the terminal's code for each."""


class AbsentError(Exception):
    """The device is not there (yet)."""


def baud_code(where: str, baud: int) -> int:
    """The terminal's code for ``baud`` bits per second; raises `LinkError` naming the nearest ones."""
    code = BAUD_RATES.get(baud)
    if code is not None:
        return code
    rates = sorted(BAUD_RATES)
    at = bisect(rates, baud)
    near = " or ".join(str(rate) for rate in rates[max(0, at - 1) : at + 1])
    raise LinkError(where, f"{baud} is not a baud rate that serial ports have", f"Nearest: {near}.")


def open_terminal(device: str, baud: int) -> int:
    """Opens ``device`` raw, 8N1, without flow control, non-blocking, for us alone; returns the descriptor.

    Raises `AbsentError` when there is no such device now and `LinkError` when there is one that cannot be used.
    """
    code = baud_code(device, baud)
    try:
        fd = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise _open_error(device, error) from error
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        make_raw(fd, code)
        termios.tcflush(fd, termios.TCIFLUSH)  # what came before the line was set up is not in frames
        if termios.tcgetattr(fd)[_SPEEDS] != [code, code]:
            raise LinkError(device, f"its driver refuses {baud} baud", "Choose a rate that the device has.")
    except termios.error as error:
        os.close(fd)
        number = int(error.args[0])
        if number in _ABSENT:
            raise AbsentError(device) from error
        why = "is not a serial port" if number in (errno.ENOTTY, errno.EINVAL) else str(error.args[1])
        raise LinkError(device, why, "Name a terminal device such as /dev/ttyUSB0.") from error
    except OSError as error:
        os.close(fd)
        raise _open_error(device, error) from error
    except BaseException:
        os.close(fd)
        raise
    return fd


def change_baud(device: str, fd: int, baud: int) -> None:
    """Gives an open line another rate; what came before at the old one is thrown away. Raises `LinkError`."""
    code = baud_code(device, baud)
    try:
        make_raw(fd, code)
        termios.tcflush(fd, termios.TCIFLUSH)
    except termios.error as error:
        raise LinkError(device, str(error.args[1]), "Choose a rate that the device has.") from error


def close_terminal(fd: int) -> None:
    """Closes at once: without the flush a line that takes no data would hold us up for half a minute."""
    with suppress(termios.error):
        termios.tcflush(fd, termios.TCOFLUSH)
    with suppress(OSError):
        os.close(fd)


def make_raw(fd: int, code: int | None = None) -> None:
    """Makes the terminal pass every byte unchanged, 8N1; ``code`` is a value of `BAUD_RATES`."""
    settings = termios.tcgetattr(fd)
    keep = settings[_CFLAG] & termios.HUPCL
    settings[:4] = [0, 0, keep | termios.CS8 | termios.CREAD | termios.CLOCAL, 0]
    if code is not None:
        settings[_SPEEDS] = [code, code]
    settings[_CONTROL][termios.VMIN] = 1
    settings[_CONTROL][termios.VTIME] = 0
    termios.tcsetattr(fd, termios.TCSANOW, settings)


def serial_ports() -> list[str]:
    """The plugged-in serial ports of this host, those on USB first."""
    return [str(path) for pattern in ("ttyUSB*", "ttyACM*", "ttyAMA*", "rfcomm*") for path in _ports(pattern)]


def _ports(pattern: str) -> list[Path]:
    return sorted(Path("/dev").glob(pattern))


def _open_error(device: str, error: OSError) -> AbsentError | LinkError:
    if error.errno in _ABSENT:
        return AbsentError(device)
    if error.errno in (errno.EACCES, errno.EPERM):
        return LinkError(device, "permission denied", _permission_remedy(device))
    if error.errno in (errno.EBUSY, errno.EWOULDBLOCK):
        holder = file_holder(device)
        by = f" by {holder}" if holder else ""
        return LinkError(device, f"in use{by}", "Stop the program that has it open.")
    return LinkError(device, error.strerror or str(error), "Name a terminal device such as /dev/ttyUSB0.")


def _permission_remedy(device: str) -> str:
    try:
        group = grp.getgrgid(os.stat(device).st_gid)
    except (OSError, KeyError):
        return "Ask for the right to use it."
    if group.gr_gid in (os.getgid(), *os.getgroups()) or group.gr_name == "root":
        return f"Its mode forbids it: see ls -l {device}."
    return f"You are not in group {group.gr_name}: sudo usermod -aG {group.gr_name} $USER, then log in again."
