"""Serial lines: one port or several in a link, awaited while absent and reopened when they come back.

The link keeps a list of wanted devices, paths or patterns. Every ``retry`` seconds, as long as something is missing or
a pattern is wanted, it looks what there is and opens what it does not have. A port that ends (the cable is
pulled, the far end hangs up) is closed and so missing again. Several clients can share a line: each is told by its
address byte.
"""

from __future__ import annotations

import asyncio
import glob
import os
from collections.abc import Sequence
from typing import ClassVar

from muros.links._door import Cause, LinkError
from muros.links._framing import MakeFraming, SerialFraming
from muros.links._line import QUEUE_BYTES, LineLink, Port
from muros.links._terminal import (
    AbsentError,
    baud_code,
    change_baud,
    close_terminal,
    open_terminal,
    serial_ports,
)

BAUD = 115200
"""Bits per second, as upstream agents have it by default."""
RETRY_S = 0.5
"""How often an absent port is looked for, in seconds."""

_ABSENT = "there is no such device now"
_FILE_BYTES = 65536


class SerialLink(LineLink):
    """The serial port ``devices``, or several of them; patterns such as ``/dev/ttyACM*`` take whatever is plugged in.

    Lines are raw 8N1 at ``baud`` bits per second. An address is a `LineAddress`. ``queue_bytes`` bounds what waits
    for each port, ``retry`` is the time in seconds between looks for absent ports. ``make_framing`` cuts the
    lines: XRCE's frames by default. `open` raises `LinkError` when a device named without a pattern is there but
    cannot be used; one that is not there is awaited.
    """

    kind: ClassVar[str] = "serial"

    def __init__(
        self,
        devices: str | Sequence[str],
        baud: int = BAUD,
        *,
        queue_bytes: int = QUEUE_BYTES,
        retry: float = RETRY_S,
        make_framing: MakeFraming = SerialFraming,
    ) -> None:
        super().__init__(queue_bytes, make_framing)
        self.devices = (devices,) if isinstance(devices, str) else tuple(devices)
        self.baud = baud
        self._retry = retry
        self._told: dict[str, str] = {}
        self._bauds: dict[str, int] = {}
        self._timer: asyncio.TimerHandle | None = None

    @property
    def name(self) -> str:
        kind = "serial" if len(self.devices) == 1 else "multiserial"
        return f"{kind} {' '.join(self.devices)} at {self.baud}"

    def baud_of(self, device: str) -> int:
        """The rate of one of the ports in bits per second."""
        return self._bauds.get(device, self.baud)

    def set_baud(self, device: str, baud: int) -> None:
        """Gives one of the ports a rate of its own, now and whenever it is opened again. Raises `LinkError`."""
        port = self._ports.get(device)
        if port is None:
            baud_code(device, baud)
        else:
            change_baud(device, port.fd, baud)
        self._bauds[device] = baud

    def _open(self) -> None:
        if not self.devices:
            raise LinkError(self.name, "no device is named", "Name one, such as /dev/ttyUSB0.")
        baud_code(self.name, self.baud)
        self._look(first=True)

    def _close(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        super()._close()
        self._told.clear()

    def _noise_remedy(self) -> str:
        return f"Check that the board sends at {self.baud} baud, then cable, ground and level."

    def _look(self, first: bool = False) -> None:
        """Opens what is wanted, there and not open yet; comes back while that may change."""
        self._timer = None
        for wanted in self.devices:
            pattern = glob.has_magic(wanted)
            devices = sorted(glob.glob(wanted)) if pattern else [wanted]
            if first and not devices:
                self._say_once(wanted, _absent())
            for device in devices:
                if not self.is_open:  # a handler has closed the link
                    return
                if device not in self._ports and os.path.realpath(device) not in self._real_paths():
                    self._try(device, strict=first and not pattern)
        if self.is_open and self._timer is None and self._incomplete():
            self._timer = asyncio.get_running_loop().call_later(self._retry, self._look)

    def _incomplete(self) -> bool:
        return any(
            glob.has_magic(wanted) or (wanted not in self._ports and not self._double(wanted))
            for wanted in self.devices
        )

    def _double(self, device: str) -> bool:
        return os.path.realpath(device) in self._real_paths()

    def _real_paths(self) -> set[str]:
        return {port.real_path for port in self._ports.values()}

    def _try(self, device: str, strict: bool) -> None:
        try:
            fd = open_terminal(device, self.baud_of(device))
        except AbsentError:
            self._say_once(device, _absent())
            return
        except LinkError as error:
            if strict:
                raise
            self._say_once(device, Cause("port-unusable", error.why, error.remedy))
            return
        self._told.pop(device, None)
        port = self._ports[device] = Port(self, device, fd, close_terminal)
        self._opened(port, f"{device} at {self.baud_of(device)}")

    def _say_once(self, device: str, cause: Cause) -> None:
        """Says once why a port does not open, not at every look."""
        if self._told.get(device) != cause.why:
            self._told[device] = cause.why
            self._problem(cause, f"{device} is not open")

    def _ended(self, port: Port, reason: str) -> None:
        pulled = not os.path.exists(port.device)
        why = f"cable pulled: {port.device} is gone" if pulled else f"{port.device} hung up ({reason})"
        self._told[port.device] = _ABSENT  # on_down says so
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(self._retry, self._look)
        super()._ended(port, why)


def _absent() -> Cause:
    others = ", ".join(serial_ports()) or "none"
    remedy = f"Plug it in: it is taken as soon as it appears. Ports that are here now: {others}."
    return Cause("port-absent", _ABSENT, remedy)


def devices_from_file(path: str, *, several: bool = False) -> list[str]:
    """The device named in the first line of the file ``path``; with ``several``, one in each line.

    Raises `LinkError` when the file cannot be read or names none.
    """
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            lines = [line.strip() for line in file.read(_FILE_BYTES).splitlines()]
    except OSError as error:
        raise LinkError(
            path, error.strerror or str(error), "Name a file whose first line is a device."
        ) from error
    devices = [line for line in (lines if several else lines[:1]) if line]
    if not devices:
        raise LinkError(path, "names no device", "Write a device such as /dev/ttyUSB0 into its first line.")
    return devices
