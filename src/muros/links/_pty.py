"""A pseudoterminal: a serial line without hardware, for programs and emulators that expect a device.

The link keeps the far end open itself. So the line survives programs that come, go and come back there; without
that the system would report the end of the line at the first close.
"""

from __future__ import annotations

import os
from contextlib import suppress
from typing import ClassVar

from muros.links._door import LinkError
from muros.links._framing import MakeFraming, SerialFraming
from muros.links._line import QUEUE_BYTES, LineLink, Port
from muros.links._terminal import make_raw


class PseudoterminalLink(LineLink):
    """A new pseudoterminal; `device` is the path of its far end, and ``symlink`` a lasting name for that.

    The far end is raw. What nobody reads there waits in the kernel and in ``queue_bytes``, then is dropped. `open`
    raises `LinkError` when the system has no pseudoterminal left or the symlink cannot be made; something other
    than a symlink is never replaced.
    """

    kind: ClassVar[str] = "pseudoterminal"

    def __init__(
        self,
        symlink: str | None = None,
        *,
        queue_bytes: int = QUEUE_BYTES,
        make_framing: MakeFraming = SerialFraming,
    ) -> None:
        super().__init__(queue_bytes, make_framing)
        self.symlink = symlink
        self._device: str | None = None

    @property
    def name(self) -> str:
        places = [place for place in (self.symlink, self._device) if place]
        return " ".join([self.kind, *places])

    @property
    def device(self) -> str | None:
        """The path of the far end, for the program on the other side to open; None while the link is closed."""
        return self._device

    def _open(self) -> None:
        try:
            near, far = os.openpty()
        except OSError as error:
            remedy = "See /proc/sys/kernel/pty/max and whether /dev/pts is mounted."
            raise LinkError(self.name, error.strerror or str(error), remedy) from error

        def close(fd: int) -> None:
            os.close(fd)
            os.close(far)

        os.set_blocking(near, False)
        make_raw(far)
        self._device = os.ttyname(far)
        port = self._ports[self._device] = Port(self, self._device, near, close)
        self._link_far_end()
        self._opened(port, self.name)

    def _close(self) -> None:
        super()._close()
        if self.symlink is not None and self._device is not None:
            with suppress(OSError):
                if os.readlink(self.symlink) == self._device:
                    os.unlink(self.symlink)
        self._device = None

    def _link_far_end(self) -> None:
        if self.symlink is None or self._device is None:
            return
        try:
            if os.path.islink(self.symlink):
                os.unlink(self.symlink)
            os.symlink(self._device, self.symlink)
        except OSError as error:
            remedy = "Choose another path for the symlink, in a directory that you may write."
            raise LinkError(self.symlink, error.strerror or str(error), remedy) from error
