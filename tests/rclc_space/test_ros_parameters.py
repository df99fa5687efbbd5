"""Parameters and a node of ROS 2: rclpy asks ours, and we ask rclpy's, with the same answers."""

import threading
from itertools import product
from typing import Any

import pytest

from muros.rclc import (
    Context,
    Executor,
    ParameterClient,
    ParameterNotDeclaredError,
    ParameterRejectedError,
)
from tests.dds.peers import Peer
from tests.rclc_space.ways import PATIENCE

SERVICES = {
    "get_parameters": "GetParameters",
    "get_parameter_types": "GetParameterTypes",
    "set_parameters": "SetParameters",
    "set_parameters_atomically": "SetParametersAtomically",
    "list_parameters": "ListParameters",
    "describe_parameters": "DescribeParameters",
}
DOUBLE, INTEGER, STRING = 3, 2, 4


def test_rclpy_asks_ours(context: Context, ros: Peer, dds_url: str) -> None:
    parameters = context.node("arm", "lab").parameters()
    parameters.declare("gain", 1.0, range=(0.0, 10.0, 0.5), description="loop gain")
    parameters.declare("motor.current", 3, read_only=True)
    parameters.declare("names", ["a", "b"])
    thread = threading.Thread(target=Executor(context).spin, daemon=True)
    thread.start()
    node = ros.do("node", name="asker", domain=int(dds_url.partition(":")[2]))
    clients = {
        suffix: ros.do("client", node=node, name=f"/lab/arm/{suffix}", type=f"rcl_interfaces/srv/{kind}")
        for suffix, kind in SERVICES.items()
    }
    heard = ros.do(
        "subscription",
        node=node,
        topic="/parameter_events",
        type="rcl_interfaces/msg/ParameterEvent",
        qos=1000,
    )

    def ask(suffix: str, **request: Any) -> Any:
        (answer,) = ros.do("call", client=clients[suffix], request=request)
        assert answer is not None
        return answer

    def value(kind: int, **fields: Any) -> dict[str, Any]:
        return {"type": kind, **fields}

    assert ask("list_parameters")["result"] == {
        "names": ["gain", "motor.current", "names"],
        "prefixes": ["motor"],
    }
    found = ask("get_parameters", names=["gain", "names"])["values"]
    assert (found[0]["double_value"], found[1]["string_array_value"]) == (1.0, ["a", "b"])
    assert ask("get_parameters", names=["gain", "nobody"])["values"] == []
    assert ask("get_parameter_types", names=["gain", "motor.current"])["types"] == [DOUBLE, INTEGER]
    (about,) = ask("describe_parameters", names=["gain"])["descriptors"]
    assert about["floating_point_range"] == [{"from_value": 0.0, "to_value": 10.0, "step": 0.5}]
    assert (about["type"], about["description"], about["read_only"]) == (DOUBLE, "loop gain", False)
    assert ros.do("matched", thing=heard, count=2) == 2, "that of rclpy's own node too"
    asked = [
        {"name": "gain", "value": value(DOUBLE, double_value=2.5)},
        {"name": "gain", "value": value(DOUBLE, double_value=2.6)},
        {"name": "gain", "value": value(STRING, string_value="much")},
        {"name": "motor.current", "value": value(INTEGER, integer_value=4)},
        {"name": "nobody", "value": value(INTEGER, integer_value=4)},
    ]
    results = ask("set_parameters", parameters=asked)["results"]
    assert [result["successful"] for result in results] == [True, False, False, False, False]
    assert [result["reason"] for result in results][2:] == [
        "Type mismatch",
        "Read only parameter",
        "Parameter not found",
    ]
    (event,) = ros.do("take", subscription=heard)
    assert (event["node"], event["stamp"]["sec"] > 0) == ("/lab/arm", True)
    assert [(p["name"], p["value"]["double_value"]) for p in event["changed_parameters"]] == [("gain", 2.5)]
    asked = [asked[0] | {"value": value(DOUBLE, double_value=9.0)}, asked[3]]
    assert not ask("set_parameters_atomically", parameters=asked)["result"]["successful"]
    assert parameters.get("gain") == 2.5
    assert ask("set_parameters_atomically", parameters=asked[:1])["result"]["successful"]
    assert parameters.get("gain") == 9.0
    context.close()
    thread.join(PATIENCE)


def test_we_ask_rclpy(context: Context, ros: Peer, dds_url: str) -> None:
    given = {"gain": 1.5, "a": 1, "a.b": 2, "a.b.c": True, "ab": "text", "list": [1, 2], "words": ["x", "y"]}
    ros.do("node", name="theirs", namespace="/lab", domain=int(dds_url.partition(":")[2]), parameters=given)
    remote = ParameterClient(context.node("asker", "lab"), "theirs", PATIENCE)
    assert remote.wait(PATIENCE)
    assert remote.get(list(given)) == given
    assert list(remote.types(list(given)).values()) == [3, 2, 2, 1, 4, 7, 9]
    assert remote.describe("gain").type == DOUBLE
    with pytest.raises(ParameterNotDeclaredError, match="/lab/theirs has no parameter 'nobody'"):
        remote.get("nobody")

    ours = context.node("ours").parameters()
    for name in remote.list():
        ours.declare(name, 0)
    for prefixes, depth in product([[], ["a"], ["a.b"], ["a", "a.b"], ["nobody"], ["a.b", "gain"]], range(4)):
        assert sorted(remote.list(prefixes, depth)) == ours.list(prefixes, depth), (prefixes, depth)

    remote.set("gain", 2.5)
    remote.update({"a": 5, "a.b": 6})
    assert remote.get(["gain", "a", "a.b"]) == {"gain": 2.5, "a": 5, "a.b": 6}
    with pytest.raises(ParameterRejectedError, match="/lab/theirs refuses nobody"):
        remote.set("nobody", 1)
    text = remote.dump()
    assert "/lab/theirs:\n  ros__parameters:\n    a: 5\n    a.b: 6\n" in text
