"""Contexts in virtual time, through an agent and straight in a space: waiting lets time pass, nothing else does."""

from collections.abc import Callable
from typing import Any

from muros.rclc import Context, Executor
from muros.space import open_space
from tests.client.world import World
from tests.rclc.test_rclc import Board


class Bench:
    """Two contexts that meet: `talker`, and `context`, which is tested. `now` is in ms."""

    talker: Context
    context: Context
    now: int

    def open(self) -> Context:
        """One more context."""
        raise NotImplementedError

    def executor(self, *arguments: Any, **options: Any) -> Executor:
        """An executor of the context."""
        return Executor(self.context, *arguments, **options)

    def settle(self) -> None:
        """Has everything that was said arrive at whom it is for."""
        raise NotImplementedError

    def take(self, ms: int) -> None:
        """A computation takes so long."""
        raise NotImplementedError

    def close(self) -> None:
        """Ends it."""
        self.talker.close()
        self.context.close()


class InSpace(Bench):
    """Straight in a space of this process: what is said is there at once."""

    def __init__(self) -> None:
        self.now = 1000
        self._space = open_space("local:", clock=lambda: self.now * 1_000_000)
        self._opened: list[Context] = []
        self.waits: list[float] = []
        self.on_wait: Callable[[], object] | None = None
        self.talker, self.context = self.open(), self.open()

    def open(self) -> Context:
        """One more context."""
        made = Context(self._space)
        made.clock = lambda: self.now
        middleware: Any = made.middleware
        middleware.wait = self._wait
        self._opened.append(made)
        return made

    def _wait(self, ms: float) -> None:
        self.waits.append(ms)
        self.now += max(1, int(ms))
        if self.on_wait is not None:
            self.on_wait()

    def settle(self) -> None:
        """Nothing is under way."""

    def take(self, ms: int) -> None:
        """A computation takes so long."""
        self.now += ms

    def close(self) -> None:
        """Ends it."""
        for context in self._opened:
            context.close()
        self._space.close()


class ThroughAgent(Bench):
    """Two boards and an agent on a simulated network."""

    def __init__(self) -> None:
        self.world = World()
        self._boards = [Board(self.world, name, history=16) for name in ("talker", "board")]
        self.talker, self.context = (board.context for board in self._boards)

    def open(self) -> Context:
        """One more context."""
        self._boards.append(Board(self.world, f"b{len(self._boards)}", history=16))
        return self._boards[-1].context

    @property
    def now(self) -> int:  # type: ignore[override]
        """The world's time."""
        return self.world.now

    def settle(self) -> None:
        """Has everything that was said arrive at whom it is for."""
        for board in self._boards:
            board.connect()
        self._boards[0].connect()
        self.world.run(20, 1)

    def take(self, ms: int) -> None:
        """A computation takes so long."""
        self.world.run(ms, 1)


WAYS: dict[str, type[Bench]] = {"agent": ThroughAgent, "local": InSpace}
