"""Rules for memory on every runtime: what keeps to them is taken, what does not is refused, counted and told."""

from muros.client import Session
from muros.compat import MPY, const
from muros.rclc import Arena, CapacityError, Context, Executor, Rules, Text
from muros.rclc.memory import REFUSED, check
from muros.rclc.memory_plan import make
from tests.board.agent import Agent
from tests.board.harness import allocates, raises

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Buffer

_READER = const(6)


class Names:
    """A message with a string and a sequence of strings, as board classes are made with ``shapes``."""

    TYPE = "test_msgs/msg/Names"
    SHAPE = "stamp:{ 4 4 ) label:s 4 names:[ data:s ) values:8<6"

    def __init__(self) -> None:
        self.body = b""
        self.fails = False

    def size(self) -> int:
        return len(self.body)

    def write(self, buf: bytearray, off: int) -> int:
        return off

    def read(self, buf: "Buffer", off: int, n: int) -> None:
        if self.fails:
            raise MemoryError
        self.body = bytes(memoryview(buf)[off : off + n])


def number(value: int) -> bytes:
    """Four bytes."""
    return bytes((value & 255, value >> 8 & 255, 0, 0))


def text(value: str) -> bytes:
    """A string, and zeros up to the next multiple of four."""
    data = value.encode() + b"\0"
    return number(len(data)) + data + bytes(-len(data) % 4)


def body(label: str, names: "list[str]", values: int) -> bytes:
    """A message."""
    data = bytes(8) + text(label)
    data += bytes(4) + number(len(names))
    for name in names:
        data += text(name)
    data += number(values)
    if values:
        data += bytes(-len(data) % 8)
    return data + bytes(8 * values)


class Rig:
    """A board with a subscription that has rules."""

    def __init__(self, rules: Rules) -> None:
        self.agent = Agent(512)
        self.context = Context(Session(self.agent, 0xBA5EBA11))
        self.problems: "list[tuple[int, str]]" = []
        self.context.on_problem(lambda code, said: self.problems.append((code, said)))
        self.taken: "list[bytes]" = []
        node = self.context.node("board")
        self.subscription = node.subscription(Names, "names", self.on_message, memory=rules)
        self.executor = Executor(self.context)
        for _ in range(20):
            self.executor.spin_some(0)

    def on_message(self, message: Names) -> None:
        self.taken.append(message.body)

    def hear(self, data: bytes) -> None:
        """A sample comes."""
        self.agent.inbox.append(self.agent.data(_READER, data))
        for _ in range(3):
            self.executor.spin_some(0)


def test_what_keeps_to_the_rules_is_taken() -> None:
    rig = Rig(Rules({"names": 2, "names.data": 4}, strings=3, numbers=1))
    good = (
        body("", [], 0),
        body("abc", [], 0),
        body("a", ["abcd", "x"], 1),
        body("ab", ["", ""], 6),  # six is a bound of the type
    )
    for data in good:
        rig.hear(data)
    assert rig.taken == list(good)
    assert rig.subscription.refused == 0
    assert rig.problems == []


def test_what_is_longer_is_refused_counted_and_told() -> None:
    rig = Rig(Rules({"names": 2, "names.data": 4}, strings=3))
    bad = (
        (body("abcd", [], 0), "label"),
        (body("a", ["1", "2", "3"], 0), "names"),
        (body("a", ["1", "abcde"], 0), "names.data"),
        (body("a", ["1", "abcd"], 7), "values"),
    )
    for data, _ in bad:
        rig.hear(data)
    assert rig.taken == []
    assert rig.subscription.refused == 4
    assert [code for code, _ in rig.problems] == [REFUSED] * 3  # the first, the second, the fourth
    for said, which in zip(rig.problems, (0, 1, 3)):
        data, path = bad[which]
        assert said[1] == "%d B of test_msgs/msg/Names dropped: %s is longer than the rules allow" % (
            len(data),
            path,
        )
    rig.hear(body("a", [], 0))
    assert len(rig.taken) == 1


def test_what_is_malformed_is_left_to_the_type() -> None:
    rig = Rig(Rules())
    good = body("abc", ["abcd", "x"], 1)
    for n in range(len(good)):
        rig.hear(good[:n])
    assert rig.subscription.refused == 0
    assert len(rig.taken) == len(good)


def test_without_memory_a_board_goes_on() -> None:
    if not MPY:
        return
    rig = Rig(Rules())
    rig.subscription._message.fails = True
    rig.hear(body("a", [], 0))
    assert rig.subscription.refused == 1
    assert rig.problems[0][1].endswith("there is no memory for it")
    rig.subscription._message.fails = False
    rig.hear(body("a", [], 0))
    assert len(rig.taken) == 1


def test_wrong_rules() -> None:
    context = Context(Session(Agent(512), 1))
    with raises(ValueError):
        context.node("board").subscription(Names, "names", None, memory=Rules({"name": 3}))
    with raises(ValueError):
        Rules(strings=-1)


def test_texts() -> None:
    arena = Arena(bytearray(12))
    label = Text(arena.take(6))
    label.set("21.5")
    label.append("C")
    assert bytes(label.view) == b"21.5C"
    assert str(label) == "21.5C"
    with raises(CapacityError):
        label.append("!")
    label.shorten(1)
    assert len(label) == 4
    assert Text("abc").capacity == 4
    with raises(CapacityError):
        arena.take(5)


def test_a_flood_is_told_now_and_then() -> None:
    rig = Rig(Rules(strings=3))
    data = body("abcd", [], 0)
    for _ in range(40):
        rig.hear(data)
    assert rig.subscription.refused == 40
    assert len(rig.problems) == 6  # 1, 2, 4, 8, 16, 32


def test_looking_takes_no_heap() -> None:
    plan = make(Rules({"names": 2, "names.data": 4}, strings=3), Names)
    stack = [0, 0]
    good = body("abc", ["abcd", "x"], 6)
    bad = body("abc", ["abcd", "xxxxx"], 6)

    def look() -> None:
        assert check(plan, stack, good, 0, len(good)) == -1
        assert check(plan, stack, bad, 0, len(bad)) > 0

    assert allocates(look) == 0
