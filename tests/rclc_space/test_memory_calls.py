"""Rules for memory of services, clients, actions and parameters, on each way."""

from typing import Any

import pytest

from muros.interfaces import action, service
from muros.rclc import Context, Executor, ParameterClient, ParameterError, Rules
from muros.rclc.host.checks import WrongTypeError
from muros.rclc.host.sharing import Mailbox, Seat
from muros.rclc.memory import REFUSED
from tests.rclc_space.ways import Stage

from example_interfaces.action import Fibonacci
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

GetParameters = service("rcl_interfaces/srv/GetParameters")
ListParameters = service("rcl_interfaces/srv/ListParameters")
LookupTransform = action("tf2_msgs/action/LookupTransform")


def told(node: Any) -> list[tuple[int, str]]:
    """What the context of a node tells from now on."""
    problems: list[tuple[int, str]] = []
    node.context.on_problem(lambda code, text: problems.append((code, text)))
    return problems


def ask(stage: Stage, client: Any, request: Any, timeout: float = 10.0) -> Any:
    """The answer to a request, None if there was none."""
    answers: list[Any] = []
    stage.until(lambda: client.send(request, answers.append, timeout))
    stage.until(lambda: answers)
    return answers[0]


def test_requests_beyond_the_rules_are_refused(stage: Stage) -> None:
    server = stage.node("server")
    problems = told(server)
    made = server.service(
        ListParameters, "names", lambda _: ListParameters.Response(), memory=Rules({"prefixes": 2})
    )
    client = stage.node("client").client(ListParameters, "names")
    stage.meet(client)
    assert ask(stage, client, ListParameters.Request(prefixes=["a", "b"])) is not None
    assert ask(stage, client, ListParameters.Request(prefixes=["a", "b", "c"]), 0.2) is None
    assert ask(stage, client, ListParameters.Request(prefixes=["a", "x" * 21]), 0.2) is None
    assert ask(stage, client, ListParameters.Request(prefixes=["a", "x" * 20])) is not None
    assert made.refused == 2
    assert [code for code, _ in problems] == [REFUSED, REFUSED]
    assert "srv/ListParameters_Request dropped: prefixes is longer than the rules allow" in problems[0][1]
    assert "prefixes.data is longer" in problems[1][1]


def test_responses_beyond_the_rules_are_refused(stage: Stage) -> None:
    words = ["four", "fives"]
    stage.node("server").service(
        Trigger, "say", lambda request: Trigger.Response(success=True, message=words.pop(0))
    )
    node = stage.node("client")
    problems = told(node)
    client = node.client(Trigger, "say", memory=Rules({"message": 4}))
    stage.meet(client)
    assert ask(stage, client, Trigger.Request()).message == "four"
    assert ask(stage, client, Trigger.Request(), 0.2) is None
    assert client.refused == 1
    assert problems == [
        (REFUSED, "14 B of std_srvs/srv/Trigger_Response dropped: message is longer than the rules allow")
    ]


def test_goals_beyond_the_rules_are_refused(stage: Stage) -> None:
    server = stage.node("server")
    problems = told(server)
    frames: list[str] = []

    def look(goal: Any) -> Any:
        frames.append(goal.request.target_frame)
        return LookupTransform.Result()

    made = server.action_server(LookupTransform, "look", look, memory=Rules({"goal.target_frame": 4}))
    client = stage.node("client").action_client(LookupTransform, "look")
    stage.meet(*client.parts[:3])
    accepted: list[Any] = []
    for frame, timeout in (("base", 10.0), ("base_link", 0.2)):
        goal = LookupTransform.Goal(target_frame=frame)
        stage.until(
            lambda goal=goal, timeout=timeout: client.send_goal(  # type: ignore[misc]
                goal, lambda sent, answer: accepted.append(answer), timeout=timeout
            )
        )
    stage.until(lambda: len(accepted) == 2)
    assert accepted == [True, None]
    assert frames == ["base"]
    assert made.parts[0].refused == 1
    assert len(problems) == 1
    assert "goal.target_frame is longer than the rules allow" in problems[0][1]


def test_what_servers_of_actions_say_is_bounded(stage: Stage) -> None:
    def count(goal: Any) -> Any:
        n = goal.request.order
        while not goal.feedback(Fibonacci.Feedback(sequence=range(n))):
            yield 0.0
        return Fibonacci.Result(sequence=range(n))

    stage.node("server").action_server(Fibonacci, "count", count)
    node = stage.node("client")
    problems = told(node)
    client = node.action_client(
        Fibonacci, "count", memory=Rules({"feedback.sequence": 2, "result.sequence": 3})
    )
    stage.meet(*client.parts[:3])
    if stage.way.direct:
        stage.until(lambda: all(part.entity.entity.matched for part in client.parts[3:]))
    heard: list[int] = []
    results: list[Any] = []
    for order, wait in ((2, None), (3, None), (4, 1.0)):
        stage.until(
            lambda order=order, wait=wait: client.send_goal(  # type: ignore[misc]
                Fibonacci.Goal(order=order),
                on_feedback=lambda goal, piece: heard.append(len(piece.sequence)),
                on_result=lambda goal, result: results.append(result and len(result.sequence)),
                result_timeout=wait,
            )
        )
        stage.until(lambda order=order: len(results) == order - 1)  # type: ignore[misc]
    assert heard == [2]
    assert results == [2, 3, None]
    stage.until(lambda: client.parts[3].refused == 2)
    assert client.parts[2].refused >= 1
    assert any("feedback.sequence is longer" in text for _, text in problems)
    assert any("result.sequence is longer" in text for _, text in problems)


def test_parameters_and_those_who_ask_for_them_are_bounded(stage: Stage) -> None:
    board = stage.node("board")
    parameters = board.parameters(
        undeclared=True, memory=Rules({"parameters.value.string_value": 30}, strings=10)
    )
    parameters.declare("mode", "idle")
    asker = stage.node("asker")
    problems, own = told(board), told(asker)
    client = ParameterClient(asker, "board", memory=Rules({"values.string_value": 30}, strings=40))
    stage.until(lambda: stage.contexts[0].state == stage.contexts[1].state == "CONNECTED")

    def say(method: Any, *arguments: Any, timeout: float = 5.0) -> Any:
        answers: list[Any] = []

        def asked() -> bool:
            try:
                method(*arguments, then=answers.append, timeout=timeout)
            except ParameterError:
                return False  # its client is still being made
            return True

        stage.until(asked)
        stage.until(lambda: answers)
        return answers[0]

    assert say(client.set, "mode", "x" * 30) == ""
    assert say(client.get, "mode") == "x" * 30
    assert problems == []
    assert "did not answer" in str(say(client.set, "mode", "x" * 31, timeout=0.2))
    assert parameters.get("mode") == "x" * 30
    assert "parameters.value.string_value is longer" in problems[-1][1]
    parameters.set("mode", "x" * 31)
    assert "did not answer" in str(say(client.get, "mode", timeout=0.2))
    assert "values.string_value is longer" in own[-1][1]
    assert "did not answer" in str(say(client.set, "a_long_name", 1, timeout=0.2))
    assert "parameters.name is longer" in problems[-1][1]
    assert parameters.list() == ["mode"]


def test_rules_for_nothing_leave_nothing_behind(stage: Stage) -> None:
    node = stage.node("board")
    rules = Rules({"nothing": 5})
    for make, text in (
        (lambda: node.service(SetBool, "a", print, memory=rules), "srv/SetBool_Request has no string or seq"),
        (lambda: node.client(SetBool, "a", memory=rules), "srv/SetBool_Response has no string or sequence"),
        (
            lambda: node.action_server(Fibonacci, "a", print, memory=rules),
            "Fibonacci_SendGoal_Request has no",
        ),
        (lambda: node.action_client(Fibonacci, "a", memory=rules), "action client 'a' has no string"),
        (lambda: node.parameters(memory=rules), "a server of parameters has no string or seq.* 'nothing'"),
    ):
        with pytest.raises(ValueError, match=text) as caught:
            make()
        assert caught.value.code == 11  # type: ignore[attr-defined]
        assert not node.entities
        assert not node.context.handles
    with pytest.raises(WrongTypeError, match="memory is Rules"):
        node.client(SetBool, "a", memory={"message": 5})  # type: ignore[arg-type]
    assert not node.context.handles


@pytest.mark.parametrize(
    "arguments",
    [(5,), ({"a": "b"},), ({"a": 1.5},), ({"a": -1},), ({}, None), ({}, 20, "5"), ({}, 20, 5, -5)],
)
def test_what_are_no_rules(arguments: Any) -> None:
    with pytest.raises(ValueError, match=r"no size|are a dict") as caught:
        Rules(*arguments)
    assert caught.value.code == 11  # type: ignore[attr-defined]


def test_sizes_are_those_of_rules_that_fit() -> None:
    rules = Rules({"date": 5})
    for say in (rules.capacities, rules.size, rules.static_size, rules.longest):
        with pytest.raises(ValueError, match="std_msgs/msg/String has no string or sequence 'date'"):
            say(String)


def test_a_condition_is_a_function() -> None:
    context = Context("local:")
    with pytest.raises(TypeError, match="the condition of spin_until is a function, not True"):
        Executor(context).spin_until(True, 0.1)  # type: ignore[arg-type]
    context.close()


def test_with_threads_the_queue_is_that_of_the_handle(url: str) -> None:
    context = Context(url, args=())
    try:
        rules = Rules()
        made = context.node("a").subscription(String, "x", None, memory=rules)
        box = Mailbox(rules.guard(made, String).deliver, Seat("a thread"))
        assert (box._depth, box._newest, box._handle) == (made.depth, False, made)
    finally:
        context.close()


def test_each_service_of_parameters_has_its_rules(stage: Stage) -> None:
    parameters = stage.node("board").parameters(memory=Rules({"names": 1, "parameters": 2, "prefixes": 3}))
    client = stage.node("asker").client(GetParameters, "/board/get_parameters")
    stage.meet(client)
    assert ask(stage, client, GetParameters.Request(names=["a"])) is not None
    assert ask(stage, client, GetParameters.Request(names=["a", "b"]), 0.2) is None
    assert [service.refused for service in parameters.handles] == [1, 0, 0, 0, 0, 0]
