"""Arguments of ROS 2: rules for names, parameters, levels; what is no argument is said in one line."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from muros.rclc import ArgumentsError, Context, InvalidNameError, Node, RosArguments, remove_ros_arguments

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32

OPEN: list[Context] = []


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    """Closes what a test has opened."""
    yield
    while OPEN:
        OPEN.pop().close()


def program(*args: str) -> Context:
    """The context of a program with these arguments; it is never spun."""
    made = Context("local:", args=args)
    OPEN.append(made)
    return made


def node(rules: str = "", name: str = "arm", namespace: str = "/", **options: Any) -> Node:
    """A node of a program with these arguments."""
    return program("--ros-args", *rules.split()).node(name, namespace, **options)


@pytest.mark.parametrize(
    ("rules", "namespace", "name", "full"),
    [
        ("", "/", "chatter", "/chatter"),
        ("-r chatter:=talk", "/", "chatter", "/talk"),
        ("-r chatter:=talk", "/lab", "chatter", "/lab/talk"),
        ("-r chatter:=talk", "/lab", "/chatter", "/chatter"),
        ("-r chatter:=/talk", "/lab", "chatter", "/talk"),
        ("--remap=/lab/chatter:=~/talk", "/lab", "chatter", "/lab/arm/talk"),
        ("--remap ~/chatter:=talk", "/lab", "~/chatter", "/lab/talk"),
        ("-r a:=b -r a:=c -r b:=d", "/", "a", "/b"),
        ("-r leg:chatter:=talk", "/", "chatter", "/chatter"),
        ("-r arm:chatter:=talk", "/", "chatter", "/talk"),
        ("-r rostopic://chatter:=talk", "/", "chatter", "/talk"),
        ("-r rosservice://chatter:=talk", "/", "chatter", "/chatter"),
        ("-r __node:=leg -r leg:chatter:=talk", "/", "chatter", "/talk"),
        ("-r __ns:=/lab -r chatter:=talk", "/", "chatter", "/lab/talk"),
    ],
)
def test_topics_are_remapped(rules: str, namespace: str, name: str, full: str) -> None:
    made = node(rules, namespace=namespace)
    assert made.resolve_topic(name) == full
    publisher: Any = made.publisher(Int32, name)
    assert publisher.name == "rt" + full


def test_services_are_remapped() -> None:
    made = node("-r add:=/sum -r rosservice://sub:=difference -r rostopic://mul:=product")
    assert [made.resolve_service(name) for name in ("add", "sub", "mul")] == ["/sum", "/difference", "/mul"]
    assert made.resolve_topic("sub") == "/sub"
    assert made.service(AddTwoInts, "add", lambda request: None).name == "/sum"
    assert made.client(AddTwoInts, "add").name == "/sum"


@pytest.mark.parametrize(
    ("rules", "full"),
    [
        ("-r __node:=leg", "/lab/leg"),
        ("-r __name:=leg", "/lab/leg"),
        ("-r __ns:=/", "/arm"),
        ("-r __ns:=/a/b", "/a/b/arm"),
        ("-r leg:__node:=head", "/lab/arm"),
        ("-r arm:__node:=leg -r leg:__ns:=/here -r arm:__ns:=/there", "/here/leg"),
    ],
)
def test_nodes_are_remapped(rules: str, full: str) -> None:
    made = node(rules, namespace="lab")
    assert made.full_name == full


def test_rules_of_a_node_go_before_those_of_the_program() -> None:
    context = program("--ros-args", "-r", "a:=b", "-r", "__ns:=/lab")
    made = context.node("arm", remap={"a": "c", "__node": "leg"})
    assert (made.full_name, made.resolve_topic("a")) == ("/lab/leg", "/lab/c")
    assert context.node("arm", remap=["x:=y"]).resolve_topic("a") == "/lab/b"
    left = context.node("arm", remap=["x:=y"], use_arguments=False)
    assert (left.full_name, left.resolve_topic("a"), left.resolve_topic("x")) == ("/arm", "/a", "/y")


def test_a_rule_that_leads_nowhere_is_told_where_the_name_is_used() -> None:
    made = node("-r chatter:=~/talk")
    with pytest.raises(ArgumentsError):
        node("-r chatter:=~")
    assert made.resolve_topic("chatter") == "/arm/talk"
    with pytest.raises(InvalidNameError):
        made.resolve_topic("no name")


def test_the_command_line_of_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    line = ["program", "-v", "--ros-args", "-r", "__node:=leg", "--", "file"]
    monkeypatch.setattr("sys.argv", line)
    context = Context("local:")
    OPEN.append(context)
    assert context.node("arm").name == "leg"
    assert context.arguments.others == ("-v", "file")
    assert remove_ros_arguments(line) == ["program", "-v", "file"]
    assert program().node("arm").name == "arm"


def test_parameters_of_a_node(tmp_path: Path) -> None:
    file = tmp_path / "lab.yaml"
    file.write_text(
        "/lab/arm: {ros__parameters: {gain: 3.0, motor: {current: 4}}}\n"
        "/**: {ros__parameters: {gain: 1.0, speed: 2}}\n"
        "leg: {ros__parameters: {gain: 9.0}}\n"
    )
    given = ["-p", "speed:=5", "--params-file", str(file), "-p", "names:=[a, b]", "-p", "leg:speed:=7"]
    arguments = RosArguments.parse(["--ros-args", *given])
    assert arguments.parameters("/lab/arm") == {
        "speed": 2,
        "gain": 3.0,
        "motor.current": 4,
        "names": ["a", "b"],
    }
    assert arguments.parameters("/leg") == {"speed": 7, "gain": 9.0, "names": ["a", "b"]}
    assert arguments.parameters("/lab/leg")["gain"] == 1.0, "a name without a slash is that of the root"


def test_levels_of_loggers() -> None:
    arguments = RosArguments.parse(["--ros-args", "--log-level", "WARN", "--log-level", "lab.arm:=debug"])
    assert [arguments.level(name) for name in ("leg", "lab", "lab.arm", "lab.arm.motor")] == [30, 30, 10, 10]
    assert RosArguments().level("leg") is None


def test_switches() -> None:
    arguments = RosArguments.parse(["--ros-args", "--disable-rosout-logs", "-e", "/lab"])
    assert (arguments.rosout, arguments.stdout, arguments.enclave) == (False, True, "/lab")


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        ("-r", 1003, "-r needs a rule such as chatter:=/talk"),
        ("-p", 1003, "-p needs a parameter such as gain:=2.0"),
        ("--log-level", 1003, "--log-level needs a level"),
        ("--foo", 1003, "--ros-args takes no '--foo'"),
        ("--enable-fun", 1003, "takes no '--enable-fun'"),
        ("foo", 1003, "takes no 'foo'"),
        ("--params-file /nowhere.yaml", 1003, "--params-file /nowhere.yaml: No such file"),
        ("-r chatter", 1001, "'chatter' is no rule: it should read like chatter:=/talk"),
        ("-r :=talk", 1001, "is no rule"),
        ("-r a//b:=c", 1001, "both sides are names"),
        ("-r a:=1b", 1001, "both sides are names"),
        ("-r /**:=b", 1001, "both sides are names"),
        ("-r a:={node}", 1001, "both sides are names"),
        ("-r rosservice://a:=rostopic://b", 1001, "both sides are names"),
        ("-r __node:=a/b", 1001, "'a/b' cannot be the name of a node"),
        ("-r __ns:=lab", 1001, "'lab' cannot be a namespace, which reads like /lab"),
        ("-p gain", 1010, "'gain' is no parameter: it should read like gain:=2.0"),
        ("-p gain:={", 1010, "is no parameter"),
        ("-p :gain:=1", 1010, "is no parameter"),
        ("--log-level loud", 1020, "'loud' is no level: debug, info"),
        ("--log-level :=info", 1020, "is no level"),
    ],
)
def test_what_is_no_argument(arguments: str, code: int, said: str) -> None:
    with pytest.raises(ArgumentsError) as caught:
        program("--ros-args", *arguments.split())
    assert caught.value.code == code
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_none(tmp_path: Path) -> None:
    file = tmp_path / "lab.yaml"
    for text in ("[1, 2]", "arm: {gain: 1}", "arm: {ros__parameters: {gain: }}", "{"):
        file.write_text(text)
        with pytest.raises(ArgumentsError, match="--params-file"):
            RosArguments.parse(["--ros-args", "--params-file", str(file)])


def test_remap_is_no_text() -> None:
    with pytest.raises(ArgumentsError, match="it must be a dict or a list of rules"):
        program().node("arm", remap="a:=b")
