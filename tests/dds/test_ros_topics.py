"""Topics between muros and ROS 2, both ways: quality of service, large samples, loss, ranges, restarts."""

from collections.abc import Callable

import pytest

from muros.space import Durability, History, Qos, Reliability, Space, Topic
from tests.dds.bodies import array, pattern, shown, string, text_of
from tests.dds.domains import Domain
from tests.dds.peers import PROGRAMS, Peer, start
from tests.dds.rig import ARRAY, STRING, Losses, Rig, take_all

ROS = ("jazzy", "kilted")
Fetch = Callable[[str], Peer]

MATRIX = [
    (reliability, durability)
    for reliability in (Reliability.RELIABLE, Reliability.BEST_EFFORT)
    for durability in (Durability.VOLATILE, Durability.TRANSIENT_LOCAL)
]
TWENTY = [f"n{n}" for n in range(20)]


def theirs(reliability: Reliability, durability: Durability, depth: int = 20) -> dict[str, object]:
    """A peer's words for these policies."""
    return {"reliability": reliability.name, "durability": durability.name, "depth": depth}


@pytest.mark.parametrize("distro", ROS)
def test_every_kind_of_writer_reaches_ros(distro: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer(distro)
    node = ros.do("node", name="listener", domain=domain)
    talker = rig.space(domain).participant("talker")
    for i, (reliability, durability) in enumerate(MATRIX):
        writer = talker.writer(Topic(f"rt/t{i}", STRING), Qos(reliability, durability, depth=20))
        qos = theirs(reliability, durability)
        topic = {"node": node, "topic": f"/t{i}", "type": "std_msgs/msg/String", "qos": qos}
        subscription = rig.ask(ros, "subscription", **topic)
        assert rig.ask(ros, "matched", thing=subscription) == 1
        rig.matched(writer)
        for text in TWENTY:
            assert writer.write(string(text))
        got = rig.ask(ros, "take", subscription=subscription, count=20)
        assert [message["data"] for message in got] == TWENTY, (reliability, durability)
        if (reliability, durability) == (Reliability.RELIABLE, Durability.TRANSIENT_LOCAL):
            late = rig.ask(ros, "subscription", **topic)
            got = rig.ask(ros, "take", subscription=late, count=20)
            assert [message["data"] for message in got] == TWENTY, "history for who comes late"
    assert rig.told == []


@pytest.mark.parametrize("distro", ROS)
def test_every_kind_of_ros_publisher_is_read(distro: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer(distro)
    node = ros.do("node", name="talker", domain=domain)
    listener = rig.space(domain).participant("listener")
    for i, (reliability, durability) in enumerate(MATRIX):
        qos = Qos(reliability, durability, depth=20)
        topic = Topic(f"rt/t{i}", STRING)
        reader = listener.reader(topic, qos)
        publisher = rig.ask(
            ros,
            "publisher",
            node=node,
            topic=f"/t{i}",
            type="std_msgs/msg/String",
            qos=theirs(reliability, durability),
        )
        assert rig.ask(ros, "matched", thing=publisher) == 1
        rig.matched(reader)
        rig.ask(ros, "publish", publisher=publisher, message={"data": "n"}, count=20, number="data")
        assert [text_of(body) for body in rig.collect(reader, 20)] == TWENTY, (reliability, durability)
        if (reliability, durability) == (Reliability.RELIABLE, Durability.TRANSIENT_LOCAL):
            late = listener.reader(topic, qos)
            assert [text_of(body) for body in rig.collect(late, 20)] == TWENTY, "history for who comes late"
    assert rig.told == []


@pytest.mark.parametrize("distro", ROS)
def test_what_a_sample_carries_besides_its_body(distro: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer(distro)
    node = ros.do("node", name="talker", domain=domain)
    reader = rig.space(domain).participant("listener").reader(Topic("rt/t", STRING), Qos(depth=5))
    publisher = rig.ask(ros, "publisher", node=node, topic="/t", type="std_msgs/msg/String")
    rig.matched(reader)
    assert rig.ask(ros, "matched", thing=publisher) == 1
    info = rig.ask(ros, "endpoints", node=node, topic="/t", publishers=1, subscriptions=1)
    rig.ask(ros, "publish", publisher=publisher, message={"data": "x"}, count=2)
    rig.until(lambda: reader.pending == 2)
    first, second = reader.take(), reader.take()
    assert first is not None
    assert second is not None
    assert first.writer_gid.hex() == info["publishers"][0]["gid"]
    assert reader.gid.hex() == info["subscriptions"][0]["gid"]
    assert (first.sequence, second.sequence) == (1, 2)
    assert 0 < second.source_time - first.source_time < 10**10
    assert abs(second.source_time - rig.spaces[0].clock()) < 60 * 10**9, "wall clock, ns"


@pytest.mark.parametrize("distro", ROS)
@pytest.mark.parametrize(("size", "count"), [(200_000, 10), (2_000_000, 3)])
def test_large_samples_both_ways(
    distro: str, size: int, count: int, peer: Fetch, rig: Rig, domain: Domain
) -> None:
    ros = peer(distro)
    node = ros.do("node", name="ros", domain=domain)
    ours = rig.space(domain).participant("ours")
    writer = ours.writer(Topic("rt/out", ARRAY), Qos(depth=20))
    reader = ours.reader(Topic("rt/in", ARRAY), Qos(depth=20))
    kind = "std_msgs/msg/UInt8MultiArray"
    subscription = rig.ask(ros, "subscription", node=node, topic="/out", type=kind, qos=20)
    publisher = rig.ask(ros, "publisher", node=node, topic="/in", type=kind, qos=20)
    rig.matched(writer)
    rig.matched(reader)
    assert rig.ask(ros, "matched", thing=publisher) == rig.ask(ros, "matched", thing=subscription) == 1
    for n in range(count):
        writer.write(array(pattern(size, n)))
    got = rig.ask(ros, "take", subscription=subscription, count=count)
    assert [message["data"] for message in got] == [shown(pattern(size, n)) for n in range(count)]
    rig.ask(ros, "publish_bytes", publisher=publisher, size=size, count=count, period=0.01)
    bodies = rig.collect(reader, count)
    assert [len(body) for body in bodies] == [size + 12] * count
    assert bodies == [array(pattern(size, n)) for n in range(count)]


@pytest.mark.parametrize("distro", ROS)
@pytest.mark.parametrize("size", [2_000, 200_000])
def test_five_percent_loss_is_repaired(distro: str, size: int, peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer(distro)
    node = ros.do("node", name="ros", domain=domain)
    losses = Losses(0.05, seed=size)
    ours = rig.space(domain, fault=losses).participant("ours")
    count = 100 if size < 100_000 else 20
    qos = Qos(depth=count, durability=Durability.TRANSIENT_LOCAL)
    writer = ours.writer(Topic("rt/out", ARRAY), qos)
    reader = ours.reader(Topic("rt/in", ARRAY), qos)
    kind = "std_msgs/msg/UInt8MultiArray"
    latched = theirs(Reliability.RELIABLE, Durability.TRANSIENT_LOCAL, count)
    subscription = rig.ask(ros, "subscription", node=node, topic="/out", type=kind, qos=latched)
    publisher = rig.ask(ros, "publisher", node=node, topic="/in", type=kind, qos=latched)
    rig.matched(writer)
    rig.matched(reader)
    assert rig.ask(ros, "matched", thing=publisher) == rig.ask(ros, "matched", thing=subscription) == 1
    for n in range(count):
        writer.write(array(pattern(size, n)))
    rig.ask(ros, "publish_bytes", publisher=publisher, size=size, count=count, period=0.001)
    got = rig.ask(ros, "take", subscription=subscription, count=count, wait=20)
    assert [message["data"] for message in got] == [shown(pattern(size, n)) for n in range(count)]
    assert rig.collect(reader, count, 20) == [array(pattern(size, n)) for n in range(count)]
    assert losses.lost > 0


@pytest.mark.parametrize("distro", ROS)
def test_what_does_not_fit_is_told_on_both_sides(distro: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer(distro)
    node = ros.do("node", name="ros", domain=domain)
    ours = rig.space(domain).participant("ours")
    writer = ours.writer(Topic("rt/out", STRING), Qos(Reliability.BEST_EFFORT, depth=5))
    reader = ours.reader(Topic("rt/in", STRING), Qos(durability=Durability.TRANSIENT_LOCAL, depth=5))
    text = {"node": node, "type": "std_msgs/msg/String"}
    subscription = rig.ask(ros, "subscription", topic="/out", **text)
    publisher = rig.ask(ros, "publisher", topic="/in", **text)
    assert "RELIABILITY" in rig.ask(ros, "problems", thing=subscription)[0]
    assert "DURABILITY" in rig.ask(ros, "problems", thing=publisher)[0]
    rig.until(lambda: len(rig.told) == 2, "findings of both mismatches")
    assert {(finding.code, finding.subject) for finding in rig.told} == {
        ("qos-mismatch", "rt/out"),
        ("qos-mismatch", "rt/in"),
    }
    assert writer.matched == reader.matched == ()


@pytest.mark.parametrize("distro", ROS)
@pytest.mark.parametrize("shared_memory", [False, True])
def test_localhost_range(distro: str, shared_memory: bool, rig: Rig, domain: Domain) -> None:
    """The well-known ports of this host, no multicast; a peer that prefers shared memory is reached over UDP."""
    with start(distro, discovery="localhost", shared_memory=shared_memory) as ros:
        node = ros.do("node", name="ros", domain=domain)
        ours = rig.space(domain, range="LOCALHOST", interfaces=()).participant("ours")
        writer = ours.writer(Topic("rt/out", STRING), Qos(depth=5))
        reader = ours.reader(Topic("rt/in", STRING), Qos(depth=5))
        text = {"node": node, "type": "std_msgs/msg/String"}
        subscription = rig.ask(ros, "subscription", topic="/out", **text)
        publisher = rig.ask(ros, "publisher", topic="/in", **text)
        rig.matched(writer)
        rig.matched(reader)
        assert rig.ask(ros, "matched", thing=publisher) == rig.ask(ros, "matched", thing=subscription) == 1
        writer.write(string("out"))
        rig.ask(ros, "publish", publisher=publisher, message={"data": "in"})
        assert rig.ask(ros, "take", subscription=subscription) == [{"data": "out"}]
        assert [text_of(body) for body in rig.collect(reader, 1)] == ["in"]


@pytest.mark.parametrize("distro", ROS)
def test_shared_memory_and_multicast(distro: str, rig: Rig, domain: Domain) -> None:
    with start(distro, shared_memory=True) as ros:
        node = ros.do("node", name="ros", domain=domain)
        reader = rig.space(domain).participant("ours").reader(Topic("rt/in", STRING), Qos(depth=50))
        publisher = rig.ask(ros, "publisher", node=node, topic="/in", type="std_msgs/msg/String")
        rig.matched(reader)
        assert rig.ask(ros, "matched", thing=publisher) == 1
        rig.ask(ros, "publish", publisher=publisher, message={"data": "n"}, count=20, number="data")
        assert [text_of(body) for body in rig.collect(reader, 20)] == TWENTY


SHORT_LEASE = {
    "FASTRTPS_DEFAULT_PROFILES_FILE": str(PROGRAMS / "fastdds_lo_short_lease.xml"),
    "FASTDDS_DEFAULT_PROFILES_FILE": str(PROGRAMS / "fastdds_lo_short_lease.xml"),
}


@pytest.mark.parametrize("distro", ROS)
def test_ros_crashes_and_comes_again(distro: str, rig: Rig, domain: Domain) -> None:
    space = rig.space(domain)
    ours = space.participant("ours")
    writer = ours.writer(Topic("rt/out", STRING), Qos(depth=5))
    reader = ours.reader(Topic("rt/in", STRING), Qos(depth=5))

    def exchange(ros: Peer, word: str) -> None:
        before = {*writer.matched, *reader.matched}  # of one that crashed, until its lease is over
        node = rig.ask(ros, "node", name="ros", domain=domain)
        text = {"node": node, "type": "std_msgs/msg/String"}
        subscription = rig.ask(ros, "subscription", topic="/out", **text)
        publisher = rig.ask(ros, "publisher", topic="/in", **text)
        assert rig.ask(ros, "matched", thing=publisher) == rig.ask(ros, "matched", thing=subscription) == 1
        rig.until(lambda: set(writer.matched) - before and set(reader.matched) - before)
        writer.write(string(word))
        rig.ask(ros, "publish", publisher=publisher, message={"data": word})
        assert rig.ask(ros, "take", subscription=subscription) == [{"data": word}]
        rig.until(lambda: reader.pending, "a sample")
        assert [text_of(body) for body in take_all(reader)] == [word]

    with start(distro, more=SHORT_LEASE) as first:
        exchange(first, "first")
        first.kill()
    with start(distro, more=SHORT_LEASE) as second:
        exchange(second, "second")
        rig.until(lambda: len(writer.matched) == len(reader.matched) == 1, "the lease of the first to end")
        rig.until(lambda: [node.full_name for node in space.graph.nodes].count("/ros") == 1)
    rig.until(lambda: writer.matched == reader.matched == (), "the second to have taken its leave")
    assert [node.full_name for node in space.graph.nodes] == ["/ours"]


@pytest.mark.parametrize("distro", ROS)
@pytest.mark.parametrize("end", ["reconnects", "leaves", "crashes"])
def test_we_come_again(distro: str, end: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    """A board that reconnects has the gids it had, a process that starts anew has others; samples flow at once."""
    ros = peer(distro)
    node = ros.do("node", name="ros", domain=domain)
    text = {"node": node, "type": "std_msgs/msg/String"}
    subscription = ros.do("subscription", topic="/out", **text)
    publisher = ros.do("publisher", topic="/in", **text)
    cut: set[int] = set()
    gids = set()

    def space(life: int) -> Space:
        return rig.space(domain, fault=lambda _: life in cut)

    ours = space(0)
    for life in range(3):
        board = ours.participant("board", key=b"board 7")
        writer = board.writer(Topic("rt/out", STRING), Qos(depth=5), key=1)
        reader = board.reader(Topic("rt/in", STRING), Qos(depth=5), key=1)
        gids.add((board.gid, writer.gid, reader.gid))
        rig.matched(writer)
        rig.matched(reader)
        present = 1 + (life if end == "crashes" else 0)  # the crashed are there until their lease is over
        assert rig.ask(ros, "matched", thing=subscription, count=present) == present
        assert rig.ask(ros, "matched", thing=publisher, count=present) == present
        rig.run(0.1)
        writer.write(string(f"life {life}"))
        assert rig.ask(ros, "take", subscription=subscription) == [{"data": f"life {life}"}]
        rig.ask(ros, "publish", publisher=publisher, message={"data": f"life {life}"})
        assert [text_of(body) for body in rig.collect(reader, 1)] == [f"life {life}"]
        if end == "reconnects":
            board.close()
            continue
        if end == "crashes":
            cut.add(life)
        ours.close()
        rig.run(0.1)
        ours = space(life + 1)
    assert len(gids) == (1 if end == "reconnects" else 3)


def test_keep_all_waits_for_a_ros_that_stands_still(peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer("jazzy")
    node = ros.do("node", name="ros", domain=domain)
    keep = {"history": "keep_all", "reliability": "reliable"}
    subscription = ros.do("subscription", node=node, topic="/out", type="std_msgs/msg/String", qos=keep)
    writer = (
        rig.space(domain).participant("ours").writer(Topic("rt/out", STRING), Qos(history=History.KEEP_ALL))
    )
    rig.matched(writer)
    assert rig.ask(ros, "matched", thing=subscription) == 1
    sent = 0
    for _ in range(2000):
        rig.until(lambda: writer.write(string(f"n{sent}")), "room")  # noqa: B023
        sent += 1
    got: list[str] = []

    def all_came() -> bool:
        got.extend(m["data"] for m in rig.ask(ros, "take", subscription=subscription, count=1, wait=5))
        return len(got) >= sent

    while not all_came():
        pass
    assert got == [f"n{n}" for n in range(sent)]
