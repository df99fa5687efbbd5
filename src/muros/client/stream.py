"""What transports over a file or a socket share: waiting for it, reading what is there, writing all of it.

It may be closed at any moment: by a write that fails while messages are taken, or by what a message tells a program.
So every step looks first whether it is still there.
"""

import errno
import select

from muros.compat import MPY, const, ticks_diff, ticks_ms

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.xrce._types import Buffer

_POLLIN = const(1)
_POLLOUT = const(4)
_PATIENCE = const(2000)  # ms that the system may take none of our bytes


class Stream:
    """``_file`` is the file or socket, None while it is closed; ``_get`` reads from it and ``_put`` writes to it.

    ``_gone`` is the error when it is there no more.
    """

    _file: "Any" = None
    _get: "Any" = None
    _put: "Any" = None
    _gone = errno.ECONNRESET

    def close(self) -> None:
        """Closes it."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def wait(self, timeout: int) -> None:
        """Waits until something has come, at most ``timeout`` ms."""
        self._readable(timeout)

    def _attach(self, file: "Any", get: "Any", put: "Any") -> None:
        self._poll = select.poll()
        self._poll.register(file, _POLLIN)
        self._file = file
        self._get = get
        self._put = put

    def _readable(self, timeout: int) -> bool:
        if self._file is not None:
            if not MPY:
                return bool(self._poll.poll(timeout))
            for _ in self._poll.ipoll(timeout):
                return True
        return False

    def _writable(self, timeout: int) -> int:
        """The events of the file when bytes can be written to it, or when it is gone; 0 for neither."""
        self._poll.modify(self._file, _POLLOUT)
        ready = self._poll.poll(timeout)
        self._poll.modify(self._file, _POLLIN)
        return ready[0][1] if ready else 0

    def _read(self, argument: "Any") -> "Any":
        """What ``_get`` reads, None when nothing is there; OSError when the file is gone."""
        if not self._readable(0):
            return None
        gone = self._gone
        try:
            got = self._get(argument)
            if got is None or got:
                return got
        except OSError as error:
            gone = error.errno or gone
            if gone == errno.EAGAIN:
                return None
        self.close()
        raise OSError(gone)

    def _write(self, buf: "Buffer", off: int, n: int) -> bool:
        """Writes ``buf[off:off + n]``; False when the file is gone, or closed as it took nothing for two seconds."""
        start = ticks_ms()
        while n and self._file is not None:
            try:
                done = self._put(buf, off, n) if MPY else self._put(memoryview(buf)[off : off + n])
            except OSError as error:
                if error.errno != errno.EAGAIN:
                    self.close()
                    break
                done = 0
            if done:
                off += done
                n -= done
            elif ticks_diff(ticks_ms(), start) > _PATIENCE:
                self.close()
                break
            else:
                self._writable(10)
        return n == 0
