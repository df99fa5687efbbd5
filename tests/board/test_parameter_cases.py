"""Parameters on every runtime, by the ids of the acceptance cases: a board that has them, another that asks."""

from muros.compat import const, ticks_add
from muros.rclc import (
    CapacityError,
    Executor,
    ParameterClient,
    ParameterError,
    ParameterNotDeclaredError,
    ParameterRejectedError,
    ParameterTypeError,
)
from muros.rclc.parameter_errors import (
    InvalidParameterError,
    ParameterChangingError,
    ParameterMemoryError,
    ParameterTimeoutError,
)
from tests.board.broker import Broker
from tests.board.harness import raises

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

_BOOL = const(1)
_INTEGER = const(2)
_DOUBLE = const(3)
_REJECTED = const(4001)
_TYPE = const(4002)
_MEMORY = const(4003)
_CHANGING = const(40004)


class Pair:
    """A board with parameters, and one that asks; what the callback was asked, and what it says."""

    def __init__(self, max: int = 4, undeclared: bool = False, low_memory: bool = False) -> None:
        from rcl_interfaces.msg import ParameterEvent

        self.broker = Broker()
        self.node = self.broker.context().node("server", "lab")
        self.parameters = self.node.parameters(max, True, undeclared, low_memory, 49)
        asker = self.broker.context().node("asker")
        self.remote = ParameterClient(asker, "/lab/server", 1.0)
        self.events: "list[Any]" = []
        self.seen: "list[Any]" = []
        self.agrees = True
        asker.subscription(ParameterEvent, "/parameter_events", self.on_event, "parameters")

    def on_event(self, event: "Any") -> None:
        """Keeps what is said of changes."""
        self.events.append(
            [
                [parameter.name for parameter in found]
                for found in (event.new_parameters, event.changed_parameters, event.deleted_parameters)
            ]
        )
        assert event.node == "/lab/server"

    def start(self) -> "Pair":
        """Three parameters, a callback, and everybody is there."""
        for name, value in (("flag", False), ("count", 0), ("gain", 0.0)):
            self.parameters.declare(name, value)
        self.watch()
        self.broker.settle()
        return self

    def watch(self) -> None:
        """Keeps what the callback is asked."""

        def decide(old: "Any", new: "Any") -> bool:
            self.seen.append((old and old.value, new and new.value))
            return self.agrees

        self.parameters.on_change(decide)


def refusal(use: "Callable[..., object]", *given: "Any") -> str:
    """The reason for which a node refuses something."""
    return str(failure(ParameterRejectedError, _REJECTED, use, *given)).split(": ", 1)[1]


def failure(
    kind: "type[BaseException]", code: int, use: "Callable[..., object]", *given: "Any", **named: "Any"
) -> "Any":
    """What is raised, which has a code of the C library."""
    with raises(kind) as caught:
        use(*given, **named)
    error: "Any" = caught.value
    assert error.code == code
    return error


def test_p1_init() -> None:
    pair = Pair()
    executor = Executor(pair.node.context, 6)
    for handle in pair.parameters.handles:
        executor.add(handle)
    with raises(CapacityError):
        executor.add(pair.node.timer(1.0, print))
    pair.parameters.on_change(None)
    pair.parameters.destroy()
    assert executor.handles == []
    pair.node.parameters()


def test_p2_add() -> None:
    parameters = Pair().parameters
    for name, value in (("p0", True), ("p1", 1), ("p2", 1.0), ("p3", False)):
        parameters.declare(name, value)
    failure(ParameterError, 1, parameters.declare, "p1", 1)
    failure(ParameterError, 1, parameters.declare, "x" * 50, 1)
    failure(CapacityError, 1, parameters.declare, "fifth", 1)
    for wrong in (None, "", 3):
        failure(InvalidParameterError, 11, parameters.declare, wrong, 1)
    assert parameters.list() == ["p0", "p1", "p2", "p3"]
    parameters.undeclare("p0")
    parameters.declare("x" * 49, 1)


def test_p3_constraint() -> None:
    parameters = Pair().parameters
    parameters.declare("int", 0, range=(0, 10, 1))
    parameters.declare("double", 0.0)
    parameters.declare("text", "")
    parameters.constrain("double", range=(0, 0.125, 0.0625))
    assert parameters.describe("int").range == (0, 10, 1)
    assert parameters.describe("double").range == (0.0, 0.125, 0.0625)
    for name, span in (("int", (0.0, 1.0)), ("text", (0, 1)), ("int", (0,)), ("int", (2, 1))):
        failure(InvalidParameterError, 11, parameters.constrain, name, range=span)
    with raises(ParameterNotDeclaredError):
        parameters.constrain("nobody", range=(0, 1))
    with raises(ParameterRejectedError):
        parameters.set("int", 11)


def test_p4_description() -> None:
    parameters = Pair().parameters
    parameters.declare("x", 1, description="what it is")
    assert parameters.describe("x").description == "what it is"
    failure(ParameterError, 1, parameters.constrain, "x", description="d" * 50)
    with raises(ParameterNotDeclaredError):
        parameters.constrain("nobody", description="")
    small = Pair(low_memory=True).parameters
    failure(ParameterMemoryError, _MEMORY, small.declare, "x", 1, description="words")
    small.declare("x", 1)


def test_p5_read_only() -> None:
    parameters = Pair().parameters
    parameters.declare("x", 1, read_only=True)
    parameters.set("x", 2)
    assert parameters.get("x") == 2 and parameters.describe("x").read_only
    parameters.constrain("x", read_only=False)
    assert not parameters.describe("x").read_only
    with raises(ParameterNotDeclaredError):
        parameters.constrain("nobody", read_only=True)


def test_p6_local_set_and_get() -> None:
    pair = Pair()
    pair.watch()
    parameters = pair.parameters
    for name, value, later in (("flag", False, True), ("count", 0, 7), ("gain", 0.0, 1.5)):
        assert parameters.declare(name, value) == value
        assert parameters.get(name) == value
        parameters.set(name, later)
        assert (parameters.get(name), pair.seen) == (later, [(value, later)])
        pair.seen.clear()
        pair.agrees = False
        failure(ParameterRejectedError, _REJECTED, parameters.set, name, value)
        assert (parameters.get(name), pair.seen) == (later, [(later, value)])
        pair.seen.clear()
        pair.agrees = True
    failure(ParameterTypeError, _TYPE, parameters.set, "gain", 2)
    with raises(ParameterNotDeclaredError):
        parameters.set("nobody", 2)
    assert not pair.seen


def test_p7_remote_set_and_get() -> None:
    pair = Pair().start()
    remote = pair.remote
    assert remote.list() == ["count", "flag", "gain"]
    for name, value, other in (("flag", True, False), ("count", 12, 13), ("gain", 1.5, 2.5)):
        assert remote.set(name, value) == ""
        assert pair.parameters.get(name) == remote.get(name) == value
        pair.agrees = False
        assert refusal(remote.set, name, other) == "Rejected by server"
        assert remote.get(name) == value
        pair.agrees = True
    assert len(pair.seen) == 6
    assert refusal(remote.set, "gain", 2) == "Type mismatch"
    with raises(ParameterNotDeclaredError):
        remote.get("nobody")


def test_p8_local_delete() -> None:
    pair = Pair()
    pair.watch()
    pair.agrees = False
    pair.parameters.declare("x", 1)
    pair.parameters.undeclare("x")
    for use in (pair.parameters.get, pair.parameters.undeclare):
        with raises(ParameterNotDeclaredError):
            use("x")
    assert not pair.seen


def test_p9_remote_delete() -> None:
    pair = Pair().start()
    pair.agrees = False
    assert refusal(pair.remote.delete, "gain") == "Rejected by server"
    assert len(pair.remote.list()) == 3
    pair.agrees = True
    assert pair.remote.delete("gain") == ""
    assert pair.remote.list() == ["count", "flag"]
    assert pair.seen == [(0.0, None), (0.0, None)]


def test_p10_remote_add() -> None:
    pair = Pair(undeclared=True).start()
    remote = pair.remote
    pair.agrees = False
    assert refusal(remote.set, "fourth", 10.5) == "New parameter rejected"
    pair.agrees = True
    assert remote.set("fourth", 10.5) == "New parameter added"
    assert (remote.list(), remote.get("fourth")) == (["count", "flag", "fourth", "gain"], 10.5)
    assert refusal(remote.set, "fifth", 1) == "Parameter server is full"
    assert pair.seen == [(None, 10.5), (None, 10.5)]
    strict = Pair().start()
    assert refusal(strict.remote.set, "fourth", 10.5) == "Parameter not found"
    assert not strict.seen


def test_p11_remote_read_only() -> None:
    pair = Pair()
    pair.parameters.declare("fixed", 1, read_only=True)
    pair.start()
    assert refusal(pair.remote.set, "fixed", 2) == "Read only parameter"
    assert refusal(pair.remote.delete, "fixed") == "Read only parameter"
    assert pair.remote.describe("fixed").read_only
    assert not pair.seen


def test_p12_describe() -> None:
    pair = Pair()
    pair.parameters.declare("int", 1, range=(0, 10, 1), description="a number", constraints="small")
    pair.parameters.declare("double", 0.0, range=(0.0, 0.125, 0.0625))
    pair.broker.settle()
    found = pair.remote.describe("int")
    assert (found.type, found.description, found.constraints) == (_INTEGER, "a number", "small")
    assert (found.range, found.read_only) == ((0, 10, 1), False)
    found = pair.remote.describe("double")
    assert (found.type, found.description, found.range) == (_DOUBLE, "", (0.0, 0.125, 0.0625))
    small = Pair(low_memory=True).start()
    assert small.remote.describe("gain").description == ""


def test_p13_events() -> None:
    pair = Pair().start()
    pair.broker.run(20)
    pair.events.clear()
    pair.remote.set("count", 3)
    pair.parameters.declare("late", 1)
    pair.broker.run(20)
    pair.remote.delete("late")
    with raises(ParameterRejectedError):
        pair.remote.set("count", 1.0)
    pair.broker.until(lambda: len(pair.events) > 2)
    assert pair.events == [[[], ["count"], []], [["late"], [], []], [[], [], ["late"]]]
    assert pair.parameters.lost == 0


def test_p14_types() -> None:
    pair = Pair().start()
    assert pair.remote.types(["flag", "count", "gain"]) == {"flag": _BOOL, "count": _INTEGER, "gain": _DOUBLE}
    small = Pair(low_memory=True).start()
    for name, kind in (("flag", _BOOL), ("count", _INTEGER), ("gain", _DOUBLE)):
        assert small.remote.types([name]) == {name: kind}
    with raises(ParameterNotDeclaredError):
        small.remote.types(["flag", "count"])


def test_p15_in_the_callback() -> None:
    pair = Pair().start()
    parameters = pair.parameters
    refused: "list[Any]" = []

    def meddle(old: "Any", new: "Any") -> bool:
        for use, given in (
            (parameters.set, ("count", 3)),
            (parameters.declare, ("y", 3)),
            (parameters.undeclare, ("count",)),
            (parameters.constrain, ("count", (0, 5))),
        ):
            refused.append(failure(ParameterChangingError, _CHANGING, use, *given))
        return bool(parameters.get("count") == 0)

    parameters.on_change(meddle)
    parameters.set("count", 2)
    assert len(refused) == 4


def test_waiting_for_parameters_ends_where_ticks_wrap() -> None:
    pair = Pair()
    nobody = ParameterClient(pair.remote.node, "/lab/nobody", 1.0)
    broker = pair.broker
    broker.settle()
    start = broker.now
    first = ticks_add(0, -500 - start)
    pair.remote.node.context.clock = lambda: ticks_add(first, broker.now)
    assert not nobody.wait(2.0)
    assert 2000 <= broker.now - start < 2100


EVERY_TYPE: "dict[str, Any]" = {
    "b": True,
    "i": -(1 << 63),
    "d": 1.5,
    "s": "grüß dich",
    "bytes": b"\x00\xff",
    "bs": [True, False],
    "is": [1, -1, (1 << 63) - 1],
    "ds": [0.25, -2.0],
    "ss": ["a", "", "b"],
}


def test_every_type() -> None:
    pair = Pair(max=20)
    for name in EVERY_TYPE:
        pair.parameters.declare(name, EVERY_TYPE[name])
    pair.broker.settle()
    names = sorted(EVERY_TYPE)
    assert pair.remote.list() == names
    assert pair.remote.get(names) == EVERY_TYPE
    assert sorted(pair.remote.types(names).values()) == list(range(1, 10))
    changed: "dict[str, Any]" = {
        "i": 7,
        "s": "x" * 600,
        "is": list(range(40)),
        "ss": ["y"] * 20,
        "bytes": b"abc",
    }
    assert pair.remote.update(changed) == ""
    assert pair.remote.get(list(changed)) == changed
    for name in changed:
        assert pair.parameters.get(name) == changed[name]


def test_set_atomically_is_all_or_none() -> None:
    pair = Pair()
    pair.parameters.declare("a", 1)
    pair.parameters.declare("b", 2, range=(0, 5))
    pair.broker.settle()
    assert refusal(pair.remote.update, {"a": 7, "b": 6}) == "Parameter {b} doesn't comply with integer range."
    assert pair.remote.get(["a", "b"]) == {"a": 1, "b": 2}
    assert pair.remote.update({"a": 7, "b": 5}) == ""
    with raises(ParameterRejectedError):
        pair.remote.update({"a": 8, "b": 6}, False)
    assert pair.remote.get(["a", "b"]) == {"a": 8, "b": 5}


def test_list_with_prefixes_and_depth() -> None:
    pair = Pair(max=9)
    every = ["a", "a.b", "a.b.c", "ab", "x.y"]
    for name in reversed(every):
        pair.parameters.declare(name, 1)
    pair.broker.settle()
    cases: "list[tuple[list[str], int, list[str]]]" = [
        ([], 0, every),
        ([], 1, ["a", "ab"]),
        (["a"], 0, ["a", "a.b", "a.b.c"]),
        (["a"], 1, ["a", "a.b"]),
        (["a.b", "x"], 1, ["a.b", "a.b.c", "x.y"]),
        (["nobody"], 0, []),
    ]
    for prefixes, depth, wanted in cases:
        assert pair.remote.list(prefixes, depth) == pair.parameters.list(prefixes, depth) == wanted


def test_nobody_answers() -> None:
    pair = Pair()
    nobody = ParameterClient(pair.remote.node, "/lab/nobody", 0.1)
    pair.broker.settle()
    failure(ParameterTimeoutError, 2, nobody.list)
    got: "list[Any]" = []
    nobody.list(then=got.append)
    pair.broker.until(lambda: got)
    assert isinstance(got[0], ParameterTimeoutError)
