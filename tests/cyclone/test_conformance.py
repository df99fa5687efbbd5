"""The cyclonedds engine: the contract of all engines, and what is different.

Among the participants of one process Cyclone delivers within the call, so time can be a test's here too.
"""

from pathlib import Path

import pytest

from muros.findings import Finding
from muros.space import CDR_BE, Qos, Reader, Space, SpaceError, Topic, identity_of, open_space
from muros.space.cyclone import GAPS
from muros.space.dds._dialects import client_id, header
from tests.dds.domains import Domain
from tests.dds.peers import require
from tests.dds.rig import Rig
from tests.space.conformance import (
    ADD,
    CHATTER,
    KEEP_ALL,
    LATCHED,
    MS,
    RELIABLE,
    SECOND,
    VirtualTime,
    numbered,
    take_all,
)


@pytest.fixture(autouse=True)
def _cyclone() -> None:
    require("cyclone")


class TestCyclone(VirtualTime):
    """Tests of the contract replaced here say what is different; `GAPS` says it to users."""

    TYPE_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"

    def make(self) -> Space:
        return open_space(
            "cyclonedds:0",
            clock=self.clock,
            range="OFF",
            resource_limit=self.LIMIT,
            max_blocking_time=self.PATIENCE,
            request_wait=self.REQUEST_WAIT,
        )

    def test_what_the_writer_says_of_a_sample_arrives(self, space: Space) -> None:
        """But for the request it answers, and big-endian bytes."""
        assert {"related", "big endian"} <= GAPS.keys()
        writer = space.participant("talker").writer(CHATTER, RELIABLE)
        reader = space.participant("listener").reader(CHATTER, RELIABLE)
        writer.write(b"\1\0\0\0", source_time=123, representation=0x0007)
        sample = reader.take()
        assert sample is not None
        assert (sample.source_time, sample.representation) == (123, 0x0007)
        with pytest.raises(SpaceError, match="cannot carry big-endian samples"):
            writer.write(b"\0\0\0\1", representation=CDR_BE)
        writer.write(b"x", related=identity_of(bytes(16), 1))
        assert (sample := reader.take()) is not None
        assert sample.related is None
        self.settle(space)
        assert space.findings.counts() == {"related-not-carried": 1}

    def test_lifespan(self, space: Space, told: list[Finding]) -> None:
        """Cyclone itself goes by the time of the world: it gives late readers what is younger there."""
        assert "source time" in GAPS
        writer = space.participant("talker").writer(CHATTER, LATCHED.replace(lifespan=SECOND))
        reader = space.participant("listener").reader(CHATTER, LATCHED)
        writer.write(b"old", source_time=5)
        self.pass_time(space, SECOND // 2)
        writer.write(b"new")
        self.settle(space)
        assert reader.pending == 2
        self.pass_time(space, SECOND // 2)
        assert reader.pending == 1
        assert take_all(reader) == [b"new"]
        assert reader.expired == 1
        self.settle(space)
        assert [(f.code, f.who) for f in told] == [("sample-expired", "/listener")]

    def test_a_reply_cut_short_reaches_nobody(self, space: Space) -> None:
        """Whoever writes on the topic of replies: what does not begin with a client's id is for nobody."""
        requester = space.participant("client").requester(ADD)
        writer = space.participant("stranger").writer(Topic(ADD.reply_topic, ADD.reply_type))
        self.settle(space)
        assert writer.matched
        ours = header(client_id(requester.gid), 7)
        for data in (b"", b"x", ours[:15], header(1, 7) + b"x"):
            writer.write(data)
        self.settle(space)
        assert requester.take() is None
        writer.write(ours + b"y")
        self.settle(space)
        reply = requester.take()
        assert reply is not None
        assert (reply.sequence, reply.data) == (7, b"y")

    def test_services_are_ordinary_topics(self, space: Space) -> None:
        """Who listens hears requests and replies with what stands before them."""
        ear = space.participant("ear")
        requests = ear.reader(Topic(ADD.request_topic, ADD.request_type), RELIABLE)
        replies = ear.reader(Topic(ADD.reply_topic, ADD.reply_type), RELIABLE)
        requester = space.participant("client").requester(ADD)
        number = requester.send(b"?")
        self.settle(space)
        replier = space.participant("server").replier(ADD)
        self.settle(space)
        request = replier.take()
        assert request is not None
        assert request.identity == identity_of(requester.gid, number)
        replier.reply(request.identity, b"!")
        self.settle(space)
        head = header(client_id(requester.gid), number)
        assert (take_all(requests), take_all(replies)) == ([head + b"?"], [head + b"!"])

    def test_keys_give_the_same_gids_in_every_life(self, space: Space) -> None:
        """They cannot; but a key in use is refused, and can be used again."""
        assert "gids" in GAPS
        gids = set()
        for _ in range(2):
            with space.participant("board", key=b"\xba\x5e\xba\x11") as board:
                gids.add(board.writer(CHATTER, key=0x15).gid)
                with pytest.raises(ValueError, match="is in use"):
                    space.participant("other", key=b"\xba\x5e\xba\x11")
        assert len(gids) == 2

    def test_the_number_of_a_sample_is_the_readers(self, space: Space) -> None:
        assert "sequence" in GAPS
        writer = space.participant("talker").writer(CHATTER, RELIABLE)
        writer.write(b"before anybody listened")

        def numbers(reader: Reader) -> list[int]:
            return [sample.sequence for sample in iter(reader.take, None)]

        reader = space.participant("listener").reader(CHATTER, Qos(depth=5))
        for _ in range(3):
            writer.write(b"x")
        assert numbers(reader) == [1, 2, 3]

    def test_a_reader_in_another_space_of_the_process_holds_up_a_writer(self, space: Space) -> None:
        """Cyclone refuses it then, and the writer is called again when it is worth trying."""
        assert "patience" in GAPS
        with self.make() as other:
            reader = other.participant("listener").reader(CHATTER, KEEP_ALL)
            writer = space.participant("talker").writer(CHATTER, KEEP_ALL)
            rooms: list[int] = []
            writer.on_room = lambda: rooms.append(1)
            sent = 0
            while writer.write(numbered(sent)):
                other.tick()
                sent += 1
                assert sent < 100
            self.pass_time(space, 10 * MS)
            assert rooms
            assert not writer.write(b"still full")
            got = take_all(reader)
            other.tick()
            assert writer.write(numbered(sent))
            other.tick()
            got += take_all(reader)
            other.tick()
            assert [*got, *take_all(reader)] == [numbered(n) for n in range(sent + 1)]


def test_every_gap_is_documented() -> None:
    text = (Path(__file__).parents[2] / "docs/cyclonedds.md").read_text()
    assert [gap for gap in GAPS if f"| {gap} |" not in text] == []


def test_what_makes_no_sense_is_one_clear_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SpaceError, match="'x' is no domain number"):
        open_space("cyclonedds:x")
    with pytest.raises(TypeError, match="has no option speed"):
        open_space("cyclonedds:", speed=3)
    with pytest.raises(SpaceError, match="'BOTH' is not possible"):
        open_space("cyclonedds:", range="BOTH")
    with (
        open_space("cyclonedds:3", config="<CycloneDDS><Nonsense/>") as space,
        pytest.raises(SpaceError, match="does not take the configuration of domain 3"),
    ):
        space.participant("node")
    monkeypatch.setattr("muros.space.cyclone._space.installed_version", lambda: "")
    with pytest.raises(SpaceError, match=r"pip install 'cyclonedds==11\.0\.1'.*dds: needs nothing"):
        open_space("cyclonedds:")


def test_a_domain_may_be_configured_anew_when_its_last_space_has_left(rig: Rig, domain: Domain) -> None:
    secluded = open_space(f"cyclonedds:{domain}", range="OFF")
    secluded.participant("alone")
    with open_space(f"cyclonedds:{domain}", interfaces=("lo",)) as second:
        other = second.participant("with")

        def met() -> bool:
            second.tick()
            secluded.tick()
            return len(secluded.graph.nodes) == len(second.graph.nodes) == 2

        rig.until(met, "two spaces of one process to meet")
        other.close()
    secluded.close()
    ours, muros = rig.space(domain, "cyclonedds"), rig.space(domain)
    ours.participant("ours")
    muros.participant("muros")
    rig.until(lambda: len(ours.graph.nodes) == len(muros.graph.nodes) == 2)


def test_another_version_is_used_as_it_is_and_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("muros.space.cyclone._opaque.installed_version", lambda: "12.0.0")
    with open_space("cyclonedds:1", range="OFF") as space:
        node = space.participant("node")
        writer, reader = node.writer(CHATTER, RELIABLE), node.reader(CHATTER, RELIABLE)
        writer.write(b"x\0\0\0")
        assert take_all(reader) == [b"x\0\0\0"]
        (finding,) = space.findings.snapshot()
        assert finding.code == "types-announced"
        assert "Kilted" in finding.what
