"""The time of a context: that of the agent, or the computer's."""

import time

from muros.client import Custom, Session
from muros.rclc import Context, Epoch
from tests.rclc_space.ways import Stage


def test_r22_sync_session(stage: Stage) -> None:
    context = stage.run(stage.way.open())
    epoch = Epoch(context)
    context.node("board")
    if stage.way.direct:
        assert epoch.clock is None
    else:
        assert not epoch.synchronized
        assert (epoch.time(), epoch.millis(), epoch.nanos()) == ((0, 0), 0, 0)
    assert epoch.sync(10.0)
    assert epoch.synchronized
    before = time.time_ns()
    nanos = epoch.nanos()
    seconds, rest = epoch.time()
    millis = epoch.millis()
    after = time.time_ns()
    slack = 5 * 10**9  # R22: at most 5 s between the two clocks
    assert before - slack <= nanos <= seconds * 10**9 + rest <= (millis + 1) * 10**6 <= after + slack
    assert 0 <= rest < 10**9
    if epoch.clock is not None:
        assert epoch.clock.round_trip >= 0


def test_c6_nobody_answers() -> None:
    context = Context(Session(Custom(lambda: True, lambda: None, lambda buf, off, n: None, lambda buf: 0)))
    epoch = Epoch(context)
    assert not epoch.sync(0.05)
    assert not epoch.synchronized
    assert epoch.nanos() == 0
    context.close()
