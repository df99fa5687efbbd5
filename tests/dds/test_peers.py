"""The peers themselves: that they run, meet each other on this machine and do what the other tests ask of them.

When these fail, the machine or the set-up is at fault and not muros.
"""

from collections.abc import Iterator

import pytest

from tests.dds.domains import Domain, free_domain
from tests.dds.peers import Peer, PeerError, start

FIBONACCI = "test_msgs/action/Fibonacci"


@pytest.fixture
def domain() -> Iterator[Domain]:
    with free_domain() as number:
        yield number


@pytest.fixture
def jazzy() -> Iterator[Peer]:
    with start("jazzy") as peer:
        yield peer


@pytest.fixture
def kilted() -> Iterator[Peer]:
    with start("kilted") as peer:
        yield peer


def test_domains_are_handed_out_once() -> None:
    with free_domain() as one, free_domain() as other:
        assert one != other
        assert {one, other} <= set(range(1, 101))


def test_topics_services_actions_and_the_graph_between_two_distributions(
    jazzy: Peer, kilted: Peer, domain: Domain
) -> None:
    here = jazzy.do("node", name="here", namespace="/a/b", domain=domain, parameters={"speed": 3})
    there = kilted.do("node", name="there", domain=domain)

    publisher = jazzy.do("publisher", node=here, topic="/chatter", type="std_msgs/msg/String")
    subscription = kilted.do("subscription", node=there, topic="/chatter", type="std_msgs/msg/String")
    assert jazzy.do("matched", thing=publisher) == 1
    assert kilted.do("matched", thing=subscription) == 1
    jazzy.do("publish", publisher=publisher, message={"data": "hello "}, count=3, number="data")
    got = kilted.do("take", subscription=subscription, count=3)
    assert got == [{"data": "hello 0"}, {"data": "hello 1"}, {"data": "hello 2"}]

    jazzy.do(
        "service",
        node=here,
        name="/sum",
        type="test_msgs/srv/BasicTypes",
        rule="{'int64_value': request.int64_value + request.int32_value}",
    )
    client = kilted.do("client", node=there, name="/sum", type="test_msgs/srv/BasicTypes")
    answers = kilted.do("call", client=client, request={"int32_value": 5}, number="int64_value", count=3)
    assert [answer["int64_value"] for answer in answers] == [5, 6, 7]

    jazzy.do("action_server", node=here, name="/count", type=FIBONACCI)
    action = kilted.do("action_client", node=there, name="/count", type=FIBONACCI)
    outcome = kilted.do("goal", client=action, goal={"order": 4})
    assert outcome["status"] == 4
    assert outcome["result"] == {"sequence": [0, 1, 1, 2, 3, 5]}
    outcome = kilted.do("goal", client=action, goal={"order": 200}, cancel_after=2)
    assert (outcome["cancelled"], outcome["status"]) == (1, 5)

    assert kilted.do("nodes", node=there, names=["/a/b/here"]) == ["/a/b/here", "/there"]
    info = kilted.do("endpoints", node=there, topic="/chatter", publishers=1, subscriptions=1)
    assert info["publishers"][0]["node"] == "/a/b/here"
    assert info["publishers"][0]["hash"].startswith("RIHS01_")


def test_localhost_range_and_shared_memory(domain: Domain) -> None:
    with (
        start("jazzy", discovery="localhost", shared_memory=True) as one,
        start("kilted", discovery="localhost") as two,
    ):
        node = one.do("node", name="one", domain=domain)
        two.do("node", name="two", domain=domain)
        assert one.do("nodes", node=node, names=["/two"]) == ["/one", "/two"]


def test_a_failing_command_and_a_dead_peer_are_told(jazzy: Peer, domain: Domain) -> None:
    with pytest.raises(PeerError, match="KeyError"):
        jazzy.do("publisher", node=99, topic="/x", type="std_msgs/msg/String")
    jazzy.kill()
    with pytest.raises(PeerError, match="ended"):
        jazzy.do("node", name="late", domain=domain)


@pytest.mark.parametrize("other", ["cyclone", "fastdds"])
def test_other_vendors_exchange_messages_with_ros(other: str, jazzy: Peer, domain: Domain) -> None:
    with start(other) as vendor:
        node = jazzy.do("node", name="ros", domain=domain)
        theirs = vendor.do("node", name="vendor", domain=domain)
        text = {"topic": "/chatter", "type": "std_msgs/msg/String"}
        publisher = vendor.do("publisher", node=theirs, **text)
        subscription = jazzy.do("subscription", node=node, **text)
        assert jazzy.do("matched", thing=subscription) == vendor.do("matched", thing=publisher) == 1
        vendor.do("publish", publisher=publisher, message={"data": "n"}, count=2, number="data")
        assert jazzy.do("take", subscription=subscription, count=2) == [{"data": "n0"}, {"data": "n1"}]

        array = {"topic": "/bytes", "type": "std_msgs/msg/UInt8MultiArray"}
        publisher = jazzy.do("publisher", node=node, **array)
        subscription = vendor.do("subscription", node=theirs, **array)
        assert jazzy.do("matched", thing=publisher) == vendor.do("matched", thing=subscription) == 1
        jazzy.do("publish_bytes", publisher=publisher, size=300_000)
        got = vendor.do("take", subscription=subscription)
        assert got == [{"data": {"size": 300_000, "sum": 824308248}}]


def test_services_among_processes_of_cyclone(domain: Domain) -> None:
    with start("cyclone") as server, start("cyclone") as client:
        name = {"name": "/sum", "type": "test_msgs/srv/BasicTypes"}
        rule = "{'int64_value': request.int64_value + request.int32_value}"
        service = server.do(
            "service", node=server.do("node", name="server", domain=domain), rule=rule, **name
        )
        caller = client.do("client", node=client.do("node", name="client", domain=domain), **name)
        server.begin("serve", service=service, count=3)
        answers = client.do("call", client=caller, request={"int32_value": 5}, number="int64_value", count=3)
        assert [answer["int64_value"] for answer in answers] == [5, 6, 7]
        assert server.result() == 3
