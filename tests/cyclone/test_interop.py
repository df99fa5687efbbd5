"""The cyclonedds engine among others: ROS 2, Fast DDS, and muros' own engine."""

from collections.abc import Callable

import pytest

from muros.space import Durability, Qos, Reliability, Topic
from tests.dds.bodies import array, basic, basic_value, pattern, shown
from tests.dds.domains import Domain
from tests.dds.matrix import topics_both_ways
from tests.dds.peers import Peer, require
from tests.dds.rig import ARRAY, BASIC_TYPES, STRING, Rig

Fetch = Callable[[str], Peer]
TYPE = "test_msgs/srv/BasicTypes"


@pytest.fixture(autouse=True)
def _cyclone() -> None:
    require("cyclone")


@pytest.mark.parametrize("name", ["jazzy", "kilted", "fastdds", "cyclone"])
def test_topics_over_the_qos_matrix(name: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    other = peer(name)
    node = other.do("node", name="other", domain=domain)
    ours = rig.space(domain, "cyclonedds").participant("ours")
    # One by one: a volatile reader of Cyclone skips to where the first HEARTBEAT is that it sees.
    topics_both_ways(rig, other, node, ours, period=0.005)


def test_large_samples(peer: Fetch, rig: Rig, domain: Domain) -> None:
    other = peer("jazzy")
    node = other.do("node", name="other", domain=domain)
    ours = rig.space(domain, "cyclonedds").participant("ours")
    qos = Qos(durability=Durability.TRANSIENT_LOCAL, depth=5)
    writer, reader = ours.writer(Topic("rt/out", ARRAY), qos), ours.reader(Topic("rt/in", ARRAY), qos)
    said = {"depth": 5, "reliability": "reliable", "durability": "transient_local"}
    kind = {"node": node, "type": "std_msgs/msg/UInt8MultiArray", "qos": said}
    subscription = rig.ask(other, "subscription", topic="/out", **kind)
    publisher = rig.ask(other, "publisher", topic="/in", **kind)
    rig.matched(writer)
    rig.matched(reader)
    assert rig.ask(other, "matched", thing=subscription) == rig.ask(other, "matched", thing=publisher) == 1
    writer.write(array(pattern(2_000_000)))
    rig.ask(other, "publish_bytes", publisher=publisher, size=2_000_000)
    got = rig.ask(other, "take", subscription=subscription)
    assert [message["data"] for message in got] == [shown(pattern(2_000_000))]
    assert rig.collect(reader, 1) == [array(pattern(2_000_000))]


@pytest.mark.parametrize("distro", ["jazzy", "kilted"])
def test_the_graph_both_ways(distro: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer(distro)
    node = ros.do("node", name="ros", namespace="/a", domain=domain)
    publisher = ros.do("publisher", node=node, topic="/chatter", type="std_msgs/msg/String")
    space = rig.space(domain, "cyclonedds")
    ours = space.participant("ours", namespace="/x/y")
    writer = ours.writer(Topic("rt/mine", STRING), Qos(depth=3))
    graph = space.graph
    rig.until(lambda: {n.full_name for n in graph.nodes} == {"/x/y/ours", "/a/ros"})
    rig.until(
        lambda: [e.participant.full_name for e in graph.writers if e.topic == "rt/chatter"] == ["/a/ros"]
    )
    (theirs,) = [endpoint for endpoint in graph.writers if endpoint.topic == "rt/chatter"]
    assert theirs.type_name == STRING
    assert theirs.type_hash.startswith("RIHS01_df668c74")
    assert theirs.participant.vendor == "Fast DDS"
    assert "/x/y/ours" in rig.ask(ros, "nodes", node=node, names=["/x/y/ours"])
    (info,) = rig.ask(ros, "endpoints", node=node, topic="/mine", publishers=1)["publishers"]
    assert info["gid"] == writer.gid.hex()
    assert info["hash"] == theirs.type_hash
    ros.do("destroy", thing=publisher)
    rig.until(lambda: "rt/chatter" not in [endpoint.topic for endpoint in graph.writers])
    ours.close()
    assert rig.ask(ros, "nodes_without", node=node, names=["/x/y/ours"]) == ["/a/ros"]
    ros.do("reset")
    rig.until(lambda: graph.nodes == ())


def test_what_does_not_fit_is_a_finding(peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer("jazzy")
    node = ros.do("node", name="ros", domain=domain)
    rig.space(domain, "cyclonedds").participant("ours").writer(
        Topic("rt/out", STRING), Qos(Reliability.BEST_EFFORT)
    )
    subscription = rig.ask(ros, "subscription", node=node, topic="/out", type="std_msgs/msg/String")
    assert "RELIABILITY" in rig.ask(ros, "problems", thing=subscription)[0]
    rig.until(lambda: [(f.code, f.subject) for f in rig.told] == [("qos-mismatch", "rt/out")])


def test_services_with_cyclone_and_muros_both_ways(peer: Fetch, rig: Rig, domain: Domain) -> None:
    other = peer("cyclone")
    node = other.do("node", name="other", domain=domain)
    ours = rig.space(domain, "cyclonedds").participant("ours")
    answers: list[tuple[int, int]] = []
    server = ours.replier(
        BASIC_TYPES, on_request=lambda i, data: server.reply(i, basic(0, sum(basic_value(data))))
    )
    client = rig.ask(other, "client", node=node, name="/sum", type=TYPE)
    replies = rig.ask(
        other, "call", client=client, request={"int32_value": 5}, number="int64_value", count=20
    )
    assert [reply and reply["int64_value"] for reply in replies] == [5 + n for n in range(20)]

    theirs = (
        rig.space(domain)
        .participant("muros")
        .requester(BASIC_TYPES, on_reply=lambda number, data: answers.append((number, basic_value(data)[1])))
    )
    number = theirs.send(basic(40, 2))
    rig.until(lambda: answers == [(number, 42)], "the engine dds asks the engine cyclonedds")
    server.close()
    rig.ask(other, "destroy", thing=client)

    answers.clear()
    service = rig.ask(
        other, "service", node=node, name="/sum", type=TYPE, rule="{'int64_value': request.int64_value + 1}"
    )
    asker = ours.requester(
        BASIC_TYPES, on_reply=lambda number, data: answers.append((number, basic_value(data)[1]))
    )
    other.begin("serve", service=service, count=1)
    number = asker.send(basic(0, 41))
    rig.until(lambda: answers == [(number, 42)], "the engine cyclonedds asks Cyclone")
    assert rig.answer(other) == 1
    assert rig.spaces[0].findings.counts() == {}


def test_services_of_rmw_fastrtps_are_out_of_reach_and_that_is_said(
    peer: Fetch, rig: Rig, domain: Domain
) -> None:
    ros = peer("jazzy")
    node = ros.do("node", name="ros", domain=domain)
    space = rig.space(domain, "cyclonedds", request_wait=300_000_000)
    ours = space.participant("ours")
    asked: list[bytes] = []
    ours.replier(BASIC_TYPES, on_request=lambda identity, data: asked.append(data))
    client = rig.ask(ros, "client", node=node, name="/sum", type=TYPE)
    assert rig.ask(ros, "matched", thing=client) == 1
    assert rig.ask(ros, "call", client=client, request={}, wait=1) == [None]
    rig.until(lambda: [f.code for f in rig.told] == ["service-dialect"])
    assert asked == []
    assert "rmw_fastrtps" in rig.told[0].why
    assert "dds:" in rig.told[0].remedy

    rig.told.clear()
    rig.ask(ros, "service", node=node, name="/other", type=TYPE)
    requester = ours.requester(
        type(BASIC_TYPES)(
            "/other",
            "rq/otherRequest",
            "rr/otherReply",
            BASIC_TYPES.request_type,
            BASIC_TYPES.reply_type,
        )
    )
    requester.send(basic(1, 2))
    rig.until(lambda: {f.code for f in rig.told} == {"service-dialect", "no-server"})
    assert requester.servers == 0
