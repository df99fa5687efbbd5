"""The parser of definition files: everything ROS 2 allows, one clear error for everything else."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from muros import interfaces
from muros.interfaces import (
    Action,
    Constant,
    Field,
    FieldType,
    InterfaceError,
    Kind,
    Message,
    Registry,
    Service,
    parse,
)

NAME = "my_msgs/msg/Probe"
ORIGIN = "my_msgs/msg/Probe.msg"


def fields(text: str) -> tuple[Field, ...]:
    found = parse(text, NAME, ORIGIN)
    assert isinstance(found, Message)
    return found.fields


def constants(text: str) -> tuple[Constant, ...]:
    found = parse(text, NAME)
    assert isinstance(found, Message)
    return found.constants


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("int32 x", FieldType("int32")),
        ("\tint32   x\r", FieldType("int32")),
        ("string<=10 x", FieldType("string", string_bound=10)),
        ("string <= 10 x", FieldType("string", string_bound=10)),
        ("wstring x", FieldType("wstring")),
        ("bool[] x", FieldType("bool", kind=Kind.SEQUENCE)),
        ("byte[5] x", FieldType("byte", kind=Kind.ARRAY, count=5)),
        ("char[<=5] x", FieldType("char", kind=Kind.BOUNDED, count=5)),
        ("string<=3[<=2] x", FieldType("string", False, Kind.BOUNDED, 2, 3)),
        ("Other x", FieldType("my_msgs/msg/Other", True)),
        ("geometry_msgs/Point[] x", FieldType("geometry_msgs/msg/Point", True, Kind.SEQUENCE)),
        ("geometry_msgs/msg/Point x", FieldType("geometry_msgs/msg/Point", True)),
        ("Header x", FieldType("std_msgs/msg/Header", True)),
        ("time x", FieldType("builtin_interfaces/msg/Time", True)),
        ("duration[2] x", FieldType("builtin_interfaces/msg/Duration", True, Kind.ARRAY, 2)),
    ],
)
def test_field_types(text: str, expected: FieldType) -> None:
    (field,) = fields(text)
    assert (field.name, field.type, field.default) == ("x", expected, None)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("int8 x -5", -5),
        ("uint8 x 0xff", 255),
        ("uint64 x 18446744073709551615", 2**64 - 1),
        ("bool x true", True),
        ("bool x False", False),
        ("bool x 1", True),
        ("float32 x .5", 0.5),
        ("float64 x -1e-3 # small", -1e-3),
        ('string x "a # b" # c', "a # b"),
        ("string x 'it''s'", None),
        ('string x "it\'s"', "it's"),
        (r'string x "a \"b\" \\ c"', 'a "b" \\ c'),
        ("string x bare words", "bare words"),
        ('wstring x "ä€"', "ä€"),
        ("int32[] x [1, 2,3]", [1, 2, 3]),
        ("int32[] x []", []),
        ("bool[2] x [true, 0]", [True, False]),
        ("string[<=3] x [\"a, b\", 'c]']", ["a, b", "c]"]),
    ],
)
def test_defaults(text: str, expected: Any) -> None:
    if expected is None:
        with pytest.raises(InterfaceError, match="inside the string"):
            fields(text)
        return
    (field,) = fields(text)
    assert field.default == expected
    assert type(field.default) is type(expected)


@pytest.mark.parametrize(
    ("text", "name", "value", "written"),
    [
        ("int32 X=5", "X", 5, "5"),
        ("int32 X = -0x10  # sixteen", "X", -16, "-0x10"),
        ("float64 PI=3.14159", "PI", 3.14159, "3.14159"),
        ("bool YES=True", "YES", True, "True"),
        ('string S="quoted # text"', "S", "quoted # text", '"quoted # text"'),
        ("string S=bare # all of it", "S", "bare # all of it", "bare # all of it"),
        ("string S=", "S", "", ""),
        ("byte B=255", "B", 255, "255"),
    ],
)
def test_constants(text: str, name: str, value: Any, written: str) -> None:
    assert constants(text) == (Constant(name, text.split()[0], value, written),)


def test_comments_blank_lines_and_nothing_at_all() -> None:
    assert fields("") == fields("# only\n\n   # comments\n") == ()
    found = fields("\ufeffint8 a # one\n\n# two\nint8 b#three\n")
    assert [(f.name, f.line) for f in found] == [("a", 1), ("b", 4)]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("\n\n\n\n\n\nflaot32 x", "my_msgs/msg/Probe.msg:7: unknown type 'flaot32' (did you mean float32?)"),
        ("zzz x", "my_msgs/msg/Probe.msg:1: unknown type 'zzz'"),
        ("int32", "cannot read 'int32': write 'type name'"),
        ("int32 x y z", "'y z' is no int32"),
        ("int32 9x", "bad name '9x'"),
        ("int32 x__y", "bad name 'x__y'"),
        ("int32 x_", "bad name 'x_'"),
        ("int32 x\nint8 x", "Probe.msg:2: 'x' is defined twice"),
        ("int8 x 128", "128 does not fit int8 (-128 to 127)"),
        ("uint8 X=-1", "-1 does not fit uint8"),
        ("int8 x 1.5", "'1.5' is no int8"),
        ("float32 x one", "'one' is no float32"),
        ("bool x maybe", "'maybe' is no bool"),
        ("int32 X=", "constant 'X' has no value"),
        ("int32[] X=5", "constants are of primitive types"),
        ("Point X=5", "constants are of primitive types"),
        ("Point x 5", "has no default"),
        ("int32<=5 x", "write int32[<=5]"),
        ("string<=0 x", "bad bound '0'"),
        ("string<=x x", "bad bound 'x'"),
        ("int32[-1] x", "cannot read '[-1]'"),
        ("int32[<=] x", "cannot read '[<=]'"),
        ("int32[0] x", "bad size '0'"),
        ("int32[99999999999] x", "bad size"),
        ("float64[999999999] x", "an array of 999999999 elements"),
        ("int32[2] x [1]", "has 1 values, 2 needed"),
        ("int32[<=1] x [1, 2]", "has 2 values, at most 1"),
        ("int32[] x 5", "write [value, value]"),
        ("string[] x ['a]", "never closed"),
        ('string<=2 x "abc"', "longer than the 2 characters"),
        ('string x "abc', "is not closed"),
        ("---", "one '---' too many"),
        ("int32 ü", "cannot read"),
    ],
)
def test_bad_lines_are_named(text: str, problem: str) -> None:
    with pytest.raises(InterfaceError) as caught:
        parse(text, NAME, ORIGIN)
    assert problem in str(caught.value)
    assert str(caught.value).startswith(ORIGIN + ":")
    assert "\n" not in str(caught.value)


def test_services_and_actions() -> None:
    service = parse("int8 a\n---\nint8 b\n", "my_msgs/srv/Ask")
    assert isinstance(service, Service)
    assert [m.name for m in service.messages()] == [
        f"my_msgs/srv/Ask_{p}" for p in ("Request", "Response", "Event")
    ]
    action = parse("---\nint8 b\n---\n", "my_msgs/action/Go")
    assert isinstance(action, Action)
    assert action.result.fields[0].line == 2
    assert action.send_goal.request.fields[1].type.base == "my_msgs/action/Go_Goal"
    for text, name in (
        ("int8 a", "my_msgs/srv/Ask"),
        ("---", "my_msgs/action/Go"),
        ("---\n---", "my_msgs/srv/Ask"),
    ):
        with pytest.raises(InterfaceError, match="---"):
            parse(text, name)


@settings(max_examples=400)
@given(
    text=st.text(max_size=60)
    | st.lists(
        st.sampled_from("int32 string Point x [ ] <= = 5 'a' \" # \\ --- , <=3 [2] true é \n".split(" ")),
        max_size=12,
    ).map(" ".join),
    kind=st.sampled_from(["msg/A", "srv/A", "action/A"]),
)
def test_any_text_gives_a_definition_or_one_exception(text: str, kind: str) -> None:
    with suppress(InterfaceError):
        found = parse(text, f"some_msgs/{kind}", "some file")
        assert all(message.name.startswith("some_msgs/") for message in found.messages())


@settings(max_examples=60)
@given(st.sampled_from(interfaces.names()))
def test_the_text_of_a_standard_definition_reads_as_itself(name: str) -> None:
    found = interfaces.definition(name)
    again = parse(interfaces.definition_text(name), name)
    assert [m.fields for m in map(_without_lines, again.messages())] == [
        m.fields for m in map(_without_lines, found.messages())
    ]
    assert [c.value for m in again.messages() for c in m.constants] == [
        c.value for m in found.messages() for c in m.constants
    ]


def _without_lines(message: Message) -> Message:
    return Message(message.name, tuple(Field(f.name, f.type, f.default) for f in message.fields))


# ---- folders ----


def write(folder: Path, files: dict[str, str]) -> Path:
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    return folder


def test_folders_of_packages_a_package_itself_and_its_manifest(tmp_path: Path) -> None:
    write(
        tmp_path,
        {
            "ws/src/one_msgs/msg/A.msg": "two_msgs/B b\n",
            "ws/src/deep/two/msg/B.msg": "int8 b\n",
            "ws/src/deep/two/package.xml": "<package><name> two_msgs </name></package>",
            "ws/src/deep/two/srv/C.srv": "---\n",
            "ws/.git/three_msgs/msg/D.msg": "",
        },
    )
    registry = Registry()
    assert registry.add_path(tmp_path / "ws") == ("one_msgs", "two_msgs")
    assert registry.message("one_msgs/msg/A").fields[0].type.base == "two_msgs/msg/B"
    assert registry.known("two_msgs/srv/C")
    assert not registry.known("three_msgs/msg/D")
    assert Registry().add_path(tmp_path / "ws/src/one_msgs") == ("one_msgs",)


def test_a_folder_without_definitions_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InterfaceError, match="no such folder"):
        Registry().add_path(tmp_path / "nothing")
    with pytest.raises(InterfaceError, match="no definitions found"):
        Registry().add_path(tmp_path)
    write(tmp_path, {"a_msgs/msg/lower.msg": ""})
    with pytest.raises(InterfaceError, match=r"lower\.msg: a type is called like MyType"):
        Registry().add_path(tmp_path)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            "int8 a\ngeometry_msgs/Vector4 b",
            ":2: unknown type 'geometry_msgs/Vector4' (did you mean geometry_msgs/Vec",
        ),
        ("Vector3 b", ":1: unknown type 'my_msgs/Vector3' (did you mean geometry_msgs/Vector3?)"),
        ("Nothing[] b", ":1: unknown type 'my_msgs/Nothing'"),
        (
            "gone_msgs/X b",
            "no package 'gone_msgs'; add its folder with add_path(), $MUROS_INTERFACES or --path",
        ),
        ("Probe b", ":1: my_msgs/Probe contains itself"),
        ("Other b", "Other.msg:1: my_msgs/Probe contains itself"),
        ("my_msgs/srv/Ask b", "is a service, not a message"),
    ],
)
def test_types_that_are_not_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, problem: str
) -> None:
    monkeypatch.chdir(tmp_path)
    write(
        tmp_path,
        {"my_msgs/msg/Probe.msg": text, "my_msgs/msg/Other.msg": "Probe p", "my_msgs/srv/Ask.srv": "---"},
    )
    registry = Registry()
    registry.add_path("my_msgs")
    with pytest.raises(InterfaceError) as caught:
        registry.definition(NAME)
    assert problem in str(caught.value)
    assert str(caught.value).startswith("my_msgs/msg/")


def test_a_bad_file_is_named(tmp_path: Path) -> None:
    (write(tmp_path, {"my_msgs/msg/Probe.msg": ""}) / "my_msgs/msg/Probe.msg").write_bytes(b"int8 a\xff")
    registry = Registry()
    registry.add_path(tmp_path)
    assert registry.known(NAME)
    with pytest.raises(InterfaceError, match=r"Probe\.msg: not UTF-8 text \(byte 6\)"):
        registry.definition(NAME)
    (tmp_path / "my_msgs/msg/Probe.msg").write_text("#" * (1 << 21))
    with pytest.raises(InterfaceError, match=r"Probe\.msg: 1048577 characters"):
        registry.definition(NAME)


def test_definitions_of_the_user_go_first(tmp_path: Path) -> None:
    write(tmp_path, {"std_msgs/msg/Int32.msg": "int64 data\n"})
    registry = Registry()
    assert registry.message("std_msgs/msg/Int32").fields[0].type.base == "int32"
    registry.add_path(tmp_path)
    assert registry.message("std_msgs/msg/Int32").fields[0].type.base == "int64"


def test_unknown_names_get_a_suggestion() -> None:
    with pytest.raises(
        InterfaceError, match=r"unknown type 'std_msgs/msg/Strin' \(did you mean std_msgs/msg/String\?"
    ):
        interfaces.message("std_msgs/Strin")
    with pytest.raises(InterfaceError, match="AddTwoInts is a service, not a message"):
        interfaces.message("example_interfaces/srv/AddTwoInts")
    with pytest.raises(InterfaceError, match="is no service"):
        interfaces.service("std_msgs/msg/Int32")
    with pytest.raises(InterfaceError, match=r"unknown distribution 'jasper': known are dashing, .*lyrical"):
        interfaces.message("std_msgs/Int32", "jasper")
    assert not interfaces.known("nonsense")


def test_what_a_name_is_does_not_depend_on_what_was_used_before() -> None:
    interfaces.message("std_msgs/msg/Int32")
    interfaces.service("std_srvs/srv/Empty")
    interfaces.action("example_interfaces/action/Fibonacci")
    for wrong in ("std_msgs/msg/Int32", "example_interfaces/action/Fibonacci"):
        with pytest.raises(InterfaceError, match="is no service"):
            interfaces.service(wrong)
    with pytest.raises(InterfaceError, match="is a service, not a message"):
        interfaces.message("std_srvs/srv/Empty")
    with pytest.raises(InterfaceError, match="is an action, not a message"):
        interfaces.message("example_interfaces/action/Fibonacci")
    with pytest.raises(InterfaceError, match="is no action"):
        interfaces.action("std_msgs/msg/Int32")


def test_the_distribution_is_chosen(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Registry().distro == "lyrical"
    monkeypatch.setenv("MUROS_DISTRO", "humble")
    assert Registry().distro == "humble"
    assert Registry("jazzy").distro == "jazzy"
    assert not Registry("humble").known("nav_msgs/msg/Trajectory")
