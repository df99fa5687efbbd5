"""A context that a thread of its own spins, as a program beside the test does."""

import threading
from collections.abc import Callable

from muros.rclc import Context, Executor
from tests.rclc_space.ways import PATIENCE


class Spun:
    """A context in a thread, from ``start`` on. ``raised`` is what came out of its executor, which goes on then."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.problems: list[str] = []
        self.raised: list[Exception] = []
        self._wanted: list[Callable[[], object]] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        context.on_problem(lambda code, text: self.problems.append(text))

    def start(self) -> None:
        """From now on it runs."""
        self._thread.start()

    def do(self, call: Callable[[], object]) -> None:
        """Has its thread do something, and waits until that is done."""
        done = threading.Event()
        self._wanted += [call, done.set]
        assert done.wait(PATIENCE)

    def close(self) -> None:
        """Ends it."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join(PATIENCE)
        self.context.close()

    def _spin(self) -> None:
        executor = Executor(self.context)
        while not self._over.is_set():
            try:
                executor.spin_some(0.01)
                while self._wanted:
                    self._wanted.pop(0)()
            except Exception as error:
                self.raised.append(error)
