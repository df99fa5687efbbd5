"""Parameters on boards: rules, answers and errors, with messages that are only fields."""

from muros.client import Session
from muros.rclc import (
    CapacityError,
    Context,
    ParameterError,
    ParameterNotDeclaredError,
    ParameterRejectedError,
    Parameters,
    ParameterTypeError,
)
from muros.rclc.parameter_errors import InvalidParameterError, ParameterChangingError, ParameterMemoryError
from tests.board.agent import Agent
from tests.board.harness import raises

TYPE_CHECKING = 0
if TYPE_CHECKING:
    from typing import Any


class Fields:
    """A message: whatever was put into it."""

    TYPE = "rcl_interfaces/msg/Any"

    def __init__(self) -> None:
        self.stamp: "Any" = None
        self.result: "Any" = None
        self.names: "list[str]" = []
        self.prefixes: "list[str]" = []
        self.types = b""
        self.values: "list[Any]" = []
        self.depth = 0
        self.name = ""
        self.type = 0
        self.value: "Any" = None
        self.parameters: "list[Any]" = []
        self.results: "list[Any]" = []
        self.successful = False
        self.reason = ""
        self.descriptors: "list[Any]" = []

    def size(self) -> int:
        """A byte that stands for all."""
        return 1

    def write(self, buf: bytearray, off: int) -> int:
        """Writes it."""
        buf[off] = 0
        return off + 1


class Outer(Fields):
    """One that has another within."""

    def __init__(self) -> None:
        super().__init__()
        self.result = Fields()


class Asking:
    """A service."""

    TYPE = "rcl_interfaces/srv/Any"
    Request = Outer
    Response = Outer


def kind(name: str) -> "Any":
    """The class of a type."""
    return Asking if name.startswith("srv/") else Fields


def make(max: int = 4, undeclared: bool = False, low_memory: bool = False) -> "Parameters":
    """Parameters of a node on a board."""
    node = Context(Session(Agent(), 1)).node("board", "lab")
    return Parameters(node, max, True, undeclared, low_memory, 49, kind)


def wanted(name: str, type: int, field: str = "", value: "Any" = None) -> "Any":
    """A parameter in a request."""
    made = Fields()
    made.name = name
    made.value = Fields()
    made.value.type = type
    if field:
        setattr(made.value, field, value)
    return made


def request(parameters: "list[Any]") -> "Any":
    """A request to set them."""
    made = Outer()
    made.parameters = parameters
    return made


def test_declare_get_and_set() -> None:
    parameters = make()
    assert parameters.full_name == "/lab/board"
    assert len(parameters.handles) == 6
    parameters.declare("gain", 1.0, range=(0.0, 8.0, 0.5), description="loop gain")
    parameters.declare("count", 3, read_only=True)
    parameters.set("gain", 2.5)
    parameters.set("count", 4)
    assert parameters.get("gain") == 2.5
    assert parameters.get("count") == 4
    assert parameters.list() == ["count", "gain"]
    assert parameters.describe("gain").range == (0.0, 8.0, 0.5)
    for value in (2.75, 8.5, -0.5):
        with raises(ParameterRejectedError):
            parameters.set("gain", value)
    with raises(ParameterTypeError) as caught:
        parameters.set("gain", 3)
    assert getattr(caught.value, "code") == 4002  # noqa: B009
    with raises(ParameterNotDeclaredError):
        parameters.get("nobody")
    with raises(ParameterError):
        parameters.declare("gain", 1.0)
    with raises(ParameterError):
        parameters.declare("x" * 50, 1)
    with raises(InvalidParameterError):
        parameters.declare("mixed", [1, "a"])
    parameters.declare("list", [1.5, 2.5])
    parameters.declare("bytes", b"ab")
    with raises(CapacityError):
        parameters.declare("fifth", 1)
    parameters.undeclare("list")
    with raises(ParameterNotDeclaredError):
        parameters.get("list")


def test_the_callback_decides_and_changes_nothing() -> None:
    parameters = make()
    parameters.declare("x", 1)
    seen: "list[Any]" = []

    def decide(old: "Any", new: "Any") -> bool:
        with raises(ParameterChangingError):
            parameters.set("x", 9)
        seen.append((old.value, new.value))
        return bool(new.value < 5)

    parameters.on_change(decide)
    parameters.set("x", 2)
    with raises(ParameterRejectedError):
        parameters.set("x", 5)
    assert parameters.get("x") == 2
    assert seen == [(1, 2), (2, 5)]


def test_what_others_set() -> None:
    parameters = make(undeclared=True)
    parameters.declare("x", 1, range=(0, 5))
    parameters.declare("y", 2, read_only=True)
    results = parameters._set(
        request(
            [
                wanted("x", 2, "integer_value", 4),
                wanted("x", 2, "integer_value", 6),
                wanted("x", 1, "bool_value", True),
                wanted("y", 2, "integer_value", 4),
                wanted("z", 4, "string_value", "new"),
                wanted("x", 99),
                wanted("nobody", 0),
            ]
        )
    ).results
    assert [result.successful for result in results] == [True, False, False, False, True, False, False]
    assert [result.reason for result in results] == [
        "",
        "Parameter {x} doesn't comply with integer range.",
        "Type mismatch",
        "Read only parameter",
        "New parameter added",
        "Type not supported",
        "Parameter not found",
    ]
    both = request([wanted("x", 2, "integer_value", 5), wanted("y", 0)])
    assert not parameters._set_atomically(both).result.successful
    assert parameters.get("x") == 4
    assert parameters._set_atomically(request([wanted("x", 0), wanted("z", 0)])).result.successful
    assert parameters.list() == ["y"]
    assert parameters.lost > 0, "no agent is connected"


def test_what_others_ask() -> None:
    parameters = make()
    for name in ("b.c", "a", "b.d.e"):
        parameters.declare(name, 1.5, range=(0, 2))
    asked = Outer()
    found = parameters._list(asked).result
    assert found.names == ["a", "b.c", "b.d.e"]
    assert found.prefixes == ["b", "b.d"]
    asked.prefixes = ["b"]
    asked.depth = 1
    assert parameters._list(asked).result.names == ["b.c"]
    asked.names = ["a", "b.c"]
    assert list(parameters._types(asked).types) == [3, 3]
    assert [value.double_value for value in parameters._get(asked).values] == [1.5, 1.5]
    about = parameters._describe(asked).descriptors[0]
    assert (about.name, about.type, about.floating_point_range[0].to_value) == ("a", 3, 2.0)
    asked.names = ["a", "nobody"]
    assert parameters._get(asked).values == []
    assert parameters._describe(asked).descriptors == []


def test_low_memory() -> None:
    parameters = make(low_memory=True)
    with raises(ParameterMemoryError):
        parameters.declare("x", 1, description="words")
    parameters.declare("x", 1)
    parameters.declare("y", 1)
    asked = Outer()
    asked.names = ["x", "y"]
    assert parameters._get(asked).values == []
    asked.names = ["x"]
    assert parameters._get(asked).values[0].integer_value == 1
    both = request([wanted("x", 2, "integer_value", 5), wanted("y", 2, "integer_value", 5)])
    assert [result.successful for result in parameters._set(both).results] == [False, False]
