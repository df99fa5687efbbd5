"""Rules for memory of services, clients, actions and parameters on every runtime."""

from muros.client import Session
from muros.compat import MPY, const
from muros.rclc import Context, Executor, Rules
from muros.rclc.memory import REFUSED
from muros.rclc.memory_plan import divide
from tests.board.agent import Agent
from tests.board.harness import raises
from tests.board.test_memory import text

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.xrce._types import Buffer


class Body:
    """A message that keeps its bytes."""

    SHAPE = ""
    TYPE = "test_msgs/msg/Body"
    fails = False

    def __init__(self) -> None:
        self.body = b""

    def size(self) -> int:
        return len(self.body)

    def write(self, buf: bytearray, off: int) -> int:
        buf[off : off + len(self.body)] = self.body
        return off + len(self.body)

    def read(self, buf: "Buffer", off: int, n: int) -> None:
        if Body.fails:
            raise MemoryError
        self.body = bytes(memoryview(buf)[off : off + n])


class Question(Body):
    """A request."""

    TYPE = "test_msgs/srv/Say_Request"
    SHAPE = "text:s"


class Answer(Body):
    """A response."""

    TYPE = "test_msgs/srv/Say_Response"
    SHAPE = "texts:[ data:s )"


class Say:
    """A service."""

    TYPE = "test_msgs/srv/Say"
    Request = Question
    Response = Answer


class Rig:
    """A board and its agent."""

    def __init__(self) -> None:
        self.agent = Agent(512)
        self.context = Context(Session(self.agent, 0xBA5EBA11))
        self.problems: "list[tuple[int, str]]" = []
        self.context.on_problem(lambda code, said: self.problems.append((code, said)))
        self.node = self.context.node("board")
        self.executor = Executor(self.context)

    def spin(self, times: int = 20) -> None:
        for _ in range(times):
            self.executor.spin_some(0)

    def hear(self, object_id: int, data: bytes) -> None:
        """A sample comes."""
        self.agent.inbox.append(self.agent.data(object_id, data))
        self.spin(3)


def test_requests() -> None:
    rig = Rig()
    asked: "list[bytes]" = []
    service = rig.node.service(
        Say, "say", lambda request: asked.append(request.body), memory=Rules({"text": 3})
    )
    rig.spin()
    object_id = service.entity.id
    for word in ("", "abc", "abcd", "abcdefghij"):
        rig.hear(object_id, bytes(24) + text(word))
    assert asked == [text(""), text("abc")]
    assert service.refused == 2
    assert rig.problems == [
        (
            REFUSED,
            "%d B of test_msgs/srv/Say_Request dropped: text is longer than the rules allow"
            % len(text(word)),
        )
        for word in ("abcd", "abcdefghij")
    ]


def test_responses() -> None:
    rig = Rig()
    client = rig.node.client(Say, "say", memory=Rules({"texts": 1}))
    rig.spin()
    answers: "list[Any]" = []
    for count in (1, 2):
        assert client.send(Question(), answers.append, 5)
        number = client._asked[0][0]
        head = bytes((number >> 8, number & 255, 0, 0))
        rig.hear(client.entity.id, head + bytes((count, 0, 0, 0)) + text("a") * count)
    assert len(answers) == 1
    assert client.refused == 1
    assert rig.problems[0][1].startswith("20 B of test_msgs/srv/Say_Response dropped: texts is longer")


def test_without_memory_a_service_goes_on() -> None:
    rig = Rig()
    asked: "list[bytes]" = []
    service = rig.node.service(Say, "say", lambda request: asked.append(request.body), memory=Rules())
    rig.spin()
    Body.fails = True
    try:
        if not MPY:
            with raises(MemoryError):
                rig.hear(service.entity.id, bytes(24) + text("a"))
            return
        rig.hear(service.entity.id, bytes(24) + text("a"))
    finally:
        Body.fails = False
    assert service.refused == 1
    assert rig.problems[0][1].endswith("there is no memory for it")
    rig.hear(service.entity.id, bytes(24) + text("a"))
    assert asked == [text("a")]


def test_rules_are_divided_among_types() -> None:
    rules = Rules({"text": 3, "texts": 1, "texts.data": 2}, 9, 8, 7)
    question, answer = divide(rules, "both", (Question, Answer))
    assert question.rules == {"text": 3}
    assert answer.rules == {"texts": 1, "texts.data": 2}
    assert (answer.strings, answer.messages, answer.numbers) == (9, 8, 7)
    with raises(ValueError):
        divide(rules, "one", (Question,))
    assert divide(rules, "", (Question,))[0].rules == {"text": 3}
