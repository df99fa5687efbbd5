"""What the dds engine says when something goes wrong, on the network or with others."""

import re
from pathlib import Path
from typing import Any

import pytest

from muros.rtps import DomainProblem, DomainReport, Received, inline_qos, udp4
from muros.space import Appeared, Liveliness, Qos, Reader, Topic, identity_of
from muros.space.dds import _services
from muros.space.dds._endpoints import encapsulated
from tests.space.conformance import ADD, CHATTER, KEEP_ALL, RELIABLE, numbered
from tests.space.dds_world import MS, SECOND, Computer, Net, take_all

DOCUMENT = (Path(__file__).parents[2] / "docs/space.md").read_text()


def home_of(computer: Computer) -> object:
    """The only domain of a space."""
    (home,) = computer.space._domains.values()  # type: ignore[attr-defined]
    return home


class TestTheDomain:
    @pytest.mark.parametrize("problem", DomainProblem)
    @pytest.mark.parametrize("known", ["nobody", "source", "prefix", "node"])
    def test_every_problem_is_told_in_words(self, problem: DomainProblem, known: str) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        one.space.participant("here")
        there = two.space.participant("there")
        net.until(lambda: len(one.graph.nodes) == 2)
        prefix = {"prefix": b"p" * 12, "node": there.gid[:12]}.get(known, b"")
        source = udp4("10.1.2.3", 7410) if known == "source" else None
        report = DomainReport(problem, prefix, source, 42, "some detail")
        home_of(one)._report(report)  # type: ignore[attr-defined]
        net.run()
        (finding,) = one.told
        assert f"| `{finding.code}` |" in DOCUMENT
        text = finding.format()
        assert not re.search(r"[{}]", text)
        assert finding.why.endswith("some detail")
        assert finding.remedy
        if "{who}" in str(problem) or finding.what.startswith("/there"):
            assert known == "node"
        if known == "source" and "somebody at" in text:
            assert "10.1.2.3" in text

    def test_somebody_of_another_domain_is_told(self) -> None:
        """As RTPS tells it itself."""
        net = Net()
        one, two = net.computer(), net.computer()
        one.space.participant("here")
        two.space.participant("there", domain=5)
        net.run(2 * SECOND)
        assert one.codes == ["dds-foreign-domain"]
        assert [node.name for node in one.graph.nodes] == ["here"]


class TestSamples:
    def test_lost_on_the_way(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        writer = one.space.participant("talker").writer(CHATTER, Qos(depth=1))
        reader = two.space.participant("listener").reader(CHATTER, RELIABLE)
        net.until(lambda: writer.matched and reader.matched)
        writer.write(numbered(0))
        net.run()
        net.world.network.loss = 1.0
        for i in range(1, 6):
            writer.write(numbered(i))
        net.run(10 * MS)
        net.world.network.loss = 0.0
        net.run(2 * SECOND)
        assert take_all(reader) == [numbered(0), numbered(5)]
        assert reader.lost == 4
        (finding,) = two.told
        assert (finding.code, finding.who, finding.subject) == ("samples-lost", "/listener", "rt/chatter")
        assert finding.why.startswith("/talker no longer had them")
        assert two.space.findings.counts() == {"samples-lost": 4}

    def test_without_encapsulation(self) -> None:
        net = Net()
        one = net.computer()
        reader: Any = one.space.participant("listener").reader(CHATTER, RELIABLE)
        for payload in (b"", b"\0\1", b"\0\1\0"):
            assert reader.came(Received(bytes(16), 1, payload, None, None)), "it is not to come again"
        assert reader.take() is None
        net.run()
        (finding,) = one.told
        assert (finding.code, finding.who, finding.subject) == (
            "sample-unreadable",
            "/listener",
            "rt/chatter",
        )
        assert one.space.findings.counts() == {"sample-unreadable": 3}

    def test_padding_that_cannot_be_is_left(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """The option bits say three bytes of padding, and there are none."""
        net = Net()
        other = net.stranger(monkeypatch)
        one = net.computer()
        reader = one.space.participant("listener").reader(CHATTER, RELIABLE)
        writer = other.writer(*CHATTER)
        net.until(lambda: writer.matched)
        writer.write(b"\0\1\0\3", other.now)
        net.run()
        assert take_all(reader) == [b""]

    def test_an_identity_cut_short_is_none(self, monkeypatch: pytest.MonkeyPatch) -> None:
        net = Net()
        other = net.stranger(monkeypatch)
        one = net.computer()
        reader = one.space.participant("listener").reader(CHATTER, RELIABLE)
        writer = other.writer(*CHATTER)
        net.until(lambda: writer.matched)
        short = b"\x83\x00\x08\x00" + bytes(8) + b"\x01\x00\x00\x00"
        writer.write(encapsulated(b"x"), other.now, inline_qos=short)
        net.run()
        sample = reader.take()
        assert sample is not None
        assert (sample.data, sample.related) == (b"x", None)


def test_liveliness_is_told_on_both_sides() -> None:
    net = Net()
    one, two = net.computer(), net.computer()
    qos = RELIABLE.replace(liveliness=Liveliness.MANUAL_BY_TOPIC, lease=SECOND)
    writer = one.space.participant("talker").writer(CHATTER, qos)
    reader = two.space.participant("listener").reader(CHATTER, qos)
    net.until(lambda: writer.matched and reader.matched)
    for _ in range(8):
        writer.write(b"x")
        net.run(SECOND // 2)
    assert one.told + two.told == []
    net.run(3 * SECOND)
    assert set(one.codes) == {"liveliness-lost"}
    assert set(two.codes) == {"writer-silent"}
    assert "/talker" in two.told[0].why
    assert "1 s" in one.told[0].why
    writer.write(b"x")
    net.run()
    assert reader.matched


class TestServices:
    def test_waiting_replies_are_bounded(self, monkeypatch: pytest.MonkeyPatch) -> None:
        net = Net()
        other = net.stranger(monkeypatch)
        one = net.computer(resource_limit=3, request_wait=SECOND)
        asked = other.writer(ADD.request_topic, ADD.request_type)
        server = one.space.participant("server").replier(ADD)
        net.until(lambda: asked.matched)
        related = inline_qos(related=identity_of(asked.guid[:12] + b"\0\7\7\4", -1 << 32))
        for _ in range(5):
            asked.write(encapsulated(b"x"), other.now, inline_qos=related)
            net.run()
            request = server.take()
            assert request is not None
            assert server.reply(request.identity, b"y"), "it waits for its reader"
        assert one.space.findings.counts() == {"reply-unmatched": 2}
        asked.close(other.now)
        net.run()
        replies, _ = other.reader(ADD.reply_topic, ADD.reply_type)
        net.until(lambda: replies.matched)
        net.run()
        assert one.space.findings.counts() == {"reply-unmatched": 5}, "who asked has gone"

    def test_somebody_elses_reader_is_not_answered(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Who names a reader of another participant is answered itself."""
        net = Net()
        other, victim = net.stranger(monkeypatch), net.stranger(monkeypatch)
        one = net.computer()
        asked = other.writer(ADD.request_topic, ADD.request_type)
        _, got = other.reader(ADD.reply_topic, ADD.reply_type)
        reader, stolen = victim.reader(ADD.reply_topic, ADD.reply_type)
        victim.writer(ADD.request_topic, ADD.request_type)
        server = one.space.participant("server").replier(ADD)
        net.until(lambda: server.clients == 2 and asked.matched)
        related = inline_qos(related=identity_of(reader.guid, -1 << 32))
        asked.write(encapsulated(b"x"), other.now, inline_qos=related)
        net.run()
        request = server.take()
        assert request is not None
        assert server.reply(request.identity, b"y")
        net.run()
        assert (len(got), stolen) == (1, [])

    def test_numbers_that_differ_are_remembered_within_bounds(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(_services, "SHIFTED_MOST", 5)
        net = Net()
        one, two = net.computer(request_wait=SECOND), net.computer(request_wait=SECOND)
        answers: list[int] = []
        client = two.space.participant("client").requester(
            ADD, Qos(depth=1), lambda n, data: answers.append(n)
        )
        for _ in range(3):
            client.send(b"given up")
        server = one.space.participant("server").replier(ADD, KEEP_ALL)
        net.until(lambda: client.servers == 1 and server.clients == 1)
        numbers = []
        for _ in range(10):
            numbers.append(client.send(b"x"))
            net.run(20 * MS)
        requests = []
        while (request := server.take()) is not None:
            requests.append(request)
        assert len(requests) == 11
        assert requests[0].data == b"given up", "the last of the three waited"
        for request in requests:
            server.reply(request.identity, b"y")
            net.run(20 * MS)
        assert answers[-5:] == numbers[-5:], "the last ones are known by their numbers"
        assert len(set(numbers)) == 10


def test_what_a_participant_says_anew_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    net = Net()
    other = net.stranger(monkeypatch)
    one = net.computer()
    one.space.participant("watcher")
    net.until(lambda: len(one.graph.participants) == 2)
    other.participant.set_user_data(b"enclave=/new;", other.now)
    net.run(5 * SECOND)
    remote = home_of(one).remotes[other.participant.prefix]  # type: ignore[attr-defined]
    assert remote.data.user_data == b"enclave=/new;"


def test_an_endpoint_without_participant_has_a_name_all_the_same() -> None:
    net = Net()
    one = net.computer()
    one.space.participant("here")
    assert home_of(one).name_of(b"q" * 16) == f"participant {b'q'.hex() * 12}"  # type: ignore[attr-defined]


def test_watchers_may_read_the_graph_in_their_callback() -> None:
    net = Net()
    one, two = net.computer(), net.computer()
    seen: list[int] = []

    def look(event: object) -> None:
        if isinstance(event, Appeared):
            seen.append(len(two.graph.participants) + len(two.graph.topics))

    two.graph.watch(look)
    two.space.participant("watcher")
    one.space.participant("talker").writer(CHATTER)
    net.run(2 * SECOND)
    assert seen
    assert two.told == []


def test_a_reader_that_takes_in_its_callback_keeps_the_order() -> None:
    """Samples that were held back come after those that are taken, not in between."""
    net = Net()
    one, two = (net.computer(resource_limit=4, max_blocking_time=20 * SECOND) for _ in range(2))
    writer = one.space.participant("talker").writer(Topic("rt/x", "T"), KEEP_ALL)
    got: list[bytes] = []
    busy = True

    def take(reader: Reader) -> None:
        while not busy and (sample := reader.take()) is not None:
            got.append(sample.data)

    reader = two.space.participant("listener").reader(Topic("rt/x", "T"), KEEP_ALL, take)
    net.until(lambda: writer.matched and reader.matched)
    for i in range(8):
        assert writer.write(numbered(i))
        net.run(MS)
    busy = False
    take(reader)
    net.run(SECOND)
    assert got == [numbered(i) for i in range(8)]
