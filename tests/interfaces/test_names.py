"""Names of topics, services and types: the mapping that other ROS 2 middleware uses, and its inverse."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.interfaces import (
    InterfaceError,
    check_full_name,
    check_namespace,
    check_node_name,
    dds_reply_topic,
    dds_request_topic,
    dds_topic,
    dds_type_name,
    expand_name,
    ros_service,
    ros_topic,
    ros_type_name,
    split_type,
)

VECTORS: dict[str, Any] = json.loads((Path(__file__).parents[1] / "vectors/rmw/names.json").read_text())

TOKENS = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,8}", fullmatch=True)
FULL_NAMES = st.lists(TOKENS, min_size=1, max_size=4).map(lambda tokens: "/" + "/".join(tokens))


def test_recorded_topics_and_services() -> None:
    for topic in VECTORS["topics"]:
        if "(raw)" in topic["ros"]:
            assert ros_topic(topic["dds"]) is None
        else:
            assert dds_topic(topic["ros"]) == topic["dds"]
            assert ros_topic(topic["dds"]) == topic["ros"]
    for service in VECTORS["services"]:
        assert dds_request_topic(service["ros"]) == service["request"]
        assert dds_reply_topic(service["ros"]) == service["reply"]
        assert ros_service(service["request"]) == ros_service(service["reply"]) == service["ros"]


def test_recorded_types() -> None:
    suffixes = {
        "request": "_Request",
        "reply": "_Response",
        "send_goal_request": "_SendGoal_Request",
        "send_goal_reply": "_SendGoal_Response",
        "get_result_request": "_GetResult_Request",
        "get_result_reply": "_GetResult_Response",
        "feedback": "_FeedbackMessage",
        "dds": "",
    }
    for row in VECTORS["types"]:
        for key, suffix in suffixes.items():
            if key in row:
                assert dds_type_name(row["ros"] + suffix) == row[key]
                assert ros_type_name(row[key]) == row["ros"] + suffix


def test_recorded_expansions() -> None:
    for row in VECTORS["rcl_expansion"]:
        assert expand_name(row["input"], row["node"], row["ns"]) == row["out"]
    for row in VECTORS["rclc_node_namespace"]:
        assert check_namespace(row["given"]) == row["used"]


@given(FULL_NAMES)
def test_names_go_there_and_back(name: str) -> None:
    assert ros_topic(dds_topic(name)) == name
    assert ros_service(dds_request_topic(name)) == ros_service(dds_reply_topic(name)) == name
    assert check_full_name(name) == check_namespace(name) == name
    assert expand_name(name, "node", "/ns") == name
    assert expand_name(name[1:], "node", "/ns") == "/ns" + name


@given(st.text(max_size=12))
def test_any_text_is_a_name_or_an_error(text: str) -> None:
    for check in (
        check_full_name,
        check_namespace,
        check_node_name,
        dds_type_name,
        ros_type_name,
        split_type,
    ):
        with suppress(InterfaceError):
            assert check(text)
    ros_topic(text)
    ros_service(text)


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("chatter", "must begin with '/'"),
        ("/", "it is empty"),
        ("/a//b", "it has '//' in it"),
        ("/a/", "it ends with '/'"),
        ("/9a", "'9a' begins with a digit"),
        ("/a b", "' ' is not allowed"),
        ("/ä", "'ä' is not allowed"),
        ("/a-b", "'-' is not allowed"),
    ],
)
def test_bad_names_are_explained(name: str, problem: str) -> None:
    with pytest.raises(InterfaceError, match=r"topic name .*: ") as caught:
        dds_topic(name)
    assert problem in str(caught.value)


def test_bad_expansions_and_types_are_explained() -> None:
    with pytest.raises(InterfaceError, match=r"unknown substitution \{x\}"):
        expand_name("{x}/y", "n")
    with pytest.raises(InterfaceError, match="node name 'a/b'"):
        check_node_name("a/b")
    with pytest.raises(InterfaceError, match="write package/msg/Type"):
        dds_type_name("Int32")
    with pytest.raises(InterfaceError, match="is no ROS type"):
        ros_type_name("HelloWorld")
    assert split_type("std_srvs/SetBool", "srv") == ("std_srvs", "srv", "SetBool")
    assert ros_service("rt/x") is None
    assert ros_service("rq/Request") is None
    assert ros_topic("rt/") is None
