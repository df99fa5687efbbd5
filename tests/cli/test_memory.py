"""`muros interface memory` of services and actions."""

import pytest

from muros import cli
from muros.client import Udp
from muros.links import UdpLink
from muros.rclc import Context, Executor, Rules
from tests.client.agent_thread import RunningAgent

from std_srvs.srv import Trigger


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """What the command prints."""
    assert cli.main(["interface", "memory", *words]) == 0
    return capsys.readouterr().out


def test_both_messages_of_a_service(capsys: pytest.CaptureFixture[str]) -> None:
    assert said(capsys, "std_srvs/srv/SetBool", "message=16") == (
        "std_srvs/srv/SetBool_Request:\n"
        "std_srvs/srv/SetBool_Request has neither strings nor sequences.\n"
        "longest message        1 B; boards join its pieces with Session(largest=33)\n"
        "\n"
        "std_srvs/srv/SetBool_Response:\n"
        "message       16 B of text\n"
        "all of them           16 B in C on 64 bit\n"
        "in one buffer         16 B\n"
        "longest message       25 B; boards join its pieces with Session(largest=37)\n"
    )


def test_what_is_bounded_of_an_action(capsys: pytest.CaptureFixture[str]) -> None:
    text = said(capsys, "example_interfaces/action/Fibonacci", "result.sequence=9")
    assert [line for line in text.splitlines() if "sequence" in line or line.endswith(":")] == [
        "example_interfaces/action/Fibonacci_SendGoal_Request:",
        "example_interfaces/action/Fibonacci_SendGoal_Request has neither strings nor sequences.",
        "example_interfaces/action/Fibonacci_GetResult_Response:",
        "result.sequence        9 elements",
        "example_interfaces/action/Fibonacci_FeedbackMessage:",
        "feedback.sequence        5 elements",
    ]
    one = said(capsys, "example_interfaces/action/Fibonacci_FeedbackMessage")
    assert one.startswith("feedback.sequence        5 elements")
    assert one in text


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("std_srvs/srv/SetBool", "mess=16"), "std_srvs/srv/SetBool has no string or sequence 'mess'"),
        (("std_srvs/srv/Nope",), "unknown type 'std_srvs/srv/Nope'"),
        (("std_srvs/srv/SetBool", "message=-1"), "'message=-1' is no rule such as name=8"),
    ],
)
def test_what_is_wrong_is_said(words: tuple[str, ...], why: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["interface", "memory", *words]) == 1
    assert why in capsys.readouterr().err


def test_a_session_of_that_size_takes_the_longest_response() -> None:
    """What the command says of ``Session(largest=...)``, and one byte less, which is not enough."""
    text = "x" * 3000
    rules = Rules({"message": 3000})
    longest = rules.longest(Trigger.Response)
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link)
    server = Context(Udp("127.0.0.1", link.port))
    contexts = [server]
    try:
        server.node("server").service(
            Trigger, "say", lambda request: Trigger.Response(success=True, message=text)
        )
        serving = Executor(server)
        for largest, comes in ((longest + 12, True), (longest + 8, False)):
            asker = Context(Udp("127.0.0.1", link.port, 512), largest=largest)
            asker.on_problem(lambda code, text: None)
            contexts.append(asker)
            client = asker.node("asker").client(Trigger, "say", memory=rules)
            asking = Executor(asker)
            answers: list[object] = []
            end = asking.context.clock() + 10_000
            sent = False
            while not answers and asking.context.clock() < end:
                sent = sent or client.send(Trigger.Request(), answers.append, 10.0 if comes else 0.5)
                serving.spin_some(0.005)
                asking.spin_some(0.005)
            assert bool(answers[0]) == comes
    finally:
        for context in contexts:
            context.close()
        agent.stop()
