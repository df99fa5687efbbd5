"""A serial port of a host to an agent, raw, 8N1, framed (see ``muros.xrce.serial``). Boards use ``uart``."""

import errno
import os
import select
import termios

from muros.compat import MPY, const, ticks_diff, ticks_ms
from muros.xrce.serial import SerialDeframer, SerialFramer

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client._types import Deliver
    from muros.xrce._types import Buffer

_MTU = const(512)
_CHUNK = const(128)
_AT_ONCE = const(16)
_PATIENCE = const(2000)  # ms that the line may take none of our bytes
_POLLIN = const(1)
_POLLOUT = const(4)
_VMIN = const(6)


class Serial:
    """The port ``device`` at ``baud``. It need not be there yet, and may come and go.

    ``source`` and ``destination`` are the addresses on the line: a client's is 1, the agent's 0. Raises ValueError
    for a speed that the system does not have.
    """

    def __init__(
        self, device: str, baud: int = 115200, mtu: int = _MTU, source: int = 1, destination: int = 0
    ) -> None:
        self.mtu = mtu
        self.device = device
        self._speed: int = getattr(termios, "B%d" % baud, -1)
        if self._speed < 0:
            raise ValueError("%d baud: this system has no such speed" % baud)
        self.deframer = SerialDeframer(source, mtu)
        self._framer = SerialFramer(source, destination, self._write)
        self._rx = bytearray(_CHUNK)
        self._file: "Any" = None
        self._deliver: "Deliver | None" = None
        self._taken = 0
        self.deframer.on_frame = self._on_frame

    def open(self) -> bool:
        """Opens the port; OSError when it is not there or not ours."""
        if self._file is None:
            file = _open(self.device)
            try:
                _make_raw(file.fileno(), self._speed)
            except OSError:
                file.close()
                raise
            self._poll = select.poll()
            self._poll.register(file, _POLLIN)
            self._file = file
        return True

    def close(self) -> None:
        """Closes the port."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Sends a message as one frame. A port that takes nothing for two seconds is closed."""
        if self._file is not None:
            self._framer.send(buf, off, n)

    def receive(self, deliver: "Deliver") -> int:
        """Delivers what has come, from up to 16 reads of 128 bytes; OSError when the port is gone."""
        if self._file is None:
            raise OSError(errno.ENODEV)
        self._deliver = deliver
        self._taken = 0
        for _ in range(_AT_ONCE):
            if not self._ready(_POLLIN, 0):
                break
            try:
                n = self._file.readinto(self._rx)
            except OSError as error:
                if error.errno == errno.EAGAIN:
                    break
                self.close()
                raise
            if not n:
                if n == 0:  # the far end of a pseudoterminal, or the adapter, is gone
                    self.close()
                    raise OSError(errno.ENODEV)
                break
            self.deframer.feed(self._rx, n)
        return self._taken

    def wait(self, timeout: int) -> None:
        """Waits until bytes are there, at most ``timeout`` ms."""
        self._ready(_POLLIN, timeout)

    def _on_frame(self, buf: bytearray, off: int, n: int, source: int) -> None:
        self._taken += 1
        if self._deliver is not None:
            self._deliver(buf, off, n)

    def _ready(self, event: int, timeout: int) -> bool:
        if event == _POLLOUT:
            self._poll.modify(self._file, _POLLOUT)
            ready = bool(self._poll.poll(timeout))
            self._poll.modify(self._file, _POLLIN)
            return ready
        if not MPY:
            return bool(self._poll.poll(timeout))
        for _ in self._poll.ipoll(timeout):
            return True
        return False

    def _write(self, buf: bytearray, n: int) -> None:
        start = ticks_ms()
        done = 0
        while done < n and self._file is not None:
            try:
                got = _write_some(self._file, buf, done, n)
            except OSError as error:
                if error.errno != errno.EAGAIN:
                    self.close()
                    break
                got = 0
            done += got
            if not got:
                if ticks_diff(ticks_ms(), start) > _PATIENCE:
                    self.close()
                    break
                self._ready(_POLLOUT, 10)


if MPY:

    def _open(device):  # type: ignore[no-untyped-def]
        return open(device, "r+b", buffering=0)

    def _make_raw(fd, speed):  # type: ignore[no-untyped-def]
        termios.setraw(fd)
        attributes = termios.tcgetattr(fd)
        attributes[4] = attributes[5] = speed
        attributes[6][_VMIN] = 0  # what reads a file here asks again until its buffer is full
        termios.tcsetattr(fd, termios.TCSANOW, attributes)

    def _write_some(file, buf, start, n):  # type: ignore[no-untyped-def]
        return file.write(buf, start, n - start)

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

    def _write_some(file: "Any", buf: bytearray, start: int, n: int) -> int:
        return file.write(memoryview(buf)[start:n]) or 0
