"""Parameters over every way, by the ids of the acceptance cases: a node that has them, and a client that asks.

P1 to P15 are what the C library's own suite expects; `tests/vectors/rmw/parameters.json` has its codes and reasons.
"""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from muros.rclc import (
    CapacityError,
    Context,
    Executor,
    Node,
    Parameter,
    ParameterClient,
    ParameterError,
    ParameterNotDeclaredError,
    ParameterRejectedError,
    Parameters,
    ParameterTypeError,
    RclError,
)
from muros.rclc.parameter_errors import (
    InvalidParameterError,
    ParameterChangingError,
    ParameterMemoryError,
    ParameterTimeoutError,
)
from tests.rclc_space.spun import Spun
from tests.rclc_space.ways import PATIENCE, Stage

VECTORS: dict[str, Any] = json.loads((Path(__file__).parents[1] / "vectors/rmw/parameters.json").read_text())
REASONS = {case["when"]: case["reason"] for case in VECTORS["external_set_reasons"]}
CODES = {case["call"]: case["ret"] for case in VECTORS["local_api"]}
BOOL, INTEGER, DOUBLE = (VECTORS["types"][name] for name in ("BOOL", "INTEGER", "DOUBLE"))

Changes = list[tuple[Parameter | None, Parameter | None]]


class Pair:
    """A node with parameters that a thread spins, and a client in a context of its own."""

    def __init__(self, stage: Stage, **options: Any) -> None:
        self.stage = stage
        self.server = Spun(stage.way.open())
        self.client: Context = stage.way.open()
        self.node = self.server.context.node("server", "lab")
        self.parameters: Parameters = self.node.parameters(**options)
        self.asker = self.client.node("asker")
        self.remote = ParameterClient(self.asker, "/lab/server", PATIENCE)
        self.events: list[Any] = []
        self.seen: Changes = []
        self.agrees = True

    def start(self) -> None:
        """From now on the node answers, and the client hears its events."""
        self.remote.on_event(self.events.append)
        self.server.start()
        assert self.remote.wait(PATIENCE)

    def declare_three(self) -> None:
        """A parameter of each type that the C library has."""
        for name, value in (("flag", False), ("count", 0), ("gain", 0.0)):
            self.parameters.declare(name, value)

    def watch(self) -> None:
        """Keeps what the callback is asked, which says what `agrees` says."""

        def decide(old: Parameter | None, new: Parameter | None) -> bool:
            self.seen.append((old, new))
            return self.agrees

        self.parameters.on_change(decide)

    def event(self) -> Any:
        """The next event that the client hears."""
        executor = Executor(self.client)
        end = time.monotonic() + PATIENCE
        while not self.events:
            assert time.monotonic() < end, "no event came"
            executor.spin_some(0.05)
        return self.events.pop(0)

    def close(self) -> None:
        """Ends both."""
        self.client.close()
        self.server.close()


@pytest.fixture
def pair(stage: Stage) -> Iterator[Callable[..., Pair]]:
    """Pairs that are closed at the end."""
    made: list[Pair] = []

    def make(**options: Any) -> Pair:
        made.append(Pair(stage, **options))
        return made[-1]

    yield make
    for one in made:
        one.close()


PROFILES: list[dict[str, Any]] = [{}, {"low_memory": True, "undeclared": True}]
"""What the C library's suite is run with."""
profiles = pytest.mark.parametrize("profile", PROFILES, ids=["default", "low memory"])


def refusal(call: Callable[[], object]) -> str:
    """The reason for which a node refuses what a client wants."""
    with pytest.raises(ParameterRejectedError) as caught:
        call()
    assert caught.value.code == 4001
    return str(caught.value).partition(": ")[2]


def keeping(seen: Changes, agrees: list[bool]) -> Callable[[Parameter | None, Parameter | None], bool]:
    """A callback that keeps what it is asked."""

    def decide(old: Parameter | None, new: Parameter | None) -> bool:
        seen.append((old, new))
        return agrees[0]

    return decide


@pytest.fixture
def server(stage: Stage) -> Node:
    """A node that is there for all to see, though nobody asks it anything."""
    made = stage.node("server")
    stage.meet()
    return made


def names(parameters: Any) -> list[str]:
    """The names in a list of an event."""
    return [parameter.name for parameter in parameters]


# ---- what needs nobody else ----


def test_p1_init(server: Node) -> None:
    parameters = server.parameters()
    executor = Executor(server.context, handles=6)
    for handle in parameters.handles:
        executor.add(handle)
    with pytest.raises(CapacityError):
        executor.add(server.timer(1.0, print))
    with pytest.raises(RclError, match="has parameters already"):
        server.parameters()
    parameters.on_change(None)
    parameters.destroy()
    server.parameters()


def test_p2_add(server: Node) -> None:
    parameters = server.parameters(max=4, longest=49)
    for i, value in enumerate((True, 1, 1.0, False)):
        parameters.declare(f"p{i}", value)
    for name, kind in (("p1", ParameterError), ("x" * 50, ParameterError), ("fifth", RclError)):
        with pytest.raises(kind) as caught:
            parameters.declare(name, 1)
        assert caught.value.code == 1
    assert parameters.list() == ["p0", "p1", "p2", "p3"]
    parameters.undeclare("p0")
    parameters.declare("x" * 49, 1)


@pytest.mark.parametrize("name", [None, "", 3])
def test_p2_add_without_a_name(server: Node, name: Any) -> None:
    with pytest.raises(InvalidParameterError) as caught:
        server.parameters().declare(name, 1)
    assert caught.value.code == 11


@pytest.mark.parametrize("value", [None, object(), [1, "a"], [1, 2.0], [None], [], {}, 1 << 63, [[1]]])
def test_what_can_be_no_value(server: Node, value: Any) -> None:
    parameters = server.parameters()
    with pytest.raises(InvalidParameterError, match="a value is a bool"):
        parameters.declare("x", value)
    parameters.declare("y", 1)
    with pytest.raises(InvalidParameterError, match="a value is a bool"):
        parameters.set("y", value)
    assert parameters.get("y") == 1


def test_p3_constraint(server: Node) -> None:
    parameters = server.parameters()
    parameters.declare("int", 0, range=(0, 10, 1))
    parameters.declare("double", 0.0)
    parameters.constrain("double", range=(0, 0.1, 0.01))
    assert parameters.describe("int").range == (0, 10, 1)
    assert parameters.describe("double").range == (0.0, 0.1, 0.01)
    parameters.declare("text", "")
    for name, span in (
        ("int", (0.0, 1.0)),
        ("text", (0, 1)),
        ("int", (0,)),
        ("int", (2, 1)),
        ("int", (0, 1, -1)),
    ):
        with pytest.raises(InvalidParameterError):
            parameters.constrain(name, range=span)
    with pytest.raises(ParameterNotDeclaredError):
        parameters.constrain("nobody", range=(0, 1))
    with pytest.raises(ParameterRejectedError, match="not in its range"):
        parameters.declare("far", 11, range=(0, 10))


@pytest.mark.parametrize(
    ("first", "span", "good", "bad"),
    [
        (0, (0, 10, 3), [0, 3, 9, 10], [1, 4, -3, 13]),
        (-5, (-5, 5), [-5, 0, 5], [-6, 6]),
        (1, (1, 10, 2), [3, 10], [2]),
        (0.0, (0.0, 0.1, 0.01), [0.0, 0.01, 0.07, 0.1], [0.005, -0.01, 0.11, float("nan"), float("inf")]),
        (0.0, (0.0, 1.0), [0.123, 1.0], [1.1, -0.1]),
        (1.0, (0.0, float("inf")), [float("inf"), 5.5], [-1.0, float("-inf")]),
        (0.0, (-0.5, 1.0, 0.5), [-0.5, 0.5, 1.0], [0.25]),
    ],
)
def test_ranges_are_enforced(server: Node, first: Any, span: Any, good: Any, bad: Any) -> None:
    parameters = server.parameters()
    parameters.declare("x", first, range=span)
    for value in good:
        parameters.set("x", value)
        assert parameters.get("x") == value
    for value in bad:
        with pytest.raises(ParameterRejectedError, match="range"):
            parameters.set("x", value)
    assert parameters.get("x") == good[-1]


def test_p4_description(server: Node) -> None:
    parameters = server.parameters(longest=49)
    parameters.declare("x", 1, description="what it is")
    parameters.constrain("x", constraints="and more")
    assert parameters.describe("x").description == "what it is"
    calls: list[Callable[[], object]] = [
        lambda: parameters.constrain("x", description="d" * 50),
        lambda: parameters.constrain("nobody", description=""),
    ]
    for call in calls:
        with pytest.raises(ParameterError) as caught:
            call()
        assert caught.value.code == 1
    small = server.context.node("small").parameters(low_memory=True)
    with pytest.raises(ParameterMemoryError) as memory:
        small.declare("x", 1, description="what it is")
    assert memory.value.code == CODES["describe in low memory mode"]
    small.declare("x", 1)


def test_p5_read_only(server: Node) -> None:
    parameters = server.parameters()
    parameters.declare("x", 1, read_only=True)
    parameters.set("x", 2)  # of ours
    assert parameters.get("x") == 2
    assert parameters.describe("x").read_only
    parameters.constrain("x", read_only=False)
    assert not parameters.describe("x").read_only
    with pytest.raises(ParameterNotDeclaredError):
        parameters.constrain("nobody", read_only=True)


def test_p6_local_set_and_get(server: Node) -> None:
    parameters = server.parameters()
    seen: Changes = []
    agrees = [True]
    parameters.on_change(keeping(seen, agrees))
    for name, value, kind, later in (
        ("flag", False, BOOL, True),
        ("count", 0, INTEGER, 7),
        ("gain", 0.0, DOUBLE, 1.5),
    ):
        assert parameters.declare(name, value) == value == parameters.get(name)
        parameters.set(name, later)
        assert parameters.get(name) == later
        old, new = seen.pop()
        assert old is not None
        assert new is not None
        assert (old.name, old.type, old.value) == (name, kind, value)
        assert (new.name, new.type, new.value) == (name, kind, later)
        assert not seen, "asked once"
        agrees[0] = False
        with pytest.raises(ParameterRejectedError) as caught:
            parameters.set(name, value)
        assert caught.value.code == CODES["set, callback false"]
        assert parameters.get(name) == later
        assert len(seen) == 1
        seen.clear()
        agrees[0] = True
    with pytest.raises(ParameterTypeError) as mismatch:
        parameters.set("gain", 2)
    assert mismatch.value.code == CODES["set wrong type"]
    assert str(mismatch.value) == "parameter 'gain' of /server is of type double, not integer"
    with pytest.raises(ParameterNotDeclaredError) as unknown:
        parameters.set("nobody", 2)
    assert str(unknown.value) == "/server has no parameter 'nobody'; it has count, flag, gain"
    assert not seen


def test_p8_local_delete(server: Node) -> None:
    parameters = server.parameters()
    seen: Changes = []
    parameters.on_change(keeping(seen, [False]))
    parameters.declare("x", 1)
    parameters.undeclare("x")
    for call in (parameters.get, parameters.undeclare):
        with pytest.raises(ParameterNotDeclaredError):
            call("x")
    assert not seen


def test_p15_in_the_callback(server: Node) -> None:
    parameters = server.parameters()
    parameters.declare("x", 1)
    raised: list[ParameterChangingError] = []

    def meddle(old: Parameter | None, new: Parameter | None) -> bool:
        for call in (
            lambda: parameters.set("x", 3),
            lambda: parameters.declare("y", 3),
            lambda: parameters.undeclare("x"),
            lambda: parameters.constrain("x", description="new"),
        ):
            with pytest.raises(ParameterChangingError) as caught:
                call()
            raised.append(caught.value)
        assert parameters.get("x") == 1
        return True

    parameters.on_change(meddle)
    parameters.set("x", 2)
    assert [error.code for error in raised] == [CODES["any mutator inside the callback"]] * 4
    parameters.on_change(None)
    parameters.set("x", 3)


def test_a_callback_that_raises_changes_nothing(server: Node) -> None:
    parameters = server.parameters()
    parameters.declare("x", 1)

    def fail(old: Parameter | None, new: Parameter | None) -> bool:
        raise ValueError("no")

    parameters.on_change(fail)
    with pytest.raises(ValueError, match="no"):
        parameters.set("x", 2)
    assert parameters.get("x") == 1
    parameters.on_change(None)
    parameters.set("x", 2)


def test_several_of_ours_at_once_all_or_none(server: Node) -> None:
    parameters = server.parameters()
    parameters.declare("a", 1)
    parameters.declare("b", 2, range=(0, 5))
    with pytest.raises(ParameterRejectedError):
        parameters.update({"a": 2, "b": 6})
    assert parameters.get("a") == 1
    parameters.update({"a": 2, "b": 5})
    assert (parameters.get("a"), parameters.get("b")) == (2, 5)


def test_a_value_is_kept_apart_from_what_it_was_made_of(server: Node) -> None:
    parameters = server.parameters()
    given = [1, 2]
    parameters.declare("x", given)
    given.append(3)
    assert parameters.get("x") == [1, 2]
    parameters.set("x", [])
    assert parameters.get("x") == []
    parameters.declare("none", [], type=9)
    assert parameters.describe("none").type == 9


# ---- what others ask ----


@profiles
def test_p7_remote_set_and_get(pair: Callable[..., Pair], profile: dict[str, Any]) -> None:
    both = pair(**profile)
    both.declare_three()
    both.watch()
    both.start()
    assert both.remote.list() == ["count", "flag", "gain"]
    for name, value in (("flag", True), ("count", 12), ("gain", 1.5)):
        assert both.remote.set(name, value) == REASONS["exists, accepted"]
        assert both.parameters.get(name) == value == both.remote.get(name)
        both.agrees = False
        other = not value if value is True else value * 2
        assert refusal(partial(both.remote.set, name, other)) == REASONS["callback false"]
        assert both.remote.get(name) == value
        both.agrees = True
    assert len(both.seen) == 6
    assert refusal(lambda: both.remote.set("gain", 2)) == REASONS["type differs"]
    if not profile:
        with pytest.raises(ParameterNotDeclaredError):
            both.remote.get("nobody")


@profiles
def test_p9_remote_delete(pair: Callable[..., Pair], profile: dict[str, Any]) -> None:
    both = pair(**profile)
    both.declare_three()
    both.watch()
    both.start()
    both.agrees = False
    why = refusal(lambda: both.remote.delete("gain"))
    assert why == REASONS["set to NOT_SET (delete), callback(old,NULL) false"]
    assert len(both.remote.list()) == 3
    both.agrees = True
    assert both.remote.delete("gain") == REASONS["delete accepted"]
    assert both.remote.list() == ["count", "flag"]
    assert [(old.name if old else old, new) for old, new in both.seen] == [("gain", None)] * 2
    assert refusal(lambda: both.remote.delete("gain")) == REASONS["unknown, undeclared not allowed"]


def test_p10_remote_add(pair: Callable[..., Pair]) -> None:
    both = pair(max=4, undeclared=True)
    both.declare_three()
    both.watch()
    both.start()
    both.agrees = False
    why = refusal(lambda: both.remote.set("fourth", 10.5))
    assert why == REASONS["unknown, callback(NULL,new) false"]
    both.agrees = True
    assert both.remote.set("fourth", 10.5) == REASONS["unknown, added"]
    assert both.remote.list() == ["count", "flag", "fourth", "gain"]
    assert both.remote.get("fourth") == 10.5
    assert [(old, new.name if new else new) for old, new in both.seen] == [(None, "fourth")] * 2
    assert refusal(lambda: both.remote.set("fifth", 1)) == REASONS["unknown, server full"]
    assert len(both.seen) == 2
    assert both.remote.get(["nobody", "count"]) == {"nobody": None, "count": 0}
    assert both.remote.types(["nobody"]) == {"nobody": 0}
    assert (both.remote.describe("nobody").name, both.remote.describe("nobody").type) == ("nobody", 0)


def test_p10_remote_add_is_not_allowed(pair: Callable[..., Pair]) -> None:
    both = pair()
    both.watch()
    both.start()
    assert refusal(lambda: both.remote.set("x", 1)) == REASONS["unknown, undeclared not allowed"]
    assert not both.seen
    assert both.remote.list() == []


@profiles
def test_p11_remote_read_only(pair: Callable[..., Pair], profile: dict[str, Any]) -> None:
    both = pair(**profile)
    both.parameters.declare("fixed", 1, read_only=True)
    both.watch()
    both.start()
    for call in (lambda: both.remote.set("fixed", 2), lambda: both.remote.delete("fixed")):
        assert refusal(call) == REASONS["read only"]
    assert both.remote.describe("fixed").read_only
    assert not both.seen


def test_p12_describe(pair: Callable[..., Pair]) -> None:
    both = pair()
    both.parameters.declare("int", 1, range=(0, 10, 1), description="a number", constraints="small")
    both.parameters.declare("double", 0.0, range=(0.0, 0.1, 0.01))
    both.start()
    found = both.remote.describe("int")
    assert (found.type, found.description, found.constraints) == (INTEGER, "a number", "small")
    assert (found.range, found.read_only) == ((0, 10, 1), False)
    found = both.remote.describe("double")
    assert (found.type, found.description, found.range) == (DOUBLE, "", (0.0, 0.1, 0.01))
    with pytest.raises(ParameterNotDeclaredError, match="/lab/server has no parameter 'nobody'"):
        both.remote.describe("nobody")


def test_p12_and_p14_low_memory(pair: Callable[..., Pair]) -> None:
    both = pair(low_memory=True, undeclared=True)
    both.declare_three()
    both.start()
    assert [both.remote.types([name])[name] for name in ("flag", "count", "gain")] == [BOOL, INTEGER, DOUBLE]
    assert both.remote.describe("gain").description == ""
    calls: list[Callable[[], object]] = [
        lambda: both.remote.types(["flag", "count"]),
        lambda: both.remote.get(["flag", "count"]),
    ]
    for call in calls:
        with pytest.raises(ParameterNotDeclaredError):
            call()
    for atomically in (True, False):
        with pytest.raises(ParameterRejectedError, match="One parameter a request"):
            both.remote.update({"flag": True, "count": 1}, atomically)
    assert both.remote.set("count", 1) == ""
    assert both.parameters.get("flag") is False


@profiles
def test_p13_events(pair: Callable[..., Pair], profile: dict[str, Any]) -> None:
    both = pair(**profile)
    both.declare_three()
    both.start()
    before = time.time()
    both.remote.set("count", 3)
    event = both.event()
    assert (event.node, names(event.changed_parameters)) == ("/lab/server", ["count"])
    assert event.changed_parameters[0].value.integer_value == 3
    assert before - 1 < event.stamp.sec < time.time() + 1
    assert not event.new_parameters
    assert not event.deleted_parameters
    both.server.do(lambda: both.parameters.declare("late", "text"))
    event = both.event()
    assert names(event.new_parameters) == ["late"]
    assert not event.changed_parameters
    assert not event.deleted_parameters
    both.remote.delete("late")
    event = both.event()
    assert names(event.deleted_parameters) == ["late"]
    assert not event.new_parameters
    assert not event.changed_parameters
    both.server.do(lambda: both.parameters.undeclare("flag"))
    assert names(both.event().deleted_parameters) == ["flag"]
    with pytest.raises(ParameterRejectedError):
        both.remote.set("count", 1.0)
    together = {"count": 4} if profile else {"count": 4, "gain": 2.0}
    both.remote.update(together)
    event = both.event()
    assert names(event.changed_parameters) == list(together), "nothing was told of what was refused"
    assert both.parameters.lost == 0


def test_p14_types(pair: Callable[..., Pair]) -> None:
    both = pair()
    both.declare_three()
    both.start()
    assert list(both.remote.types(["flag", "count", "gain"]).values()) == VECTORS["rclc_supported"]
    with pytest.raises(ParameterNotDeclaredError):
        both.remote.types(["flag", "nobody"])


EVERY_TYPE = {
    "b": True,
    "i": -(1 << 63),
    "d": 1.5,
    "s": "gr\u00fc\u00df dich",
    "bytes": b"\x00\xff",
    "bs": [True, False],
    "is": [1, -1],
    "ds": [0.25, 1e300],
    "ss": ["a", "", "b"],
}


def test_every_type(pair: Callable[..., Pair], tmp_path: Path) -> None:
    both = pair()
    for name, value in EVERY_TYPE.items():
        both.parameters.declare(name, value)
    both.parameters.declare("motor.current", 3)
    both.start()
    assert both.remote.get(list(EVERY_TYPE)) == EVERY_TYPE
    assert list(both.remote.types(list(EVERY_TYPE)).values()) == list(range(1, 10))
    changed = {
        "b": False,
        "i": 1,
        "d": 2.0,
        "s": "x" * 3000,
        "bytes": b"abc",
        "bs": [],
        "is": list(range(300)),
        "ds": [1.0],
        "ss": ["x"],
    }
    file = tmp_path / "all.yaml"
    text = both.remote.dump(file)
    assert text.startswith("/lab/server:\n  ros__parameters:\n    b: true\n")
    assert "    motor:\n      current: 3\n" in text
    both.remote.update({name: value for name, value in changed.items() if value != []})
    both.server.do(lambda: both.parameters.set("bs", []))
    assert both.remote.get(list(changed)) == changed
    second = tmp_path / "changed.yaml"
    both.remote.dump(second)
    both.remote.load(file)
    assert both.remote.get(list(EVERY_TYPE)) == EVERY_TYPE
    both.remote.load(second)
    assert both.remote.get(list(EVERY_TYPE)) == changed


def test_set_atomically_is_all_or_none(pair: Callable[..., Pair]) -> None:
    both = pair()
    both.parameters.declare("a", 1)
    both.parameters.declare("b", 2, range=(0, 5))
    both.start()
    why = refusal(lambda: both.remote.update({"a": 7, "b": 6}))
    assert why == "Parameter {b} doesn't comply with integer range."
    assert both.remote.get(["a", "b"]) == {"a": 1, "b": 2}
    assert both.remote.update({"a": 7, "b": 5}) == ""
    assert both.remote.get(["a", "b"]) == {"a": 7, "b": 5}
    with pytest.raises(ParameterRejectedError, match=r"refuses b: Parameter \{b\} doesn't comply"):
        both.remote.update({"a": 8, "b": 6}, atomically=False)
    assert both.remote.get(["a", "b"]) == {"a": 8, "b": 5}


def test_list_with_prefixes_and_depth(pair: Callable[..., Pair]) -> None:
    both = pair()
    every = ["a", "a.b", "a.b.c", "ab", "x.y"]
    for name in reversed(every):
        both.parameters.declare(name, 1)
    both.start()
    for prefixes, depth, wanted in (
        ([], 0, every),
        ([], 1, ["a", "ab"]),
        ([], 2, ["a", "a.b", "ab", "x.y"]),
        (["a"], 0, ["a", "a.b", "a.b.c"]),
        (["a"], 1, ["a", "a.b"]),
        (["a.b", "x"], 1, ["a.b", "a.b.c", "x.y"]),
        (["nobody"], 0, []),
    ):
        assert both.remote.list(prefixes, depth) == wanted == both.parameters.list(prefixes, depth)


def test_a_callback_that_raises_is_answered(pair: Callable[..., Pair]) -> None:
    both = pair()
    both.declare_three()

    def fail(old: Parameter | None, new: Parameter | None) -> bool:
        raise ValueError("no")

    both.parameters.on_change(fail)
    both.start()
    assert refusal(lambda: both.remote.set("count", 3)) == REASONS["internal failure"]
    assert refusal(lambda: both.remote.update({"count": 3})) == REASONS["internal failure"]
    assert both.remote.get("count") == 0
    both.server.do(lambda: None)
    assert [str(error) for error in both.server.raised] == ["no", "no"]


def test_within_an_executor(pair: Callable[..., Pair]) -> None:
    both = pair()
    both.declare_three()
    both.start()
    got: list[Any] = []
    executor = Executor(both.client)
    end = time.monotonic() + PATIENCE
    asks: list[Callable[..., Any]] = [
        partial(both.remote.get, "count"),
        partial(both.remote.set, "count", 5),
        partial(both.remote.set, "count", "five"),
        both.remote.list,
    ]
    for number, ask in enumerate(asks):
        asked = False
        while len(got) <= number:
            assert time.monotonic() < end
            with suppress(ParameterError):  # through an agent it is refused until the client is there
                asked = asked or ask(then=got.append) is None
            executor.spin_some(0.05)
    assert isinstance(got[2], ParameterRejectedError)
    assert str(got[2]) == "/lab/server refuses count: Type mismatch"
    assert [got[0], got[1], got[3]] == [0, "", ["count", "flag", "gain"]]


def test_nobody_answers(stage: Stage) -> None:
    context = stage.way.open()
    remote = ParameterClient(context.node("asker"), "nobody", 0.1)
    with pytest.raises(
        ParameterTimeoutError, match=r"/nobody did not answer within 0.1 s: is it there"
    ) as caught:
        remote.list()
    assert caught.value.code == 2
    assert not remote.wait(0.2)
    got: list[Any] = []
    if stage.way.direct:
        remote.list(then=got.append)
        end = time.monotonic() + PATIENCE
        while not got:
            assert time.monotonic() < end
            Executor(context).spin_some(0.05)
        assert isinstance(got[0], ParameterTimeoutError)
    remote.destroy()
    context.close()
