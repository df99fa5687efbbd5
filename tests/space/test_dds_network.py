"""The dds engine among several computers: everything in virtual time on a network that may lose, delay and part."""

import struct
from typing import Any

import pytest

from muros.links.testing import Datagram
from muros.rtps import EndpointQos, ParticipantLost, Why, inline_qos
from muros.rtps._wire import AckNack, parse_untrusted
from muros.space import (
    Appeared,
    Assigned,
    Durability,
    ParticipantInfo,
    Qos,
    Reliability,
    Replier,
    Requester,
    Role,
    Topic,
    Unmatched,
    Vanished,
    identity_of,
)
from muros.space._core import Limits
from muros.space._values import split_identity
from muros.space.dds._discovery_info import INFO_TOPIC, DiscoveryInfo, NodeEntities
from muros.space.dds._endpoints import encapsulated
from muros.space.dds._wire_qos import to_wire
from tests.space.conformance import ADD, CHATTER, KEEP_ALL, LATCHED, RELIABLE, numbered
from tests.space.dds_world import MS, SECOND, Net, Stranger, take_all

CYCLONE = b"\x01\x10"
LATCHED_WIRE = to_wire(Qos(durability=Durability.TRANSIENT_LOCAL), Limits())


def echo(replier: list[Replier], heard: list[bytes] | None = None) -> Any:
    """A callback of a server that answers with what it was asked, twice."""

    def answer(identity: bytes, data: bytes) -> None:
        if heard is not None:
            heard.append(data)
        assert replier[0].reply(identity, data + data)

    return answer


def serve(computer: Any, name: str = "server", heard: list[bytes] | None = None) -> Replier:
    """A server of `ADD`."""
    made: list[Replier] = []
    made.append(computer.space.participant(name).replier(ADD, None, echo(made, heard)))
    return made[0]


class TestTopics:
    @pytest.mark.parametrize("seed", range(3))
    def test_everything_arrives_once_and_in_order_however_bad_the_network(self, seed: int) -> None:
        net = Net(seed, loss=0.1, duplicate=0.05, reorder=0.05)
        one, two = net.computer(), net.computer()
        writer = one.space.participant("talker").writer(CHATTER, KEEP_ALL)
        got: list[bytes] = []
        reader = two.space.participant("listener").reader(
            CHATTER, KEEP_ALL, lambda reader: got.extend(take_all(reader))
        )
        net.until(lambda: writer.matched and reader.matched)
        for i in range(200):
            assert writer.write(numbered(i))
            net.run(2 * MS)
        net.until(lambda: len(got) == 200)
        assert got == [numbered(i) for i in range(200)]
        assert (one.told, two.told) == ([], [])

    def test_samples_pass_untouched_with_time_and_writer(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        writer = one.space.participant("talker").writer(CHATTER, RELIABLE)
        reader = two.space.participant("listener").reader(CHATTER, RELIABLE)
        net.until(lambda: writer.matched and reader.matched)
        for size in (0, 1, 2, 3, 4, 5, 70_000, 200_001):
            body = bytes(range(256)) * (size // 256 + 1)
            assert writer.write(body[:size], source_time=net.clock() - 5)
            sent = net.clock() - 5
            net.run(SECOND)
            sample = reader.take()
            assert sample is not None
            assert sample.data == body[:size]
            assert (sample.writer_gid, sample.source_time) == (writer.gid, sent)

    @pytest.mark.parametrize("time", [-1, 0, 5, 2**62, 2**70])
    def test_boards_may_say_any_time(self, time: int) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        writer = one.space.participant("talker").writer(CHATTER, RELIABLE)
        reader = two.space.participant("listener").reader(CHATTER, RELIABLE)
        net.until(lambda: writer.matched and reader.matched)
        now = net.clock()
        assert writer.write(b"x", source_time=time)
        net.run()
        sample = reader.take()
        assert sample is not None
        assert sample.source_time == (time if time in (0, 5) else now)

    def test_a_writer_knows_when_everything_has_arrived(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        writer = one.space.participant("talker").writer(CHATTER, RELIABLE)
        reader = two.space.participant("listener").reader(CHATTER, RELIABLE)
        assert writer.acknowledged, "nobody is there"
        net.until(lambda: writer.matched and reader.matched)
        net.world.network.loss = 1.0
        writer.write(bytes(100_000))
        net.run(SECOND)
        assert not writer.acknowledged
        net.world.network.loss = 0.0
        net.until(lambda: writer.acknowledged)
        assert reader.pending == 1

    def test_who_comes_late_gets_what_is_kept(self) -> None:
        net = Net(loss=0.1)
        one, two = net.computer(), net.computer()
        writer = one.space.participant("talker").writer(CHATTER, LATCHED)
        for i in range(10):
            writer.write(numbered(i))
        net.run(SECOND)
        late = two.space.participant("late").reader(CHATTER, LATCHED)
        volatile = two.space.participant("volatile").reader(CHATTER, RELIABLE)
        net.until(lambda: late.pending == 3)
        assert take_all(late) == [numbered(i) for i in (7, 8, 9)]
        net.run(5 * SECOND)
        assert take_all(volatile) == []

    def test_a_writer_waits_for_a_full_reader_far_away(self) -> None:
        net = Net()
        one, two = (net.computer(resource_limit=16, max_blocking_time=10 * SECOND) for _ in range(2))
        writer = one.space.participant("talker").writer(CHATTER, KEEP_ALL)
        reader = two.space.participant("listener").reader(CHATTER, KEEP_ALL)
        rooms: list[int] = []
        writer.on_room = lambda: rooms.append(1)
        net.until(lambda: writer.matched and reader.matched)
        sent = 0
        while writer.write(numbered(sent)):
            sent += 1
            net.run(5 * MS)
        assert 16 <= sent <= 32
        assert not rooms
        got: list[bytes] = []
        while len(got) < sent:
            got += take_all(reader)
            net.run(50 * MS)
        assert got == [numbered(i) for i in range(sent)]
        assert rooms
        assert writer.write(b"x")
        assert (one.told, two.told) == ([], [])

    def test_what_does_not_fit_is_told_on_both_sides(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        one.space.participant("talker").writer(CHATTER, Qos(Reliability.BEST_EFFORT))
        net.run(2 * SECOND)
        two.space.participant("listener").reader(CHATTER, RELIABLE)
        net.run(2 * SECOND)
        (theirs,), (ours,) = one.told, two.told
        assert (ours.code, ours.who, ours.subject) == ("qos-mismatch", "/listener", "rt/chatter")
        assert ours.what == "/listener gets no rt/chatter from /talker"
        assert ours.why == "the reader wants reliable, the writer offers best effort"
        assert (theirs.code, theirs.who) == ("qos-mismatch", "/talker"), "it concerns us as the writer"
        assert theirs.why == ours.why
        for computer in (one, two):
            topic = computer.graph.topic("rt/chatter")
            assert topic is not None
            assert [pair.reasons for pair in topic.incompatible] == [(ours.why,)]

    def test_what_only_rtps_knows_is_told_in_its_words(self, monkeypatch: pytest.MonkeyPatch) -> None:
        net = Net()
        other = net.stranger(monkeypatch)
        other.writer(*CHATTER, EndpointQos(partitions=("kitchen",)))
        one = net.computer()
        one.space.participant("listener").reader(CHATTER, RELIABLE)
        net.run(2 * SECOND)
        (finding,) = one.told
        assert finding.code == "qos-mismatch"
        assert "kitchen" in finding.why
        assert "partition" in finding.remedy


class TestGids:
    def test_a_client_that_comes_again_is_the_same_to_all(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        got: list[tuple[bytes, int, bytes]] = []

        def take(reader: Any) -> None:
            while (sample := reader.take()) is not None:
                got.append((sample.writer_gid, sample.sequence, sample.data))

        two.space.participant("listener").reader(CHATTER, RELIABLE, take)
        gids = []
        for life in range(3):
            board = one.space.participant("board", key=b"\xba\x5e\xba\x11")
            writer = board.writer(CHATTER, RELIABLE, key=0x15)
            gids.append((board.gid, writer.gid))
            net.until(lambda writer=writer: writer.matched)  # type: ignore[misc]
            for i in range(2):
                writer.write(numbered(10 * life + i))
            net.run()
            board.close()
            net.run(30 * MS)
        assert len(set(gids)) == 1
        assert got == [
            (gids[0][1], number, numbered(value)) for number, value in enumerate((0, 1, 10, 11, 20, 21), 1)
        ]

    def test_who_comes_again_at_once_never_left_for_others(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """A departure that overtakes, or is lost, would leave peers with the old life."""
        net = Net(loss=0.2)
        other = net.stranger(monkeypatch)
        one, two = net.computer(), net.computer()
        two.space.participant("watcher")
        events = other.process.events[other.participant.prefix]
        for life in range(5):
            board = one.space.participant(f"life{life}", key=b"board", enclave=f"/{life}")
            writer = board.writer(CHATTER, RELIABLE, key=1)
            if life % 2:
                board.reader(Topic("rt/odd", "T"), key=2)
            net.until(lambda life=life: f"life{life}" in {node.name for node in two.graph.nodes})  # type: ignore[misc]
            net.until(lambda writer=writer: two.graph.endpoint(writer.gid))  # type: ignore[misc]
            net.until(lambda life=life: (two.graph.topic("rt/odd") is not None) == bool(life % 2))  # type: ignore[misc]
            board.close()
            net.until(lambda: {node.name for node in two.graph.nodes} == {"watcher"})
            net.until(lambda writer=writer: two.graph.endpoint(writer.gid) is None)  # type: ignore[misc]
        assert not [event for event in events if isinstance(event, ParticipantLost)]
        net.until(
            lambda: (
                b"enclave=/4;"
                in {
                    each.user_data for each in other.participant.participants if each.prefix == board.gid[:12]
                }
            )
        )
        net.run(5 * SECOND)
        (lost,) = (event for event in events if isinstance(event, ParticipantLost))
        assert lost.participant.prefix == board.gid[:12]
        assert lost.why is Why.LEFT

    def test_who_comes_again_may_be_no_node_any_more(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        two.space.participant("watcher")
        one.space.participant("node", key=b"k").close()
        nameless = one.space.participant("", key=b"k")
        net.run(2 * SECOND)
        assert [node.name for node in two.graph.nodes] == ["watcher"]
        nameless.close()
        again = one.space.participant("node", key=b"k")
        net.run(2 * SECOND)
        assert {node.name for node in two.graph.nodes} == {"watcher", "node"}
        assert again.gid == nameless.gid

    def test_a_space_that_closes_leaves_nobody_behind(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        two.space.participant("watcher")
        for i in range(3):
            one.space.participant(f"n{i}", key=bytes((i,)))
        one.space.participant("gone", key=b"g").close()
        net.until(lambda: len(two.graph.participants) == 5)
        one.space.close()
        net.run(50 * MS)
        assert [each.name for each in two.graph.participants] == ["watcher"]

    def test_two_spaces_never_share_what_a_key_gives(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        gids = {computer.space.participant("board", key=b"\x01\x02").gid for computer in (one, two)}
        assert len(gids) == 2
        assert one.space.participant("fixed", key=bytes(range(12))).gid[:12] == bytes(range(12))

    def test_last_numbers_are_remembered_within_bounds(self, monkeypatch: pytest.MonkeyPatch) -> None:
        from muros.space.dds import _domain

        monkeypatch.setattr(_domain, "LASTS_MOST", 3)
        net = Net()
        one = net.computer()
        for i in range(5):
            with one.space.participant("", key=b"k%d" % i) as board:
                board.writer(CHATTER, key=1).write(b"x")
        home = one.space._domains[0]  # type: ignore[attr-defined]
        assert list(home._lasts.values()) == [1, 1, 1]


class TestServices:
    @pytest.mark.parametrize("loss", [0.0, 0.1])
    def test_each_client_gets_its_own_replies(self, loss: float) -> None:
        net = Net(loss=loss)
        one, two, three = (net.computer() for _ in range(3))
        answers: dict[int, list[bytes]] = {0: [], 1: []}
        clients: list[Requester] = []
        for i, computer in enumerate((two, three)):

            def keep(number: int, data: bytes, i: int = i) -> None:
                answers[i].append(data)

            clients.append(computer.space.participant("client").requester(ADD, Qos(depth=100), keep))
        for i, client in enumerate(clients):
            client.send(b"early %d" % i)
            assert client.waiting == 1
        server = serve(one)
        net.until(lambda: all(answers.values()))
        for n in range(10):
            for i, client in enumerate(clients):
                client.send(b"%d.%d" % (i, n))
            net.run(50 * MS)
        net.until(lambda: all(len(each) == 11 for each in answers.values()))
        for i, each in answers.items():
            assert each == [2 * (b"early %d" % i), *(2 * (b"%d.%d" % (i, n)) for n in range(10))]
        assert server.clients == 2
        assert [client.servers for client in clients] == [1, 1]
        assert not one.told + two.told + three.told

    def test_a_request_without_server_is_given_up(self) -> None:
        net = Net()
        one = net.computer(request_wait=SECOND)
        client = one.space.participant("client").requester(ADD)
        assert client.send(b"?", wait=False) == 0
        assert client.send(b"?") > 0
        net.run(2 * SECOND)
        assert one.codes == ["no-server"]
        assert client.waiting == 0

    def test_a_reply_waits_for_its_reader(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Discovery may tell of the client's writer before it tells of its reader."""
        net = Net()
        other = net.stranger(monkeypatch)
        one = net.computer(request_wait=SECOND)
        asked = other.writer(ADD.request_topic, ADD.request_type)
        heard: list[bytes] = []
        serve(one, heard=heard)
        net.until(lambda: asked.matched)
        later = asked.guid[:12] + b"\x01\x00\x01\x04"  # the next entity of that participant
        asked.write(
            encapsulated(b"wait"), other.now, inline_qos=inline_qos(related=identity_of(later, -1 << 32))
        )
        net.until(lambda: heard == [b"wait"])
        net.run(500 * MS)
        replies, got = other.reader(ADD.reply_topic, ADD.reply_type)
        assert replies.guid == later
        net.run(SECOND)
        assert [received.payload[4:] for received in got] == [b"waitwait"]
        assert one.told == []

    def test_a_reply_without_reader_is_given_up(self, monkeypatch: pytest.MonkeyPatch) -> None:
        net = Net()
        other = net.stranger(monkeypatch)
        one = net.computer(request_wait=SECOND)
        asked = other.writer(ADD.request_topic, ADD.request_type)
        heard: list[bytes] = []
        serve(one, heard=heard)
        net.until(lambda: asked.matched)
        reader = asked.guid[:12] + b"\x00\x77\x77\x04"
        related = inline_qos(related=identity_of(reader, -1 << 32))
        asked.write(encapsulated(b"x"), other.now, inline_qos=related)
        net.until(lambda: heard)
        net.run(2 * SECOND)
        assert one.codes == ["reply-unmatched"]

    def test_a_server_that_vanishes_is_no_server(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        serve(one)
        client = two.space.participant("client").requester(ADD)
        net.until(lambda: client.servers == 1)
        one.vanish()
        net.until(lambda: client.servers == 0)
        assert client.send(b"?", wait=False) == 0

    def test_two_servers_are_told(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        answers: list[bytes] = []
        client = two.space.participant("client").requester(
            ADD, None, lambda number, data: answers.append(data)
        )
        serve(one, "first")
        net.until(lambda: client.servers == 1)
        serve(one, "second")
        net.until(lambda: client.servers == 2)
        client.send(b"x")
        net.run()
        assert answers == [b"xx", b"xx"]
        assert two.codes == ["several-servers"]

    def test_who_merely_listens_is_neither_server_nor_client(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        ear = one.space.participant("ear")
        for topic in (
            Topic(ADD.request_topic, ADD.request_type),
            Topic(ADD.reply_topic, ADD.reply_type),
        ):
            ear.reader(topic, RELIABLE)
        client = two.space.participant("client").requester(ADD)
        net.run(SECOND)
        assert client.servers == 0
        service = two.graph.service("/add_two_ints")
        assert service is not None
        assert (service.servers, len(service.clients)) == ((), 1)
        ours = one.graph.service("/add_two_ints")
        assert ours is not None
        assert [each.gid for each in ours.clients] == [each.gid for each in service.clients] == [client.gid]

    def test_a_server_that_keeps_all_loses_no_reply(self) -> None:
        """A writer that is full puts replies off until there is room."""
        net = Net()
        one, two = (net.computer(resource_limit=8, max_blocking_time=20 * SECOND) for _ in range(2))
        made: list[Replier] = []
        made.append(one.space.participant("server").replier(ADD, KEEP_ALL, echo(made)))
        client = two.space.participant("client").requester(ADD, KEEP_ALL)
        net.until(lambda: client.servers == 1)
        answers: list[bytes] = []
        for i in range(20):
            client.send(numbered(i))
            net.run(20 * MS)
        for _ in range(20):
            net.run(100 * MS)
            while (reply := client.take()) is not None:
                answers.append(reply.data)
        assert sorted(answers) == sorted(numbered(i) * 2 for i in range(20))


class _CycloneServer:
    """Answers as rmw_cyclonedds does: the first 16 bytes of the request stand before the reply, for all to hear."""

    def __init__(self, stranger: Stranger) -> None:
        self.heard: list[bytes] = []
        self.writer = stranger.writer(ADD.reply_topic, ADD.reply_type)
        self._stranger = stranger
        stranger.process.reader(
            stranger.participant, ADD.request_topic, type_name=ADD.request_type, on_sample=self._asked
        )

    def _asked(self, received: Any) -> None:
        head, body = received.payload[4:20], received.payload[20:]
        self.heard.append(body)
        self.writer.write(encapsulated(head + body + body), self._stranger.now)


class TestDialects:
    """rmw_cyclonedds beside those who speak like rmw_fastrtps."""

    def test_our_server_answers_both_at_once(self, monkeypatch: pytest.MonkeyPatch) -> None:
        net = Net()
        cyclone = net.stranger(monkeypatch, CYCLONE)
        fast = net.stranger(monkeypatch)
        one, two = net.computer(), net.computer()
        heard: list[bytes] = []
        server = serve(one, heard=heard)
        answers: list[bytes] = []
        ours = two.space.participant("client").requester(ADD, None, lambda number, data: answers.append(data))
        asked_c = cyclone.writer(ADD.request_topic, ADD.request_type)
        _, got_c = cyclone.reader(ADD.reply_topic, ADD.reply_type)
        asked_f = fast.writer(ADD.request_topic, ADD.request_type)
        reader_f, got_f = fast.reader(ADD.reply_topic, ADD.reply_type)
        net.until(lambda: server.clients == 3 and ours.servers == 1)
        head = struct.pack("<Qq", 0x1122334455667788, 41)
        asked_c.write(encapsulated(head + b"cyclone."), cyclone.now)
        asked_f.write(
            encapsulated(b"fast"),
            fast.now,
            inline_qos=inline_qos(related=identity_of(reader_f.guid, -1 << 32)),
        )
        ours.send(b"ours")
        net.until(lambda: got_c and got_f and answers)
        net.run(SECOND)
        assert sorted(heard) == [b"cyclone.", b"fast", b"ours"]
        assert [received.payload[4:] for received in got_c] == [head + b"cyclone.cyclone."]
        (reply,) = got_f
        assert reply.payload[4:] == b"fastfast"
        assert reply.inline_qos is not None
        for pid in (0x0083, 0x800F):
            assert reply.inline_qos[pid] == [identity_of(reader_f.guid, 1)]
        assert answers == [b"oursours"]
        assert one.told + two.told == []

    def test_our_client_asks_both_at_once(self, monkeypatch: pytest.MonkeyPatch) -> None:
        net = Net()
        cyclone = _CycloneServer(net.stranger(monkeypatch, CYCLONE))
        one, two = net.computer(), net.computer()
        heard: list[bytes] = []
        serve(one, heard=heard)
        answers: list[tuple[int, bytes]] = []
        client = two.space.participant("client").requester(
            ADD, None, lambda number, data: answers.append((number, data))
        )
        listener = one.space.participant("ear").reader(Topic(ADD.request_topic, ADD.request_type), RELIABLE)
        net.until(lambda: client.servers == 2 and listener.matched)
        net.run()
        numbers = [client.send(b"%04d" % n) for n in range(5)]
        net.until(lambda: len(answers) == 10)
        assert sorted(answers) == sorted(
            (number, 2 * (b"%04d" % n)) for n, number in enumerate(numbers) for _ in range(2)
        )
        assert heard == cyclone.heard == [b"%04d" % n for n in range(5)]
        assert take_all(listener) == heard
        assert two.codes == ["several-servers"]

    def test_our_client_asks_cyclone_alone(self, monkeypatch: pytest.MonkeyPatch) -> None:
        net = Net()
        cyclone = _CycloneServer(net.stranger(monkeypatch, CYCLONE))
        two = net.computer()
        answers: list[tuple[int, bytes]] = []
        a, b = (
            two.space.participant(f"client{i}").requester(
                ADD,
                None,
                lambda number, data, i=i: answers.append((i, data)),  # type: ignore[misc]
            )
            for i in range(2)
        )
        a.send(b"wait")
        net.until(lambda: a.servers == b.servers == 1)
        b.send(b"b...")
        net.until(lambda: len(answers) == 2)
        net.run(SECOND)
        assert sorted(answers) == [(0, b"waitwait"), (1, b"b...b...")], "each its own, none twice"
        assert sorted(cyclone.heard) == [b"b...", b"wait"]

    def test_a_request_waits_until_cyclone_hears_us(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Its readers skip what was written before the first HEARTBEAT they hear: nothing may be written by then."""
        net = Net()
        two = net.computer()
        answers: list[bytes] = []
        client = two.space.participant("client").requester(
            ADD, None, lambda number, data: answers.append(data)
        )
        client.send(b"wait")
        net.run(2 * SECOND)
        muted = True
        entity = int.from_bytes(client.gid[12:], "big")

        def mute(datagram: Datagram) -> bool:
            """The server's reader says nothing yet."""
            said = parse_untrusted(datagram.data).submessages
            return not (muted and any(isinstance(each, AckNack) and each.writer == entity for each in said))

        net.world.network.tap = mute
        server = _CycloneServer(net.stranger(monkeypatch, CYCLONE))
        out = client.writer.out  # type: ignore[attr-defined]
        net.until(lambda: out.matched)
        net.run(100 * MS)
        assert (client.servers, client.waiting, out.last) == (0, 1, 0)
        muted = False
        net.until(lambda: answers)
        assert (answers, server.heard) == ([b"waitwait"], [b"wait"])

    def test_a_cyclone_that_never_speaks_is_asked_all_the_same(self, monkeypatch: pytest.MonkeyPatch) -> None:
        net = Net()
        two = net.computer()
        client = two.space.participant("client").requester(ADD)
        client.send(b"wait")
        entity = int.from_bytes(client.gid[12:], "big")

        def mute(datagram: Datagram) -> bool:
            said = parse_untrusted(datagram.data).submessages
            return not any(isinstance(each, AckNack) and each.writer == entity for each in said)

        net.world.network.tap = mute
        server = _CycloneServer(net.stranger(monkeypatch, CYCLONE))
        net.until(lambda: server.heard, 2 * SECOND)

    def test_a_request_too_short_for_its_header_is_taken_as_it_is(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        net = Net()
        cyclone = net.stranger(monkeypatch, CYCLONE)
        one = net.computer()
        asked = cyclone.writer(ADD.request_topic, ADD.request_type)
        cyclone.reader(ADD.reply_topic, ADD.reply_type)
        server = one.space.participant("server").replier(ADD)
        net.until(lambda: server.clients == 1 and asked.matched)
        asked.write(encapsulated(b"8 bytes."), cyclone.now)
        net.run()
        request = server.take()
        assert request is not None
        assert request.data == b"8 bytes."
        assert server.reply(request.identity, b"whatever")


class TestGraph:
    def test_nodes_of_others_are_seen_with_what_they_have(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        talker = one.space.participant("talker", namespace="/lab/a", enclave="/secret")
        writer, reader = talker.writer(CHATTER, RELIABLE), talker.reader(Topic("rt/x", "T"), LATCHED)
        talker.replier(ADD)
        two.space.participant("watcher")
        net.until(lambda: len(two.graph.nodes) == 2 and two.graph.service("/add_two_ints"))
        (info,) = (node for node in two.graph.nodes if node.name == "talker")
        assert (info.full_name, info.enclave, info.gid) == ("/lab/a/talker", "/secret", talker.gid)
        assert info.vendor.startswith("muros ")
        assert info.host
        assert info.pid
        seen = two.graph.endpoint(writer.gid)
        assert seen is not None
        assert (seen.role, seen.topic, seen.type_name, seen.qos) == (Role.WRITER, *CHATTER, RELIABLE)
        assert seen.type_hash.startswith("RIHS01_df668c74")
        assert seen.participant == info
        other = two.graph.endpoint(reader.gid)
        assert other is not None
        assert (other.qos, other.type_hash) == (LATCHED, "")
        service = two.graph.service("/add_two_ints")
        assert service is not None
        assert [server.participant for server in service.servers] == [info]

    def test_what_closes_is_withdrawn_and_who_vanishes_is_forgotten(self) -> None:
        net = Net()
        one, two, three = (net.computer() for _ in range(3))
        watched: list[Any] = []
        for i, computer in enumerate((one, two)):
            node = computer.space.participant(f"node{i}")
            node.writer(CHATTER, RELIABLE)
        reader = three.space.participant("reader").reader(CHATTER, RELIABLE)
        net.until(lambda: len(reader.matched) == 2 and len(three.graph.nodes) == 3)
        three.graph.watch(watched.append)
        one.space.close()
        net.run()
        assert [node.name for node in three.graph.nodes] == ["reader", "node1"]
        assert len(reader.matched) == 1
        ended = [event for event in watched if isinstance(event, Unmatched)]
        assert [event.writer.participant.name for event in ended] == ["node0"]
        two.vanish()
        net.run(10 * SECOND)
        assert len(reader.matched) == 1, "its lease is not over"
        net.run(15 * SECOND)
        assert [node.name for node in three.graph.nodes] == ["reader"]
        assert not reader.matched
        topic = three.graph.topic("rt/chatter")
        assert topic is not None
        assert not topic.writers
        gone = [event.what for event in watched if isinstance(event, Vanished)]
        assert sorted(getattr(each, "name", "") for each in gone if hasattr(each, "name")) == [
            "node0",
            "node1",
        ]

    def test_whose_an_endpoint_is_may_be_told_later_than_the_endpoint(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        talker = one.space.participant("talker")
        two.space.participant("onlooker")
        net.until(lambda: any(node.name == "talker" for node in two.graph.nodes))
        watched: list[Any] = []
        two.graph.watch(watched.append)
        writer = talker.writer(CHATTER, RELIABLE)
        net.until(lambda: any(isinstance(event, Assigned) for event in watched))
        assert [(type(event), event.what.gid, event.what.participant.name) for event in watched] == [
            (Appeared, writer.gid, ""),
            (Assigned, writer.gid, "talker"),
        ]
        net.run(5 * SECOND)
        assert len(watched) == 2, "said again, it is no news"

    def test_the_books_pass_to_the_next_when_the_first_goes(self) -> None:
        net = Net()
        one, two = net.computer(), net.computer()
        far = one.space.participant("far")
        far.writer(CHATTER, RELIABLE)
        first, second = two.space.participant("first"), two.space.participant("second")
        second.reader(CHATTER, RELIABLE)
        net.until(lambda: any(node.name == "far" for node in two.graph.nodes))
        net.run(SECOND)
        before = {node.name for node in two.graph.nodes}, two.graph.topic("rt/chatter")
        watched: list[Any] = []
        two.graph.watch(watched.append)
        first.close()
        net.run(SECOND)
        assert {node.name for node in two.graph.nodes} == before[0] - {"first"}
        assert two.graph.topic("rt/chatter") == before[1]
        assert [(type(event), event.what.name) for event in watched] == [(Vanished, "first")]
        far.close()
        net.run()
        assert {node.name for node in two.graph.nodes} == {"second"}
        second.close()
        assert two.graph.participants == ()

    def test_several_nodes_of_one_participant(self, monkeypatch: pytest.MonkeyPatch) -> None:
        net = Net()
        other = net.stranger(monkeypatch)
        one = net.computer()
        one.space.participant("watcher")
        told = other.writer(*INFO_TOPIC, LATCHED_WIRE)
        writers = [other.writer("rt/chatter", CHATTER.type_name) for _ in range(2)]
        net.run(2 * SECOND)
        (bare,) = (each for each in one.graph.participants if not each.name)
        assert (bare.vendor, bare.gid) == ("Fast DDS", other.participant.guid)
        nodes = tuple(NodeEntities("/", f"n{i}", (), (writer.guid,)) for i, writer in enumerate(writers))
        told.write(encapsulated(DiscoveryInfo(other.participant.guid, nodes).body()), other.now)
        net.run()
        assert [node.name for node in one.graph.nodes] == ["watcher", "n0", "n1"]
        assert all(each.name for each in one.graph.participants)
        topic = one.graph.topic("rt/chatter")
        assert topic is not None
        assert [writer.participant.name for writer in topic.writers] == ["n0", "n1"]
        told.write(encapsulated(DiscoveryInfo(other.participant.guid, ()).body()), other.now)
        net.run()
        assert bare in one.graph.participants

    def test_what_is_no_discovery_info_is_told_and_harms_nobody(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        net = Net()
        other = net.stranger(monkeypatch)
        one = net.computer()
        one.space.participant("watcher")
        told = other.writer(*INFO_TOPIC, LATCHED_WIRE)
        net.until(lambda: told.matched)
        for junk in (b"", b"\0\1\0\0", encapsulated(b"\xff" * 40)):
            told.write(junk, other.now)
            net.run()
        assert set(one.codes) == {"discovery-info-unreadable"}
        assert [node.name for node in one.graph.nodes] == ["watcher"]


class TestDistros:
    """Gids of 16 and of 24 bytes."""

    @staticmethod
    def heard(other: Stranger) -> list[bytes]:
        """What the stranger hears of nodes; the list grows."""
        bodies: list[bytes] = []

        def hear(received: Any) -> None:
            if received.writer[:12] != other.participant.prefix:
                bodies.append(received.payload[4:])

        other.process.reader(
            other.participant,
            INFO_TOPIC.name,
            LATCHED_WIRE,
            type_name=INFO_TOPIC.type_name,
            on_sample=hear,
        )
        return bodies

    @pytest.mark.parametrize(("distro", "size"), [(None, 16), ("jazzy", 16), ("humble", 24)])
    def test_the_distro_decides(self, distro: str | None, size: int, monkeypatch: pytest.MonkeyPatch) -> None:
        net = Net()
        other = net.stranger(monkeypatch)
        bodies = self.heard(other)
        one = net.computer(ros_distro=distro)
        node = one.space.participant("node", namespace="/ns")
        writer = node.writer(CHATTER)
        net.until(lambda: bodies)
        net.run()
        info, seen = DiscoveryInfo.parse_untrusted(bodies[-1])
        assert seen == size
        assert info == (node.gid, (NodeEntities("/ns", "node", (), (writer.gid,)),))

    @pytest.mark.parametrize("distro", [None, "jazzy"])
    def test_else_the_first_node_seen(self, distro: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
        net = Net()
        humble = net.stranger(monkeypatch)
        bodies = self.heard(humble)
        told = humble.writer(*INFO_TOPIC, LATCHED_WIRE)
        one = net.computer(ros_distro=distro)
        one.space.participant("node")
        net.until(lambda: bodies)
        info = DiscoveryInfo(humble.participant.guid, (NodeEntities("/", "old", (), ()),))
        told.write(encapsulated(info.body(24)), humble.now)
        net.run()
        assert [node.name for node in one.graph.nodes] == ["node", "old"]
        assert DiscoveryInfo.parse_untrusted(bodies[-1])[1] == (16 if distro else 24)
        assert one.told == []
        told.write(encapsulated(info.body(16)), humble.now)
        net.run()
        assert one.codes == ["mixed-distros"]


def test_changes_of_a_node_are_gathered(monkeypatch: pytest.MonkeyPatch) -> None:
    net = Net()
    other = net.stranger(monkeypatch)
    bodies = TestDistros.heard(other)
    one = net.computer()
    node = one.space.participant("node")
    net.until(lambda: bodies)
    net.run()
    bodies.clear()
    for i in range(50):
        node.writer(Topic(f"rt/t{i}", "T"))
    net.run()
    assert len(bodies) == 1
    assert len(DiscoveryInfo.parse_untrusted(bodies[0])[0].nodes[0].writers) == 50


def test_appearing_is_told_once_for_each() -> None:
    net = Net()
    one, two = net.computer(), net.computer()
    watched: list[Any] = []
    two.graph.watch(watched.append)
    two.space.participant("watcher")
    writer = one.space.participant("talker").writer(CHATTER)
    net.run(5 * SECOND)
    appeared = [event.what for event in watched if isinstance(event, Appeared)]
    gids = [each.gid for each in appeared]
    assert gids.count(writer.gid) == 1
    assert [each.name for each in appeared if isinstance(each, ParticipantInfo)] in (
        ["watcher", "", "talker"],
        ["watcher", "talker"],
    )


def test_identities_of_requests_are_those_of_the_door() -> None:
    net = Net()
    one, two = net.computer(), net.computer()
    server = one.space.participant("server").replier(ADD)
    client = two.space.participant("client").requester(ADD)
    net.until(lambda: client.servers == 1 and server.clients == 1)
    number = client.send(b"?")
    net.run()
    request = server.take()
    assert request is not None
    assert split_identity(request.identity) == (client.gid, number)
