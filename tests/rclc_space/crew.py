"""Programs whose callbacks several threads run, on each of the ways."""

import threading
import time
from collections.abc import Callable
from typing import Any

from muros.rclc import Context, Node, Threads
from tests.rclc_space.ways import PATIENCE, Way


def until(condition: Callable[[], Any]) -> None:
    """Waits until a condition holds, which other threads bring about."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"it did not come about within {PATIENCE} s"
        time.sleep(0.001)


class Crew:
    """Contexts on one of the ways, and the threads that run them."""

    def __init__(self, way: Way) -> None:
        self.way = way
        self.contexts: list[Context] = []
        self.teams: list[Threads] = []
        self.problems: list[tuple[int, str]] = []

    def context(self) -> Context:
        """A context; problems are kept."""
        made = self.way.open()
        made.on_problem(lambda code, text: self.problems.append((code, text)))
        self.contexts.append(made)
        return made

    def node(self, name: str = "node") -> Node:
        """A node in a context of its own."""
        return self.context().node(name)

    def threads(self, context: Context, **options: Any) -> Threads:
        """The threads of a context, which end with the test."""
        made = Threads(context, **options)
        self.teams.append(made)
        return made

    def meet(self, *publishers: Any) -> None:
        """Waits until everybody is connected, all that was made has been created, and publishers have readers."""
        until(lambda: all(context.state == "CONNECTED" for context in self.contexts))
        if self.way.direct:
            until(lambda: all(publisher.matched for publisher in publishers))
        else:
            sessions: list[Any] = [context.middleware for context in self.contexts]
            until(lambda: not any(entity.todo for session in sessions for entity in session.entities))

    def publish(self, publisher: Any, message: Any) -> None:
        """Publishes a message, trying until it is taken."""
        until(lambda: publisher.publish(message))

    def close(self) -> None:
        """Ends everything."""
        for team in self.teams:
            assert team.stop(PATIENCE)
        for context in self.contexts:
            context.close()
        self.way.close()


def here() -> str:
    """The name of this thread."""
    return threading.current_thread().name.removeprefix("muros ")
