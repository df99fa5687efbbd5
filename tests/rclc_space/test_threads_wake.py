"""A guard condition that another thread triggers ends the wait of its executor, through an agent too."""

import threading
from typing import Any

import pytest

from muros.client import Session, Udp
from muros.links import UdpLink
from muros.rclc import Context, Executor, GuardCondition
from tests.client.agent_thread import RunningAgent

CALM = 60_000
"""Milliseconds that a session is silent by itself: the time limit of the test ends it first."""


@pytest.mark.parametrize("way", ["local", "agent"])
def test_a_trigger_from_another_thread_ends_the_wait(way: str) -> None:
    """The executor waits up to a minute."""
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link)
    context = Context("local:" if way == "local" else Session(Udp("127.0.0.1", link.port), keepalive=CALM))
    ran: list[int] = []
    waiting = threading.Event()
    middleware: Any = context.middleware
    wait = middleware.wait
    executor = Executor(context)
    guard = GuardCondition(context, lambda: ran.append(1))
    while context.state != "CONNECTED":
        executor.spin_some(0.01)

    def waits(timeout: int) -> None:
        waiting.set()
        wait(timeout)

    def trigger() -> None:
        waiting.wait(20)
        guard.trigger()

    middleware.wait = waits
    other = threading.Thread(target=trigger)
    other.start()
    while not ran:
        executor.spin_some(60.0)
    other.join(20)
    context.close()
    agent.stop()
    assert ran == [1]
