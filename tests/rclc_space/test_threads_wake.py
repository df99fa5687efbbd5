"""A guard condition that another thread triggers ends the wait of its executor."""

import threading
from typing import Any

from muros.rclc import Context, Executor, GuardCondition


def test_a_trigger_from_another_thread_ends_the_wait() -> None:
    """The executor waits up to a minute; the test's time limit would end it first."""
    context = Context("local:")
    ran: list[int] = []
    waiting = threading.Event()
    middleware: Any = context.middleware
    wait = middleware.wait

    def waits(timeout: int) -> None:
        waiting.set()
        wait(timeout)

    middleware.wait = waits
    guard = GuardCondition(context, lambda: ran.append(1))
    executor = Executor(context)

    def trigger() -> None:
        waiting.wait(20)
        guard.trigger()

    other = threading.Thread(target=trigger)
    other.start()
    while not ran:
        executor.spin_some(60.0)
    other.join(20)
    context.close()
    assert ran == [1]
