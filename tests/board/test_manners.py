"""What programs on boards are told, and how they ask: problems, ping, triggers, names."""

from muros.client import Session
from muros.client.problems import OFFLINE
from muros.rclc import Context, Executor, InvalidNameError, all_of, any_of, one
from tests.board.agent import Agent
from tests.board.harness import raises
from tests.board.test_client import Board, Number

TYPE_CHECKING = 0
if TYPE_CHECKING:
    from typing import Any


class Gone(Agent):
    """A way that cannot be opened, for one reason or another."""

    reason = 5

    def open(self) -> bool:
        """Fails."""
        raise OSError(self.reason)


def test_why_there_is_no_way_is_told_once() -> None:
    told: "list[tuple[int, str]]" = []
    gone = Gone()
    session = Session(gone, 1)
    session.on_problem = lambda code, text: told.append((code, text))
    for now in range(0, 2500, 100):
        session.spin_once(now)
    assert [code for code, _ in told] == [9]
    gone.reason = 19
    for now in range(2500, 4500, 100):
        session.spin_once(now)
    assert [code for code, _ in told] == [9, 9]
    assert told[0][1] != told[1][1]


def test_why_a_sample_was_dropped_is_told() -> None:
    told: "list[int]" = []
    agent = Agent()
    session = Session(agent, 1)
    session.on_problem = lambda code, text: told.append(code)
    writer = session.writer(session.participant("board"), "rt/out", "std_msgs/msg/Int32")
    for _ in range(4):
        assert not writer.publish(Number())
    assert told == [OFFLINE] * 3  # the 1st, the 2nd, the 4th
    assert list(session.drops) == [4, 0, 0, 0, 0]


def test_ping_within_a_session() -> None:
    board = Board()
    now = [board.now]

    def clock() -> int:
        now[0] += 10
        return now[0]

    assert board.session.ping(200, clock)
    board.agent.quiet = True
    assert not board.session.ping(200, clock)
    board.agent.quiet = False
    board.agent.knows = 0
    assert not board.session.ping(200, clock)


def test_triggers_wait_for_what_they_name() -> None:
    context = Context(Session(Agent(), 1))
    node = context.node("board")
    laser: "Any" = node.subscription(Number, "laser", None)
    imu: "Any" = node.subscription(Number, "imu", None)
    both, either, first, every = all_of(laser, imu), any_of(laser, imu), one(laser), all_of()
    handles = [laser, imu]
    assert [trigger(handles) for trigger in (both, either, first, every)] == [False, False, False, False]
    imu.deliver(b"\1\0\0\0", 0, 4)
    assert [trigger(handles) for trigger in (both, either, first, every)] == [False, True, False, False]
    laser.deliver(b"\1\0\0\0", 0, 4)
    assert [trigger(handles) for trigger in (both, either, first, every)] == [True, True, True, True]
    got: "list[str]" = []
    executor = Executor(context, 0, both)
    executor.add(laser, lambda message: got.append("laser"))
    executor.add(imu, lambda message: got.append("imu"))
    executor.spin_some()
    assert got == ["laser", "imu"]
    assert not both(handles)


def test_names_that_ros_does_not_take() -> None:
    node = Context(Session(Agent(), 1)).node("board")
    for topic in ("a b", "/1x", "a//b", "a-b"):
        with raises(InvalidNameError):
            node.publisher(Number, topic)
    with raises(ValueError):
        node.context.node("x" * 60)
