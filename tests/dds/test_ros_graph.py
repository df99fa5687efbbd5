"""The graph: what ROS 2 sees of muros and muros of ROS 2, and that everything is withdrawn."""

from collections.abc import Callable

import pytest

from muros.space import Endpoint, Qos, Role, Topic
from tests.dds.domains import Domain
from tests.dds.peers import Peer
from tests.dds.rig import BASIC_TYPES, STRING, Rig

ROS = ("jazzy", "kilted")
Fetch = Callable[[str], Peer]

STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


@pytest.mark.parametrize("distro", ROS)
def test_ros_sees_our_nodes_and_what_they_have(distro: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer(distro)
    node = ros.do("node", name="onlooker", domain=domain)
    space = rig.space(domain)
    talker = space.participant("talker", namespace="/a/b")
    writer = talker.writer(Topic("rt/chatter", STRING), Qos(depth=5))
    other = space.participant("other")
    reader = other.reader(Topic("rt/chatter", STRING), Qos(depth=5))
    other.replier(BASIC_TYPES)
    talker.requester(BASIC_TYPES)
    space.participant("").writer(Topic("rt/nameless", STRING))

    names = rig.ask(ros, "nodes", node=node, names=["/a/b/talker", "/other"])
    assert names == ["/a/b/talker", "/onlooker", "/other"]
    info = rig.ask(ros, "endpoints", node=node, topic="/chatter", publishers=1, subscriptions=1)
    (publisher,), (subscription,) = info["publishers"], info["subscriptions"]
    assert publisher == {
        "node": "/a/b/talker",
        "type": "std_msgs/msg/String",
        "hash": STRING_HASH,
        "gid": writer.gid.hex(),
        "reliability": "RELIABLE",
        "durability": "VOLATILE",
    }
    assert (subscription["node"], subscription["gid"]) == ("/other", reader.gid.hex())
    topics = rig.ask(ros, "topics", node=node, names=["/chatter", "/nameless"])
    assert topics["/chatter"] == ["std_msgs/msg/String"]
    services = rig.ask(ros, "services", node=node, names=["/sum"])
    assert services["/sum"] == ["test_msgs/srv/BasicTypes"]
    of_talker = rig.ask(
        ros, "of_node", node=node, name="talker", namespace="/a/b", names=["/chatter", "/sum"]
    )
    assert of_talker["publishers"] == {"/chatter": ["std_msgs/msg/String"]}
    assert of_talker["clients"] == {"/sum": ["test_msgs/srv/BasicTypes"]}
    of_other = rig.ask(ros, "of_node", node=node, name="other", names=["/chatter", "/sum"])
    assert of_other["subscribers"] == {"/chatter": ["std_msgs/msg/String"]}
    assert of_other["services"] == {"/sum": ["test_msgs/srv/BasicTypes"]}

    writer.close()
    assert rig.ask(ros, "without_publishers", node=node, topic="/chatter") == []
    talker.close()
    assert "/a/b/talker" not in rig.ask(ros, "nodes_without", node=node, names=["/a/b/talker"])
    space.close()
    assert rig.ask(ros, "nodes_without", node=node, names=["/other"]) == ["/onlooker"]
    assert rig.ask(ros, "without_publishers", node=node, topic="/nameless") == []


@pytest.mark.parametrize("distro", ROS)
def test_we_see_the_nodes_of_ros_and_what_they_have(
    distro: str, peer: Fetch, rig: Rig, domain: Domain
) -> None:
    ros = peer(distro)
    node = ros.do("node", name="talker", namespace="/a/b", domain=domain)
    publisher = ros.do("publisher", node=node, topic="chatter", type="std_msgs/msg/String")
    ros.do("service", node=node, name="/sum", type="test_msgs/srv/BasicTypes")
    space = rig.space(domain)
    space.participant("onlooker")
    graph = space.graph

    def writer_of_chatter() -> Endpoint | None:
        found = [e for e in graph.writers if e.topic == "rt/a/b/chatter"]
        return found[0] if found else None

    rig.until(lambda: "/a/b/talker" in [node.full_name for node in graph.nodes])
    rig.until(lambda: writer_of_chatter() is not None)
    rig.until(lambda: (e := writer_of_chatter()) is not None and e.participant.name == "talker")
    endpoint = writer_of_chatter()
    assert endpoint is not None
    assert endpoint.role is Role.WRITER
    assert endpoint.type_name == STRING
    assert endpoint.type_hash == STRING_HASH
    assert endpoint.participant.full_name == "/a/b/talker"
    assert (endpoint.participant.domain, endpoint.participant.enclave) == (domain, "/")
    (told,) = rig.ask(ros, "endpoints", node=node, topic="/a/b/chatter", publishers=1)["publishers"]
    assert endpoint.gid.hex() == told["gid"]
    rig.until(lambda: (info := graph.service("/sum", domain)) is not None and len(info.servers) == 1)
    assert [n.full_name for n in graph.nodes if n.full_name != "/onlooker"] == ["/a/b/talker"]

    ros.do("destroy", thing=publisher)
    rig.until(lambda: writer_of_chatter() is None, "the publisher to go")
    ros.do("reset")
    rig.until(lambda: [node.full_name for node in graph.nodes] == ["/onlooker"], "the node to go")
    rig.until(lambda: graph.writers == (), "all that it wrote to go")
    rig.until(lambda: len(graph.participants) == 1, "its participant to go")


@pytest.mark.parametrize("distro", ROS)
def test_several_nodes_of_one_process(distro: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer(distro)
    ros.do("node", name="one", domain=domain)
    ros.do("node", name="two", namespace="/x", domain=domain)
    space = rig.space(domain)
    space.participant("onlooker")
    rig.until(lambda: {n.full_name for n in space.graph.nodes} == {"/onlooker", "/one", "/x/two"})


def test_fifty_participants_are_seen_at_once(peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer("jazzy")
    node = ros.do("node", name="onlooker", domain=domain)
    space = rig.space(domain)
    boards = [space.participant(f"board{n}") for n in range(50)]
    writers = [board.writer(Topic("rt/state", STRING), Qos(depth=1)) for board in boards]
    names = [f"/board{n}" for n in range(50)]
    assert set(names) <= set(rig.ask(ros, "nodes", node=node, names=names))
    info = rig.ask(ros, "endpoints", node=node, topic="/state", publishers=50)
    assert {publisher["gid"] for publisher in info["publishers"]} == {writer.gid.hex() for writer in writers}
    assert {publisher["node"] for publisher in info["publishers"]} == set(names)
    for board in boards:
        board.close()
    assert rig.ask(ros, "nodes_without", node=node, names=names) == ["/onlooker"]


def test_a_vendor_that_is_no_ros_node_is_shown_too(peer: Fetch, rig: Rig, domain: Domain) -> None:
    fastdds = peer("fastdds")
    node = fastdds.do("node", name="bare", domain=domain)
    fastdds.do("publisher", node=node, topic="/bare", type="std_msgs/msg/String")
    space = rig.space(domain)
    space.participant("onlooker")
    rig.until(lambda: "rt/bare" in [endpoint.topic for endpoint in space.graph.writers])
    (endpoint,) = [e for e in space.graph.writers if e.topic == "rt/bare"]
    assert endpoint.participant.gid[:12] == endpoint.gid[:12]
    assert "eprosima" in endpoint.participant.vendor.lower() or "fast" in endpoint.participant.vendor.lower()


@pytest.mark.parametrize("gid_size", [16, 24])
def test_the_graph_messages_of_new_and_old_ros(gid_size: int, peer: Fetch, rig: Rig, domain: Domain) -> None:
    """Humble and older carry gids of 24 bytes under the same type name; what is seen decides what is said."""
    old = peer("cyclone")
    node = old.do("node", name="old", namespace="/ns", domain=domain, gid_size=gid_size)
    old.do("publisher", node=node, topic="/chatter", type="std_msgs/msg/String")
    space = rig.space(domain)
    ours = space.participant("ours", namespace="/x")
    writer = ours.writer(Topic("rt/mine", STRING))
    rig.until(lambda: "/ns/old" in [node.full_name for node in space.graph.nodes])
    rig.until(lambda: "rt/chatter" in [endpoint.topic for endpoint in space.graph.writers])
    (endpoint,) = [e for e in space.graph.writers if e.topic == "rt/chatter"]
    rig.until(
        lambda: (
            [e.participant.full_name for e in space.graph.writers if e.topic == "rt/chatter"] == ["/ns/old"]
        )
    )
    assert endpoint.type_name == STRING
    told = b""
    for _ in range(40):  # it is told when the sizes of others are known
        told = bytes.fromhex(rig.ask(old, "told", node=node)[-1])
        if told.endswith(writer.gid.ljust(gid_size, b"\0")):
            break
        rig.run(0.1)
    assert told[4:20] == ours.gid
    assert told[4 + gid_size : 8 + gid_size] == b"\1\0\0\0", "one node follows the gid"
    assert told.endswith(writer.gid.ljust(gid_size, b"\0"))
