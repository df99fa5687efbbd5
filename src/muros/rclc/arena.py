"""Memory that a program sets aside at its start, and strings in it that change without taking more.

arena = Arena(bytearray(256))
label = Text(arena.take(32))
message = String(data=label.view)
label.set("21.5 degrees")
message.data = label.view
"""

from muros.compat import const
from muros.rclc.errors import CapacityError

TYPE_CHECKING = const(0)

_ALIGN = const(4)


class Arena:
    """Gives out parts of ``buffer``, each aligned to 4 bytes. ``used`` are the bytes given out."""

    def __init__(self, buffer: bytearray) -> None:
        self._view = memoryview(buffer)
        self.used = 0

    def take(self, n: int) -> memoryview:
        """The next ``n`` bytes. Raises CapacityError when there are no more."""
        start = self.used
        end = start + (n + _ALIGN - 1 & -_ALIGN)
        if end > len(self._view):
            raise CapacityError(
                "%d B do not fit the %d B that are left of %d" % (n, len(self._view) - start, len(self._view))
            )
        self.used = end
        return self._view[start : start + n]

    def clear(self) -> None:
        """Takes everything back; what was given out is not to be used any more."""
        self.used = 0


class Text:
    """A string in memory of its own: that of ``start``, a part of an arena, or as many bytes as ``start`` says, or as
    the string ``start`` needs.

    ``view`` has its bytes in UTF-8 and stands for it in messages; with each change there is a new one. ``capacity``
    counts a closing NUL, as in C: strings have one byte less. What is longer raises CapacityError and changes nothing.
    """

    def __init__(self, start: "memoryview | int | str") -> None:
        data = b""
        if isinstance(start, str):
            data = start.encode()
            start = len(data) + 1
        self._memory = memoryview(bytearray(start)) if isinstance(start, int) else start
        self.view = self._memory[:0]
        self.append(data)

    @property
    def capacity(self) -> int:
        """Bytes, with a closing NUL."""
        return len(self._memory)

    def set(self, text: "str | bytes") -> None:
        """Becomes another string."""
        self._put(0, text)

    def append(self, text: "str | bytes") -> None:
        """Goes on with another string."""
        self._put(len(self.view), text)

    def shorten(self, n: int) -> None:
        """Loses its last ``n`` bytes, or all it has."""
        self.view = self._memory[: max(len(self.view) - n, 0)]

    def _put(self, at: int, text: "str | bytes") -> None:
        data = text.encode() if isinstance(text, str) else text
        end = at + len(data)
        if end >= len(self._memory):
            raise CapacityError("%d B and a NUL do not fit a text of %d B" % (end, len(self._memory)))
        self._memory[at:end] = data
        self.view = self._memory[:end]

    def __len__(self) -> int:
        return len(self.view)

    def __str__(self) -> str:
        return str(self.view, "utf-8")
