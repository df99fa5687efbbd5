"""Properties and the files they are written in."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rtc.properties import (
    ConfError,
    Properties,
    is_yes,
    read_conf_file,
    read_conf_untrusted,
    split_address,
    split_list,
    write_conf,
)


def read(text: str) -> dict[str, str]:
    return dict(read_conf_untrusted(text.encode(), "rtc.conf"))


def test_the_forms_of_a_line() -> None:
    text = """
    # a comment
    ! another : comment
    corba.nameservers: localhost, other:2809
    naming.formats = %h.host_cxt/%n.rtc
    logger.log_level DEBUG
    manager.modules.preload: a.py, \\
        b.py, \\
        # no comment here
    logger.enable:NO
    alone
    empty:
    logger.enable: YES
    """
    assert read(text) == {
        "corba.nameservers": "localhost, other:2809",
        "naming.formats": "%h.host_cxt/%n.rtc",
        "logger.log_level": "DEBUG",
        "manager.modules.preload": "a.py, b.py, # no comment here",
        "logger.enable": "YES",
        "alone": "",
        "empty": "",
    }


@pytest.mark.parametrize(
    ("text", "properties"),
    [
        ("a\\:b: c", {"a:b": "c"}),
        ("a: c\\td\\ne\\\\", {"a": "c\td\ne\\"}),
        ("a: b\r\nc: d\r\n", {"a": "b", "c": "d"}),
        ("a: last line goes on \\", {"a": "last line goes on "}),
        ("a: b \\  \n c", {"a": "b c"}),
        ("a = b = c : d", {"a": "b = c : d"}),
        ("a: \\u0041\\u0020", {"a": "A "}),
    ],
)
def test_escapes_and_ends_of_lines(text: str, properties: dict[str, str]) -> None:
    assert read(text) == properties


@pytest.mark.parametrize(
    ("octets", "message"),
    [
        (b"a: b\n: c\n", "rtc.conf:2: no key before ': c'; lines have the form 'key: value'"),
        (b"a: \xff\n", "rtc.conf:1: not UTF-8; save the file in that encoding"),
        (b"\na: \0\n", "rtc.conf:2: a NUL character; this is no file of properties"),
        (b"#" * (4 << 20) + b"##", "rtc.conf: more than 4 MiB; this is no file of properties"),
    ],
)
def test_errors_say_where(octets: bytes, message: str) -> None:
    with pytest.raises(ConfError) as caught:
        read_conf_untrusted(octets, "rtc.conf")
    assert str(caught.value) == message


def test_comments_may_be_of_any_encoding() -> None:
    assert dict(read_conf_untrusted("# 設定\na: b".encode("euc-jp"), "rtc.conf")) == {"a": "b"}


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(ConfError, match=r"none\.conf: cannot be read: No such file or directory"):
        read_conf_file(tmp_path / "none.conf")
    (tmp_path / "some.conf").write_text("a.b: c\n")
    assert read_conf_file(tmp_path / "some.conf") == {"a.b": "c"}


@given(st.binary(max_size=200))
def test_any_octets_are_read_or_refused(octets: bytes) -> None:
    try:
        properties = read_conf_untrusted(octets, "x")
    except ConfError:
        return
    assert all(key for key in properties)


TEXTS = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20)


@given(st.dictionaries(TEXTS.filter(bool), TEXTS, max_size=8))
def test_what_is_written_reads_back(properties: dict[str, str]) -> None:
    assert read(write_conf(properties)) == properties


@given(st.text(alphabet="ab.:=\\# \t\n\r!", max_size=40))
def test_what_is_read_writes_and_reads_back(text: str) -> None:
    try:
        properties = read(text)
    except ConfError:
        return
    assert read(write_conf(properties)) == properties


def test_a_node_is_alive() -> None:
    properties = Properties({"logger.enable": "YES", "logger": "x", "loggers": "y", "a.b.c": "d"})
    logger = properties.node("logger")
    assert dict(logger) == {"enable": "YES", "": "x"}
    logger["log_level"] = "INFO"
    assert properties["logger.log_level"] == "INFO"
    del properties["logger.enable"]
    assert "enable" not in logger
    assert dict(properties.node("a").node("b")) == {"c": "d"}
    assert properties.node("a").node("b.c")[""] == "d"


def test_defaults_are_found_but_not_listed() -> None:
    properties = Properties({"a.b": "1"}, defaults={"a.b": "0", "a.c": "2", "d": "3"})
    assert properties["a.b"] == "1"
    assert properties.node("a")["c"] == "2"
    assert "a.c" not in properties
    assert list(properties) == ["a.b"]
    assert properties.get("e") is None
    with pytest.raises(KeyError):
        properties["e"]
    copy = properties.node("a").copy()
    copy["b"] = "5"
    assert (copy["c"], properties["a.b"]) == ("2", "1")


def test_branches_words_flags_and_numbers() -> None:
    properties = Properties(
        {"conf.a.x": "", "conf.b.y": "", "conf.a.z": "", "yes": " Yes ", "n": "0.5", "bad": "x"}
    )
    assert properties.branches("conf") == ("a", "b")
    assert properties.flag("yes")
    assert not properties.flag("none")
    assert properties.flag("none", True)
    assert properties.number("n", 1.0) == 0.5
    assert properties.number("none", 1.0) == 1.0
    with pytest.raises(ConfError, match=r"^bad: 'x' is not a number; write one such as 1$"):
        properties.number("bad", 1.0)
    assert split_list(" a, b c ,, d") == ("a", "b c", "d")
    assert properties.words("none") == ()
    assert [is_yes(text) for text in ("YES", "no", "1", "")] == [True, False, True, False]


def test_merging_leaves_the_first_alone() -> None:
    properties = Properties({"a": "1", "b": "2"})
    assert properties.merged({"b": "3", "c": "4"}) == {"a": "1", "b": "3", "c": "4"}
    assert properties == {"a": "1", "b": "2"}


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("robot", ("robot", "7")),
        ("robot:2809", ("robot", "2809")),
        ("robot:", ("robot", "")),
        (":2809", ("", "2809")),
        ("[::1]", ("[::1]", "7")),
        ("[::1]:2809", ("[::1]", "2809")),
        ("", ("", "7")),
    ],
)
def test_addresses_have_a_host_and_a_port(text: str, parts: tuple[str, str]) -> None:
    assert split_address(text, "7") == parts
