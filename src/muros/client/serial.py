"""A serial port of a host to an agent, raw, 8N1, framed (see ``muros.xrce.serial``). Boards use ``uart``."""

import os
import termios

from muros.client.line import Line
from muros.compat import MPY, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

_MTU = const(512)
_CHUNK = const(128)
_VMIN = const(6)


class Serial(Line):
    """The port ``device`` at ``baud``. It need not be there yet, and may come and go.

    ``source`` and ``destination`` are the addresses on the line: a client's is 1, the agent's 0. Raises ValueError
    for a speed that the system does not have.
    """

    def __init__(
        self, device: str, baud: int = 115200, mtu: int = _MTU, source: int = 1, destination: int = 0
    ) -> None:
        self.device = device
        self._speed: int = getattr(termios, "B%d" % baud, -1)
        if self._speed < 0:
            raise ValueError("%d baud: this system has no such speed" % baud)
        super().__init__(mtu, source, destination, _CHUNK)

    def open(self) -> bool:
        """Opens the port; OSError when it is not there or not ours."""
        if self._file is None:
            file = _open(self.device)
            try:
                _make_raw(file.fileno(), self._speed)
            except OSError:
                file.close()
                raise
            self._attach(file, file.readinto, file.write)
        return True


if MPY:

    def _open(device):  # type: ignore[no-untyped-def]
        return open(device, "r+b", buffering=0)

    def _make_raw(fd, speed):  # type: ignore[no-untyped-def]
        termios.setraw(fd)
        attributes = termios.tcgetattr(fd)
        attributes[4] = attributes[5] = speed
        attributes[6][_VMIN] = 0  # what reads a file here asks again until its buffer is full
        termios.tcsetattr(fd, termios.TCSANOW, attributes)

else:

    def _open(device: str) -> "Any":
        fd = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        return open(fd, "r+b", buffering=0)

    def _make_raw(fd: int, speed: int) -> None:
        attributes = termios.tcgetattr(fd)
        attributes[0] = termios.IGNBRK
        attributes[1] = attributes[3] = 0
        attributes[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
        attributes[4] = attributes[5] = speed
        termios.tcsetattr(fd, termios.TCSANOW, attributes)
