"""Deadline, lifespan, liveliness and ownership between the dds engine and other people's DDS, both ways."""

from collections.abc import Callable
from typing import Final

import pytest

from muros.space import Durability, Liveliness, Ownership, Qos, Reader, Topic
from tests.dds.bodies import string, text_of
from tests.dds.domains import Domain
from tests.dds.peers import Peer
from tests.dds.rig import STRING, Rig, take_all

PEERS: Final = ("jazzy", "kilted", "cyclone")
TYPE: Final = "std_msgs/msg/String"
CHATTER: Final = Topic("rt/chatter", STRING)
MS: Final = 1_000_000
Fetch = Callable[[str], Peer]

each_peer = pytest.mark.parametrize("name", PEERS)


def node_of(peer: Peer, domain: Domain) -> int:
    return int(peer.do("node", name="other", domain=domain))


def said(reader: Reader) -> list[str]:
    """What it has to take, as text."""
    return [text_of(body) for body in take_all(reader)]


@each_peer
def test_they_miss_what_we_do_not_write_in_time(name: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    other = peer(name)
    node = node_of(other, domain)
    writer = rig.space(domain).participant("ours").writer(CHATTER, Qos(depth=10, deadline=200 * MS))
    theirs = rig.ask(
        other, "subscription", node=node, topic="/chatter", type=TYPE, qos={"depth": 10, "deadline": 0.3}
    )
    rig.matched(writer)
    rig.ask(other, "matched", thing=theirs)
    writer.write(string("once"))
    assert rig.ask(other, "events", subscription=theirs, last="deadline")[-1] == "deadline"
    assert writer.deadline_missed >= 1


@each_peer
def test_we_miss_what_they_do_not_write_in_time(name: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    other = peer(name)
    node = node_of(other, domain)
    reader = rig.space(domain).participant("ours").reader(CHATTER, Qos(depth=10, deadline=300 * MS))
    theirs = other.do("publisher", node=node, topic="/chatter", type=TYPE, qos={"depth": 10, "deadline": 0.2})
    rig.matched(reader)
    rig.ask(other, "matched", thing=theirs)
    rig.ask(other, "publish", publisher=theirs, message={"data": "once"})
    rig.until(lambda: reader.deadline_missed >= 2)
    assert said(reader) == ["once"]
    assert [(told.code, told.who) for told in rig.told] == [("reader-deadline-missed", "/ours")]


@each_peer
def test_what_we_wrote_too_long_ago_reaches_no_late_reader(
    name: str, peer: Fetch, rig: Rig, domain: Domain
) -> None:
    other = peer(name)
    node = node_of(other, domain)
    lasting = Qos(depth=10, durability=Durability.TRANSIENT_LOCAL)
    ours = rig.space(domain).participant("ours")
    writer = ours.writer(CHATTER, lasting.replace(lifespan=300 * MS))
    writer.write(string("old"))
    rig.run(0.5)
    theirs = rig.ask(
        other,
        "subscription",
        node=node,
        topic="/chatter",
        type=TYPE,
        qos={"depth": 10, "durability": "transient_local"},
    )
    rig.matched(writer)
    rig.ask(other, "matched", thing=theirs)
    writer.write(string("new"))
    assert rig.ask(other, "take", subscription=theirs) == [{"data": "new"}]


@each_peer
def test_what_they_wrote_too_long_ago_is_not_given_to_us(
    name: str, peer: Fetch, rig: Rig, domain: Domain
) -> None:
    other = peer(name)
    node = node_of(other, domain)
    reader = rig.space(domain).participant("ours").reader(CHATTER, Qos(depth=10))
    theirs = other.do("publisher", node=node, topic="/chatter", type=TYPE, qos={"depth": 10, "lifespan": 0.3})
    rig.matched(reader)
    rig.ask(other, "matched", thing=theirs)
    rig.ask(other, "publish", publisher=theirs, message={"data": "old"})
    rig.until(lambda: reader.pending or reader.expired)
    rig.until(lambda: reader.pending == 0)
    assert said(reader) == []
    assert reader.expired == 1


@each_peer
def test_they_notice_that_we_fell_silent(name: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    other = peer(name)
    node = node_of(other, domain)
    by_hand = Qos(depth=10, liveliness=Liveliness.MANUAL_BY_TOPIC, lease=300 * MS)
    writer = rig.space(domain).participant("ours").writer(CHATTER, by_hand)
    wanted = {"depth": 10, "liveliness": "manual_by_topic", "liveliness_lease_duration": 0.5}
    theirs = rig.ask(other, "subscription", node=node, topic="/chatter", type=TYPE, qos=wanted)
    rig.matched(writer)
    rig.ask(other, "matched", thing=theirs)
    writer.write(string("here"))
    assert rig.ask(other, "events", subscription=theirs, last="0 alive") == ["1 alive", "0 alive"]
    writer.write(string("again"))
    assert rig.ask(other, "events", subscription=theirs, last="1 alive")[2] == "1 alive"
    assert [told.code for told in rig.told] == ["liveliness-lost"]


@each_peer
def test_we_notice_that_they_fell_silent(name: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    other = peer(name)
    node = node_of(other, domain)
    wanted = Qos(depth=10, liveliness=Liveliness.MANUAL_BY_TOPIC, lease=500 * MS)
    reader = rig.space(domain).participant("ours").reader(CHATTER, wanted)
    offered = {"depth": 10, "liveliness": "manual_by_topic", "liveliness_lease_duration": 0.3}
    theirs = other.do("publisher", node=node, topic="/chatter", type=TYPE, qos=offered)
    rig.matched(reader)
    rig.ask(other, "matched", thing=theirs)
    rig.ask(other, "publish", publisher=theirs, message={"data": "here"})
    rig.until(lambda: "writer-silent" in [told.code for told in rig.told], "that it is silent")
    assert said(reader) == ["here"]


@each_peer
def test_automatic_liveliness_lasts_without_a_word(name: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    other = peer(name)
    node = node_of(other, domain)
    ours = rig.space(domain).participant("ours")
    writer = ours.writer(Topic("rt/ours", STRING), Qos(depth=10, lease=1000 * MS))
    reader = ours.reader(Topic("rt/theirs", STRING), Qos(depth=10, lease=1800 * MS))
    wanted = {"depth": 10, "liveliness": "automatic", "liveliness_lease_duration": 1.8}
    theirs = rig.ask(other, "subscription", node=node, topic="/ours", type=TYPE, qos=wanted)
    offered = {"depth": 10, "liveliness": "automatic", "liveliness_lease_duration": 1.0}
    rig.ask(other, "publisher", node=node, topic="/theirs", type=TYPE, qos=offered)
    rig.matched(writer)
    rig.matched(reader)
    rig.run(2.5)
    assert rig.ask(other, "events", subscription=theirs, last="1 alive") == ["1 alive"]
    assert rig.told == []


def test_cyclone_hears_the_strongest_of_ours(peer: Fetch, rig: Rig, domain: Domain) -> None:
    other = peer("cyclone")
    node = node_of(other, domain)
    ours = rig.space(domain).participant("ours")
    alone = Qos(depth=10, ownership=Ownership.EXCLUSIVE)
    weak, strong = (ours.writer(CHATTER, alone.replace(strength=strength)) for strength in (1, 5))
    theirs = rig.ask(
        other,
        "subscription",
        node=node,
        topic="/chatter",
        type=TYPE,
        qos={"depth": 10, "ownership": "exclusive"},
    )
    rig.matched(weak)
    rig.matched(strong)
    rig.ask(other, "matched", thing=theirs, count=2)
    strong.write(string("strong"))
    assert rig.ask(other, "take", subscription=theirs) == [{"data": "strong"}]
    weak.write(string("unheard"))
    rig.run(0.2)
    strong.close()
    rig.ask(other, "matched", thing=theirs, count=1)
    heard: list[dict[str, str]] = []
    for _ in range(20):  # it takes its time until it lets the next one own the topic
        weak.write(string("weak"))
        heard += rig.ask(other, "take", subscription=theirs, wait=0.25)
        if heard:
            break
    assert heard[:1] == [{"data": "weak"}]


def test_we_hear_the_strongest_of_cyclone(peer: Fetch, rig: Rig, domain: Domain) -> None:
    other = peer("cyclone")
    node = node_of(other, domain)
    reader = (
        rig.space(domain).participant("ours").reader(CHATTER, Qos(depth=10, ownership=Ownership.EXCLUSIVE))
    )
    weak, strong = (
        other.do(
            "publisher",
            node=node,
            topic="/chatter",
            type=TYPE,
            qos={"depth": 10, "ownership": "exclusive", "strength": strength},
        )
        for strength in (1, 5)
    )
    rig.matched(reader, 2)
    rig.ask(other, "matched", thing=weak)
    rig.ask(other, "matched", thing=strong)
    rig.ask(other, "publish", publisher=strong, message={"data": "strong"})
    rig.until(lambda: reader.pending)
    rig.ask(other, "publish", publisher=weak, message={"data": "unheard"})
    rig.run(0.2)
    rig.ask(other, "destroy", thing=strong)
    rig.matched(reader)
    rig.ask(other, "publish", publisher=weak, message={"data": "weak"})
    rig.until(lambda: reader.pending == 2)
    assert said(reader) == ["strong", "weak"]
