"""Topics both ways with a peer, over the matrix of reliability and durability: the same for all engines and vendors."""

from muros.space import Durability, Participant, Qos, Reliability, Topic
from tests.dds.bodies import string, text_of
from tests.dds.peers import Peer
from tests.dds.rig import STRING, Rig

__all__ = ["topics_both_ways"]

TWENTY = [f"n{n}" for n in range(20)]


def topics_both_ways(rig: Rig, other: Peer, node: int, ours: Participant, period: float = 0.0) -> None:
    """Twenty samples each way in each case, all of them and in order; history for those that come late.

    `node` is the peer's. period: seconds between its samples.
    """
    for reliability in (Reliability.RELIABLE, Reliability.BEST_EFFORT):
        for durability in (Durability.VOLATILE, Durability.TRANSIENT_LOCAL):
            case = f"{reliability.name}_{durability.name}".lower()
            qos = Qos(reliability, durability, depth=20)
            said = {
                "reliability": reliability.name.lower(),
                "durability": durability.name.lower(),
                "depth": 20,
            }
            text = {"node": node, "type": "std_msgs/msg/String", "qos": said}
            writer = ours.writer(Topic(f"rt/out_{case}", STRING), qos)
            reader = ours.reader(Topic(f"rt/in_{case}", STRING), qos)
            subscription = rig.ask(other, "subscription", topic=f"/out_{case}", **text)
            publisher = rig.ask(other, "publisher", topic=f"/in_{case}", **text)
            rig.matched(writer)
            rig.matched(reader)
            assert rig.ask(other, "matched", thing=subscription) == 1
            assert rig.ask(other, "matched", thing=publisher) == 1
            for word in TWENTY:
                assert writer.write(string(word))
            many = {"message": {"data": "n"}, "count": 20, "number": "data", "period": period}
            rig.ask(other, "publish", publisher=publisher, **many)
            got = rig.ask(other, "take", subscription=subscription, count=20)
            assert [message["data"] for message in got] == TWENTY, case
            assert [text_of(body) for body in rig.collect(reader, 20)] == TWENTY, case
            if case == "reliable_transient_local":
                late = rig.ask(other, "subscription", topic=f"/out_{case}", **text)
                got = rig.ask(other, "take", subscription=late, count=20)
                assert [message["data"] for message in got] == TWENTY, "their late joiner"
                late_reader = ours.reader(Topic(f"rt/in_{case}", STRING), qos)
                assert [text_of(body) for body in rig.collect(late_reader, 20)] == TWENTY, "our late joiner"
    assert rig.told == []
