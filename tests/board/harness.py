"""What the tests of the board floor need on every runtime, in the Python that MicroPython understands.

A test file in this folder holds functions ``test_*()`` that take nothing and assert. pytest runs them on
CPython; ``tests/micropython/test_board_tests.py`` runs the same file on MicroPython, 64 bit and 32 bit. A
file that cannot run on some runtime says so: ``NOT_ON = ("gauge",)``, as the 32-bit build has no socket.
"""

import gc
import sys

from muros.compat import MPY, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable


class raises:  # noqa: N801
    """``with raises(OSError) as caught:`` fails unless the block raises it; ``caught.value`` has it."""

    def __init__(self, kind: "type[BaseException]") -> None:
        self.kind = kind
        self.value: BaseException = BaseException()

    def __enter__(self) -> "raises":
        return self

    def __exit__(self, kind: object, value: "BaseException | None", traceback: object) -> bool:
        if value is None:
            raise AssertionError("nothing raised, expected " + self.kind.__name__)
        self.value = value
        return isinstance(value, self.kind)


if MPY:
    import micropython

    def allocates(function: "Callable[[], object]") -> int:
        """Bytes of heap that one call allocates, garbage included.

        The function is called twice first, so that what it creates once is not counted. Raises MemoryError
        where a call allocates and gives everything back, which the figure would not show.
        """
        function()
        function()
        gc.collect()
        gc.disable()
        try:
            before = gc.mem_alloc()
            function()
            used = gc.mem_alloc() - before
        finally:
            gc.enable()
        if used == 0:
            micropython.heap_lock()
            try:
                function()
            finally:
                micropython.heap_unlock()
        return used

    def run_all(name: str) -> None:
        """Runs the tests of one module and prints a report that the host reads.

        Each test gives a line ``ok NAME``, or ``FAIL NAME`` followed by its traceback and a line ``end``.
        """
        __import__(name)
        module = sys.modules[name]
        for test in sorted(dir(module)):
            if not test.startswith("test_"):
                continue
            gc.collect()
            try:
                getattr(module, test)()
            except Exception as error:
                print("FAIL", test)
                sys.print_exception(error)
                print("end")
            else:
                print("ok", test)

else:

    def allocates(function: "Callable[[], object]") -> int:
        """Calls the function and answers 0: CPython cannot tell."""
        function()
        return 0
