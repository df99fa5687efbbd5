"""Topics between muros and other vendors' DDS without ROS: Cyclone DDS, and Fast DDS as old as Humble's."""

from collections.abc import Callable

import pytest

from muros.space import Durability, Qos, Topic
from tests.dds.bodies import array, pattern, shown, string, text_of
from tests.dds.domains import Domain
from tests.dds.matrix import topics_both_ways
from tests.dds.peers import Peer, start
from tests.dds.rig import ARRAY, STRING, Losses, Rig

VENDORS = ("cyclone", "fastdds")
Fetch = Callable[[str], Peer]


@pytest.mark.parametrize("name", VENDORS)
def test_topics_over_the_qos_matrix(name: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    vendor = peer(name)
    node = vendor.do("node", name="vendor", domain=domain)
    ours = rig.space(domain).participant("ours")
    topics_both_ways(rig, vendor, node, ours)


@pytest.mark.parametrize("loss", [0, 0.05])
@pytest.mark.parametrize("name", VENDORS)
def test_large_samples(name: str, loss: float, peer: Fetch, rig: Rig, domain: Domain) -> None:
    vendor = peer(name)
    node = vendor.do("node", name="vendor", domain=domain)
    ours = rig.space(domain, fault=Losses(loss, seed=3)).participant("ours")
    qos = Qos(depth=20, durability=Durability.TRANSIENT_LOCAL)
    said = {"depth": 20, "durability": "transient_local"}
    writer, reader = ours.writer(Topic("rt/out", ARRAY), qos), ours.reader(Topic("rt/in", ARRAY), qos)
    kind = {"node": node, "type": "std_msgs/msg/UInt8MultiArray", "qos": said}
    subscription = rig.ask(vendor, "subscription", topic="/out", **kind)
    publisher = rig.ask(vendor, "publisher", topic="/in", **kind)
    rig.matched(writer)
    rig.matched(reader)
    assert rig.ask(vendor, "matched", thing=publisher) == rig.ask(vendor, "matched", thing=subscription) == 1
    sizes = [200_000] * 5 + ([] if loss else [2_000_000] * 2)
    for n, size in enumerate(sizes):
        writer.write(array(pattern(size, n)))
    got = rig.ask(vendor, "take", subscription=subscription, count=len(sizes), wait=20)
    assert [message["data"] for message in got] == [shown(pattern(size, n)) for n, size in enumerate(sizes)]
    for size, count in ((200_000, 5), (2_000_000, 0 if loss else 2)):
        rig.ask(vendor, "publish_bytes", publisher=publisher, size=size, count=count, period=0.02)
        assert rig.collect(reader, count, 20) == [array(pattern(size, n)) for n in range(count)]


@pytest.mark.parametrize("name", VENDORS)
def test_a_vendor_that_leaves_and_one_that_comes(name: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    ours = rig.space(domain).participant("ours")
    writer = ours.writer(Topic("rt/out", STRING), Qos(depth=5))
    for life in ("first", "second"):
        with start(name) as vendor:
            node = rig.ask(vendor, "node", name="vendor", domain=domain)
            subscription = rig.ask(
                vendor, "subscription", node=node, topic="/out", type="std_msgs/msg/String"
            )
            rig.matched(writer)
            assert rig.ask(vendor, "matched", thing=subscription) == 1
            rig.run(0.1)
            writer.write(string(life))
            assert rig.ask(vendor, "take", subscription=subscription) == [{"data": life}]
        rig.matched(writer, 0)


def test_cyclone_in_the_localhost_range(rig: Rig, domain: Domain) -> None:
    with start("cyclone", discovery="localhost") as vendor:
        node = vendor.do("node", name="vendor", domain=domain)
        reader = (
            rig.space(domain, range="LOCALHOST", interfaces=())
            .participant("ours")
            .reader(Topic("rt/in", STRING), Qos(depth=5))
        )
        publisher = rig.ask(vendor, "publisher", node=node, topic="/in", type="std_msgs/msg/String")
        rig.matched(reader)
        assert rig.ask(vendor, "matched", thing=publisher) == 1
        rig.ask(vendor, "publish", publisher=publisher, message={"data": "in"})
        assert [text_of(body) for body in rig.collect(reader, 1)] == ["in"]
