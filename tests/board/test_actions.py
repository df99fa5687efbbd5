"""Servers and clients of actions on every runtime, in virtual time, on services that only note what is said."""

from muros.compat import const
from muros.rclc.action_client import ActionClient
from muros.rclc.action_server import ActionServer
from muros.rclc.actions import make_client, make_server
from muros.rclc.goal_error import GoalError
from tests.board.harness import raises

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.rclc.goals import Goal

_EXECUTING = const(2)
_SUCCEEDED = const(4)
_CANCELED = const(5)
_ABORTED = const(6)


class Fields:
    """Anything with fields."""


def fields(**values: "Any") -> "Any":
    made = Fields()
    for name in values:
        setattr(made, name, values[name])
    return made


def identified() -> "Any":
    return fields(goal_id=fields(uuid=bytes(16)), goal=None)


def answered() -> "Any":
    return fields(accepted=False, status=0, result=None, stamp=fields(sec=0, nanosec=0))


def about() -> "Any":
    return fields(goal_id=fields(uuid=bytes(16)), stamp=fields(sec=0, nanosec=0))


SERVICE = fields(Request=identified, Response=answered)
ACTION = fields(
    SendGoal=SERVICE, GetResult=SERVICE, FeedbackMessage=lambda: fields(goal_id=fields(), feedback=None)
)
CANCEL = fields(
    Request=lambda: fields(goal_info=about()), Response=lambda: fields(return_code=0, goals_canceling=[])
)
TYPES = (CANCEL, lambda: fields(status_list=[]), lambda: fields(goal_info=about(), status=0))


class Part:
    """A service, client, publisher or subscription that notes what it is given."""

    depth = 10

    def __init__(self, callback: "Any" = None) -> None:
        self.callback = callback
        self.entity = self
        self.said: "list[Any]" = []
        self.waiting: "list[Any]" = []
        self.identity = b""
        self.open = True
        self.destroyed = 0

    def room(self) -> bool:
        return self.open

    def ready(self, now: int) -> bool:
        return len(self.waiting) > 0

    def left(self, now: int) -> int:
        return 1000000

    def run(self, now: int) -> None:
        self.identity, request = self.waiting.pop(0)
        response = self.callback(request)
        if response is not None:
            self.reply(self.identity, response)

    def reply(self, identity: bytes, response: "Any") -> None:
        self.said.append((identity, response))

    def send(self, request: "Any", on_reply: "Any", timeout: float) -> bool:
        self.said.append((request, on_reply))
        return self.open

    def publish(self, message: "Any") -> bool:
        if hasattr(message, "status_list"):
            self.said.append([entry.status for entry in message.status_list])
        else:
            self.said.append(message.feedback)
        return self.open

    def destroy(self) -> None:
        self.destroyed += 1


class Node:
    """A node and its context, with a clock of its own."""

    def __init__(self) -> None:
        self.now = 0
        self.handles: "list[Any]" = []
        self.entities: "list[Any]" = []
        self.told: "list[str]" = []
        self.middleware: "Any" = fields(state=2, on_problem=lambda code, text: self.told.append(text))

    def clock(self) -> int:
        return self.now

    def make(
        self, kind: "Any", name: str, callback: "Any" = None, qos: "Any" = None, memory: "Any" = None
    ) -> Part:
        made = Part(callback)
        self.entities.append(made)
        self.handles.append(made)
        return made

    service = subscription = publisher = client = make


def new_node() -> "Any":
    return Node()


class Bench:
    """A server; ``count`` gives its goals."""

    def __init__(
        self, on_execute: "Any" = None, goals: int = 2, results: int = 2, on_cancel: "Any" = None
    ) -> None:
        self.node = new_node()
        self.server = ActionServer(self.node, "count")
        self.begun: "list[Goal]" = []
        functions = (on_execute or self.begun.append, lambda goal: goal != "bad", on_cancel, None)
        make_server(self.server, self.node, ACTION, functions, (goals, results, 1.0), lambda: (5, 6), TYPES)
        self.step(0)

    def goal(self, number: int, what: str = "good") -> bool:
        """Asks to take a goal; whether it was."""
        request = identified()
        request.goal_id.uuid = bytes(15) + bytes((number,))
        request.goal = what
        self.server.parts[0].waiting.append((b"", request))
        self.step(0)
        accepted: bool = self.server.parts[0].said[-1][1].accepted
        return accepted

    def ask(self, number: int, who: bytes = b"who") -> None:
        """Asks for a result."""
        request = identified()
        request.goal_id.uuid = bytes(15) + bytes((number,))
        self.server.parts[2].waiting.append((who, request))
        self.step(0)

    def step(self, ms: int) -> None:
        """Runs all that is ready after a while."""
        self.node.now += ms
        for _ in range(5):
            if self.server.ready(self.node.now):
                self.server.run(self.node.now)

    def results(self) -> "list[tuple[bytes, int, Any]]":
        return [(who, reply.status, reply.result) for who, reply in self.server.parts[2].said]


def test_a_goal_is_taken_executed_and_its_result_waits_for_who_asks() -> None:
    bench = Bench()
    assert bench.goal(1)
    assert not bench.goal(1), "no two goals have one id"
    assert not bench.goal(2, "bad")
    (goal,) = bench.begun
    assert goal.status == _EXECUTING and goal.request == "good"
    reply = bench.server.parts[0].said[0][1]
    assert (reply.stamp.sec, reply.stamp.nanosec) == (5, 6)
    bench.ask(1)
    assert bench.results() == []
    assert goal.feedback("half")
    goal.succeed("done")
    bench.step(0)
    bench.ask(1, b"late")
    assert bench.results() == [(b"who", _SUCCEEDED, "done"), (b"late", _SUCCEEDED, "done")]
    assert bench.server.feedback.said == ["half"]  # type: ignore[attr-defined]
    assert bench.server.status.said == [[_EXECUTING], [_SUCCEEDED]]  # type: ignore[attr-defined]


def test_what_does_not_fit_is_refused() -> None:
    bench = Bench()
    bench.goal(1)
    goal = bench.begun[0]
    with raises(GoalError) as caught:
        goal.canceled()
    assert caught.value.code == 2301  # type: ignore[attr-defined]
    assert str(caught.value) == "goal 00000000 of action 'count' is executing: it cannot be canceled"
    goal.abort()
    with raises(GoalError) as caught:
        goal.feedback("more")
    assert caught.value.code == 2300  # type: ignore[attr-defined]


def test_an_ended_goal_is_forgotten_after_its_time() -> None:
    bench = Bench()
    bench.goal(1)
    bench.begun[0].succeed("done")
    bench.step(0)
    assert bench.server.left(bench.node.now) == 1000
    bench.step(999)
    assert len(bench.server.goals) == 1
    bench.step(1)
    assert bench.server.goals == []
    bench.ask(1)
    assert bench.results() == [(b"who", 0, None)]
    assert bench.server.status.said[-1] == []  # type: ignore[attr-defined]


def test_memory_is_bounded() -> None:
    bench = Bench()
    assert bench.goal(1) and bench.goal(2)
    assert not bench.goal(3)
    assert bench.server.refused == 1
    assert bench.node.told == ["action 'count' refused a goal: 2 of 2 are active. Make it with goals=3."]
    for number in range(3, 10):
        bench.begun[-1].succeed(number)
        bench.step(10)
        assert bench.goal(number)
    assert len(bench.server.goals) == 4
    assert bench.server.lost == 5
    for number in range(20):
        bench.ask(1, bytes((number,)))
    assert len(bench.server.goals[0].askers) == 8


def test_a_generator_is_advanced_when_its_time_has_come() -> None:
    steps: "list[int]" = []

    def run(goal: "Goal") -> "Any":
        for n in range(3):
            steps.append(bench.node.now)
            yield 0.1 if n else None
        return "done"

    bench = Bench(run)
    bench.goal(1)
    assert steps == [0, 0]
    assert bench.server.left(bench.node.now) == 100
    bench.step(99)
    assert len(steps) == 2
    bench.step(1)
    assert steps == [0, 0, 100]
    bench.step(100)
    bench.ask(1)
    assert bench.results() == [(b"who", _SUCCEEDED, "done")]


def test_cancelling() -> None:
    agrees: "list[bool]" = []

    def run(goal: "Goal") -> "Any":
        while not goal.canceling:
            yield 0.01
        goal.canceled("half")

    bench = Bench(run, on_cancel=lambda goal: agrees.pop())
    bench.goal(1)

    def cancel() -> "Any":
        bench.server.parts[1].waiting.append((b"", fields(goal_info=about())))
        bench.step(0)
        return bench.server.parts[1].said[-1][1]

    agrees.append(False)
    assert (cancel().return_code, bench.server.goals[0].status) == (1, _EXECUTING)
    agrees.append(True)
    reply = cancel()
    assert (reply.return_code, len(reply.goals_canceling)) == (0, 1)
    bench.step(10)
    assert bench.server.goals[0].status == _CANCELED


def test_what_raises_aborts_its_goal() -> None:
    def run(goal: "Goal") -> "Any":
        raise KeyError(goal.request)

    bench = Bench(run)
    with raises(KeyError):
        bench.goal(1)
    assert bench.server.goals[0].status == _ABORTED


def test_nothing_is_sent_while_there_is_no_room() -> None:
    bench = Bench()
    bench.goal(1)
    bench.ask(1)
    service = bench.server.parts[2]
    service.open = False
    bench.begun[0].succeed("done")
    bench.step(5000)
    assert bench.results() == []
    assert len(bench.server.goals) == 1, "somebody waits for it"
    service.open = True
    bench.step(20)
    assert bench.results() == [(b"who", _SUCCEEDED, "done")]


def test_the_states_are_published_again_when_the_link_is_back() -> None:
    bench = Bench()
    bench.goal(1)
    said = bench.server.status.said  # type: ignore[attr-defined]
    bench.node.middleware.state = 3
    bench.step(10)
    assert said == [[_EXECUTING]]
    bench.node.middleware.state = 2
    bench.step(10)
    assert said == [[_EXECUTING], [_EXECUTING]]


def test_destroying_ends_everything_once() -> None:
    bench = Bench(lambda goal: (None for _ in range(9)))
    bench.goal(1)
    parts = bench.server.entities
    assert bench.node.entities == [bench.server]
    assert bench.node.handles == [bench.server]
    bench.server.destroy()
    bench.server.destroy()
    assert [part.destroyed for part in parts] == [1, 1, 1, 1, 1]
    assert bench.node.handles == []
    assert not bench.server.ready(bench.node.now + 1000)


class Asker:
    """A client, and what it has heard."""

    def __init__(self) -> None:
        self.node = new_node()
        self.client = ActionClient(self.node, "count")
        make_client(self.client, self.node, ACTION, 2, TYPES)
        self.heard: "list[Any]" = []

    def send(self, result_timeout: "float | None" = None) -> "Any":
        return self.client.send_goal(
            "goal",
            lambda goal, accepted: self.heard.append(accepted),
            lambda goal, piece: self.heard.append(piece),
            lambda goal, result: self.heard.append(result),
            result_timeout=result_timeout,
        )

    def reply(self, part: int, **values: "Any") -> None:
        reply = answered()
        for name in values:
            setattr(reply, name, values[name])
        self.client.parts[part].said[-1][1](reply)

    def state(self, goal: "Any", status: int) -> None:
        entry = fields(goal_info=about(), status=status)
        entry.goal_info.goal_id.uuid = goal.id
        self.client.take_states(fields(status_list=[entry]))


def test_a_goal_of_a_client() -> None:
    asker = Asker()
    goal = asker.send()
    asker.reply(0, accepted=True)
    asker.state(goal, 2)
    asker.client.take_feedback(fields(goal_id=fields(uuid=goal.id), feedback="half"))
    asker.client.take_feedback(fields(goal_id=fields(uuid=bytes(16)), feedback="of somebody else"))
    assert goal.status == 2
    asker.state(goal, 1)
    assert goal.status == 2, "states never go back"
    asker.reply(2, status=_SUCCEEDED, result="done")
    assert asker.heard == [True, "half", "done"]
    assert (goal.status, goal.result, asker.client.goals) == (_SUCCEEDED, "done", [])


def test_a_goal_that_is_rejected_or_not_answered() -> None:
    asker = Asker()
    asker.send()
    asker.reply(0, accepted=False)
    asker.send()
    asker.client.parts[0].said[-1][1](None)
    assert asker.heard == [False, None]
    assert asker.client.goals == []


def test_a_client_has_no_more_goals_than_it_may() -> None:
    from muros.rclc.errors import CapacityError

    asker = Asker()
    asker.send()
    asker.send()
    with raises(CapacityError):
        asker.send()


def test_a_result_is_asked_for_again_or_given_up() -> None:
    asker = Asker()
    client = asker.client
    goal = asker.send(result_timeout=10.0)
    asker.reply(0, accepted=True)
    asked = client.parts[2].said
    assert len(asked) == 1
    asker.state(goal, _SUCCEEDED)
    assert client.left(asker.node.now) == 2000
    for now in (1999, 2000, 4000):
        asker.node.now = now
        if client.ready(now):
            client.run(now)
    assert len(asked) == 3
    asker.node.now = 10000
    assert client.ready(10000)
    client.run(10000)
    assert asker.heard == [True, None]
    assert not client.ready(20000)
