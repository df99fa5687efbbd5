"""What every engine of the data space does, as one test class.

An engine's test module subclasses `SpaceConformance` and says how to open a space, how to let time pass and how
to let the engine finish what it is doing. The tests read no clock; time is what `pass_time` makes of it.
"""

from collections.abc import Iterator
from functools import partial

import pytest

from muros.findings import Finding
from muros.space import (
    CDR_BE,
    CDR_LE,
    Appeared,
    Assigned,
    ClosedError,
    Durability,
    Endpoint,
    GraphEvent,
    History,
    Incompatible,
    Matched,
    ParticipantInfo,
    Qos,
    Reader,
    Reliability,
    Replier,
    Requester,
    Role,
    Service,
    Space,
    Topic,
    Unmatched,
    Vanished,
    identity_of,
)

MS = 1_000_000
SECOND = 1000 * MS

CHATTER = Topic("rt/chatter", "std_msgs::msg::dds_::String_")
ADD = Service(
    "/add_two_ints",
    "rq/add_two_intsRequest",
    "rr/add_two_intsReply",
    "example_interfaces::srv::dds_::AddTwoInts_Request_",
    "example_interfaces::srv::dds_::AddTwoInts_Response_",
)

RELIABLE = Qos(depth=10)
BEST_EFFORT = Qos(Reliability.BEST_EFFORT, depth=10)
KEEP_ALL = Qos(history=History.KEEP_ALL)
LATCHED = Qos(durability=Durability.TRANSIENT_LOCAL, depth=3)


def numbered(n: int) -> bytes:
    """The body of sample `n` of a test."""
    return n.to_bytes(4, "little")


def take_all(reader: Reader) -> list[bytes]:
    """The bodies of everything a reader has."""
    bodies = []
    while (sample := reader.take()) is not None:
        bodies.append(sample.data)
    return bodies


class Clock:
    """Time that passes when told to."""

    def __init__(self) -> None:
        self.now = 1_795_304_203 * SECOND

    def __call__(self) -> int:
        return self.now


class SpaceConformance:
    """The contract of `muros.space`. Subclasses make the engine."""

    LIMIT = 16
    """Samples that a keep-all reader of `space` holds."""
    PATIENCE = 100 * MS
    """Longest time a writer of `space` is refused."""
    REQUEST_WAIT = 5 * SECOND
    """How long a request waits for a server in `space`."""
    ON_THE_WAY = 0
    """Samples that are under way to a keep-all reader which is full, before its writer is refused."""
    TYPE_HASH = ""
    """What the engine knows as the hash of `CHATTER`'s type."""

    def open_space(self) -> Space:
        """A new space with the limits above and virtual time."""
        raise NotImplementedError

    def settle(self, space: Space) -> None:
        """Let the engine do what it has to do now."""
        raise NotImplementedError

    def pass_time(self, space: Space, ns: int) -> None:
        """Let `ns` pass, the engine doing what becomes due."""
        raise NotImplementedError

    def heard_identity(self, requester: Requester, number: int) -> bytes:
        """What a reply says on its topic of the request it answers."""
        return identity_of(requester.gid, number)

    def take_everything(self, space: Space, reader: Reader) -> list[bytes]:
        """The bodies of what a reader has, and of what was under way because it was full."""
        bodies: list[bytes] = []
        while taken := take_all(reader):
            bodies += taken
            self.settle(space)
        return bodies

    @pytest.fixture
    def space(self) -> Iterator[Space]:
        with self.open_space() as space:
            yield space

    @pytest.fixture
    def told(self, space: Space) -> list[Finding]:
        """Findings the space tells of."""
        told: list[Finding] = []
        space.findings.on_finding(told.append)
        return told

    @pytest.fixture
    def events(self, space: Space) -> list[GraphEvent]:
        """Changes of the graph."""
        events: list[GraphEvent] = []
        space.graph.watch(events.append)
        return events

    # Topics

    def test_a_sample_goes_to_every_matched_reader_untouched(self, space: Space) -> None:
        writer = space.participant("talker").writer(CHATTER, RELIABLE)
        one = space.participant("one").reader(CHATTER, RELIABLE)
        two = space.participant("two").reader(CHATTER, BEST_EFFORT)
        other = space.participant("three").reader(Topic("rt/other", CHATTER.type_name), RELIABLE)
        self.settle(space)
        body = b"\x06\x00\x00\x00hello\x00\xff"
        assert writer.write(body)
        self.settle(space)
        for reader in (one, two):
            assert reader.pending == 1
            sample = reader.take()
            assert sample is not None
            assert sample.data == body
            assert sample.representation == CDR_LE
            assert sample.writer_gid == writer.gid
            assert sample.sequence == 1
            assert sample.related is None
            assert sample.source_time == space.clock()
            assert reader.take() is None
        assert writer.acknowledged
        assert other.take() is None

    def test_what_the_writer_says_of_a_sample_arrives(self, space: Space) -> None:
        writer = space.participant("talker").writer(CHATTER, RELIABLE)
        reader = space.participant("listener").reader(CHATTER, RELIABLE)
        self.settle(space)
        related = identity_of(bytes(range(16)), 5 << 32 | 7)
        writer.write(b"\0\0\0\1", source_time=123, related=related, representation=CDR_BE)
        self.settle(space)
        sample = reader.take()
        assert sample is not None
        assert (sample.source_time, sample.related, sample.representation) == (123, related, CDR_BE)

    def test_order_of_each_writer_is_kept(self, space: Space) -> None:
        talker = space.participant("talker")
        first, second = talker.writer(CHATTER, KEEP_ALL), talker.writer(CHATTER, KEEP_ALL)
        reader = space.participant("listener").reader(CHATTER, KEEP_ALL)
        self.settle(space)
        for i in range(self.LIMIT // 2):
            first.write(numbered(i))
            second.write(numbered(i))
        self.settle(space)
        taken: dict[bytes, list[tuple[int, bytes]]] = {first.gid: [], second.gid: []}
        while (sample := reader.take()) is not None:
            taken[sample.writer_gid].append((sample.sequence, sample.data))
        wanted = [(i + 1, numbered(i)) for i in range(self.LIMIT // 2)]
        assert taken == {first.gid: wanted, second.gid: wanted}

    def test_a_participant_hears_itself(self, space: Space) -> None:
        node = space.participant("node")
        writer, reader = node.writer(CHATTER, RELIABLE), node.reader(CHATTER, RELIABLE)
        self.settle(space)
        writer.write(b"x")
        self.settle(space)
        assert take_all(reader) == [b"x"]

    def test_domains_are_separate_worlds(self, space: Space) -> None:
        writer = space.participant("talker", domain=1).writer(CHATTER, RELIABLE)
        reader = space.participant("listener", domain=2).reader(CHATTER, RELIABLE)
        same = space.participant("listener", domain=1).reader(CHATTER, RELIABLE)
        self.settle(space)
        writer.write(b"x")
        self.settle(space)
        assert take_all(reader) == []
        assert take_all(same) == [b"x"]
        assert writer.matched == (same.gid,)
        assert reader.matched == ()

    def test_defaults_are_those_of_dds(self, space: Space) -> None:
        node = space.participant("node")
        assert node.writer(CHATTER).qos == Qos(Reliability.RELIABLE, Durability.VOLATILE, depth=1)
        assert node.reader(CHATTER).qos == Qos(Reliability.BEST_EFFORT, Durability.VOLATILE, depth=1)
        assert node.requester(ADD).qos == Qos.preset("services_default")
        assert node.replier(ADD).qos == Qos.preset("services_default")

    # Callbacks

    def test_on_data_comes_once_until_the_reader_was_empty(self, space: Space) -> None:
        calls: list[Reader] = []
        writer = space.participant("talker").writer(CHATTER, RELIABLE)
        reader = space.participant("listener").reader(CHATTER, RELIABLE, calls.append)
        self.settle(space)
        for i in range(3):
            writer.write(numbered(i))
            self.settle(space)
        assert calls == [reader]
        reader.take()
        writer.write(numbered(3))
        self.settle(space)
        assert calls == [reader], "it was not empty"
        assert take_all(reader) == [numbered(1), numbered(2), numbered(3)]
        writer.write(numbered(4))
        self.settle(space)
        assert calls == [reader, reader]

    def test_overwriting_is_no_news(self, space: Space) -> None:
        calls: list[Reader] = []
        writer = space.participant("talker").writer(CHATTER, RELIABLE)
        reader = space.participant("listener").reader(CHATTER, Qos(depth=1), calls.append)
        self.settle(space)
        for i in range(3):
            writer.write(numbered(i))
            self.settle(space)
        assert calls == [reader]
        assert take_all(reader) == [numbered(2)]

    def test_a_callback_that_raises_is_a_finding_and_harms_nobody(
        self, space: Space, told: list[Finding]
    ) -> None:
        got: list[bytes] = []

        def broken(reader: Reader) -> None:
            reader.take()
            raise ZeroDivisionError("speed")

        writer = space.participant("talker").writer(CHATTER, RELIABLE)
        space.participant("bad").reader(CHATTER, RELIABLE, broken)
        space.participant("good").reader(CHATTER, RELIABLE, lambda reader: got.extend(take_all(reader)))
        self.settle(space)
        for i in range(3):
            assert writer.write(numbered(i))
            self.settle(space)
        assert got == [numbered(i) for i in range(3)]
        (finding,) = told
        assert (finding.code, finding.who) == ("callback-failed", "/bad")
        assert "ZeroDivisionError: speed" in finding.why
        assert "conformance.py:" in finding.why
        assert space.findings.counts() == {"callback-failed": 3}

    @pytest.mark.parametrize("qos", [RELIABLE, KEEP_ALL], ids=str)
    def test_ping_pong_takes_turns(self, space: Space, qos: Qos) -> None:
        """Two nodes that answer each other: no recursion, everything in order."""
        rounds, depth, deepest = 5000, 0, 0
        ping, pong = Topic("rt/ping", "T"), Topic("rt/pong", "T")
        a, b = space.participant("a"), space.participant("b")
        to_b, to_a = a.writer(ping, qos), b.writer(pong, qos)
        heard: list[int] = []

        def answer(reader: Reader) -> None:
            nonlocal depth, deepest
            depth += 1
            deepest = max(deepest, depth)
            while (sample := reader.take()) is not None:
                n = int.from_bytes(sample.data, "little")
                heard.append(n)
                if n < rounds:
                    (to_a if reader is at_b else to_b).write(numbered(n + 1))
            depth -= 1

        at_b = b.reader(ping, qos, answer)
        a.reader(pong, qos, answer)
        self.settle(space)
        to_b.write(numbered(0))
        self.settle(space)
        assert heard == list(range(rounds + 1))
        assert deepest == 1

    def test_writing_to_oneself_in_the_callback(self, space: Space) -> None:
        node = space.participant("node")
        writer = node.writer(CHATTER, KEEP_ALL)
        heard: list[bytes] = []

        def again(reader: Reader) -> None:
            while (sample := reader.take()) is not None:
                heard.append(sample.data)
                if len(heard) < 50:
                    assert writer.write(numbered(len(heard)))

        node.reader(CHATTER, KEEP_ALL, again)
        self.settle(space)
        writer.write(numbered(0))
        self.settle(space)
        assert heard == [numbered(i) for i in range(50)]

    def test_entities_may_come_and_go_in_callbacks(self, space: Space) -> None:
        """Everything a callback can do to the entities of the delivery that goes on."""
        node = space.participant("node")
        writer = node.writer(CHATTER, RELIABLE)
        late: list[Reader] = []

        def closes_itself(reader: Reader) -> None:
            assert take_all(reader)
            reader.close()
            assert reader.take() is None

        def closes_the_next(reader: Reader) -> None:
            take_all(reader)
            victim.close()

        def makes_another(reader: Reader) -> None:
            take_all(reader)
            late.append(node.reader(CHATTER, RELIABLE))

        def victim_called(reader: Reader) -> None:
            pytest.fail("called after it was closed")

        node.reader(CHATTER, RELIABLE, closes_itself)
        node.reader(CHATTER, RELIABLE, closes_the_next)
        node.reader(CHATTER, RELIABLE, makes_another)
        victim = node.reader(CHATTER, RELIABLE, victim_called)
        self.settle(space)
        assert writer.write(b"1")
        self.settle(space)
        assert len(writer.matched) == 3
        assert len(late) == 1
        assert take_all(late[0]) == [], "it came after the sample"

        def closes_everything(reader: Reader) -> None:
            take_all(reader)
            node.close()

        space.participant("end").reader(CHATTER, RELIABLE, closes_everything)
        self.settle(space)
        writer.write(b"2")
        self.settle(space)
        assert writer.closed
        assert all(reader.closed for reader in late)

    # Quality of service

    @pytest.mark.parametrize(
        ("offered", "wanted", "why"),
        [
            (
                Qos(Reliability.BEST_EFFORT),
                Qos(Reliability.RELIABLE),
                "the reader wants reliable, the writer offers best effort",
            ),
            (
                Qos(),
                Qos(durability=Durability.TRANSIENT_LOCAL),
                "the reader wants transient local, the writer offers volatile",
            ),
            (
                Qos(),
                Qos(deadline=100 * MS),
                "the reader wants a deadline of 100 ms, the writer offers no deadline",
            ),
            (
                Qos(Reliability.BEST_EFFORT, deadline=101 * MS),
                Qos(Reliability.RELIABLE, deadline=100 * MS),
                "the reader wants reliable, the writer offers best effort; "
                "the reader wants a deadline of 100 ms, the writer offers a deadline of 101 ms",
            ),
        ],
    )
    def test_what_does_not_fit_is_a_finding_and_in_the_graph(
        self,
        space: Space,
        told: list[Finding],
        events: list[GraphEvent],
        offered: Qos,
        wanted: Qos,
        why: str,
    ) -> None:
        writer = space.participant("talker").writer(CHATTER, offered)
        reader = space.participant("listener").reader(CHATTER, wanted)
        self.settle(space)
        writer.write(b"x")
        self.settle(space)
        assert reader.take() is None
        assert (writer.matched, reader.matched) == ((), ())
        (finding,) = told
        assert (finding.code, finding.who, finding.subject) == ("qos-mismatch", "/listener", "rt/chatter")
        assert "/talker" in finding.what
        assert finding.why == why
        assert finding.remedy
        topic = space.graph.topic("rt/chatter")
        assert topic is not None
        assert topic.matches == ()
        (pair,) = topic.incompatible
        assert (pair.writer.gid, pair.reader.gid) == (writer.gid, reader.gid)
        assert pair in events

    @pytest.mark.parametrize(
        ("offered", "wanted"),
        [
            (Qos(Reliability.RELIABLE), Qos(Reliability.BEST_EFFORT)),
            (Qos(durability=Durability.TRANSIENT_LOCAL), Qos()),
            (Qos(deadline=100 * MS), Qos(deadline=100 * MS)),
            (Qos(deadline=50 * MS), Qos(deadline=100 * MS)),
            (Qos(deadline=50 * MS), Qos()),
            (Qos(history=History.KEEP_ALL), Qos(depth=3)),
            (Qos(lifespan=SECOND), Qos()),
        ],
    )
    def test_offering_more_fits(self, space: Space, told: list[Finding], offered: Qos, wanted: Qos) -> None:
        writer = space.participant("talker").writer(CHATTER, offered)
        reader = space.participant("listener").reader(CHATTER, wanted)
        self.settle(space)
        writer.write(b"x")
        self.settle(space)
        assert take_all(reader) == [b"x"]
        assert told == []

    def test_different_types_do_not_meet(self, space: Space, told: list[Finding]) -> None:
        writer = space.participant("talker").writer(Topic("rt/x", "A"), RELIABLE)
        reader = space.participant("listener").reader(Topic("rt/x", "B"), RELIABLE)
        self.settle(space)
        writer.write(b"x")
        self.settle(space)
        assert reader.take() is None
        (finding,) = told
        assert finding.code == "type-mismatch"
        assert finding.why == "the reader wants type B, the writer offers type A"
        topic = space.graph.topic("rt/x")
        assert topic is not None
        assert sorted(topic.types) == ["A", "B"]
        assert len(topic.incompatible) == 1

    def test_keep_last_overwrites_the_oldest_and_says_so(self, space: Space, told: list[Finding]) -> None:
        writer = space.participant("talker").writer(CHATTER, RELIABLE)
        reader = space.participant("listener").reader(CHATTER, Qos(depth=4))
        quick = space.participant("quick").reader(CHATTER, RELIABLE)
        self.settle(space)
        for i in range(10):
            assert writer.write(numbered(i)), "keep last never makes a writer wait"
        self.settle(space)
        assert take_all(reader) == [numbered(i) for i in range(6, 10)]
        assert take_all(quick) == [numbered(i) for i in range(10)]
        assert reader.lost == 6
        (finding,) = told
        assert (finding.code, finding.who, finding.subject) == ("reader-too-slow", "/listener", "rt/chatter")
        assert space.findings.counts() == {"reader-too-slow": 6}

    def test_keep_all_makes_the_writer_wait_and_loses_nothing(
        self, space: Space, told: list[Finding]
    ) -> None:
        writer = space.participant("talker").writer(CHATTER, KEEP_ALL)
        reader = space.participant("listener").reader(CHATTER, KEEP_ALL)
        rooms: list[int] = []
        writer.on_room = lambda: rooms.append(1)
        self.settle(space)
        sent = 0
        while writer.write(numbered(sent)):
            sent += 1
            self.settle(space)
            assert sent <= 2 * self.LIMIT
        assert sent >= self.LIMIT
        assert not writer.write(numbered(sent))
        assert writer.refused == 2
        self.settle(space)
        assert rooms == []
        first = reader.take()
        assert first is not None
        self.settle(space)
        assert len(rooms) == 1
        assert writer.write(numbered(sent))
        self.settle(space)
        assert self.take_everything(space, reader) == [numbered(i) for i in range(1, sent + 1)]
        assert (reader.lost, told) == (0, [])

    def test_patience_begins_anew_after_room(self, space: Space) -> None:
        writer = space.participant("talker").writer(CHATTER, KEEP_ALL)
        reader = space.participant("listener").reader(CHATTER, KEEP_ALL)
        self.settle(space)
        while writer.write(b"x"):
            self.settle(space)
        for _ in range(3):
            assert reader.take() is not None
            self.settle(space)
            assert writer.write(b"x")
            self.pass_time(space, 2 * self.PATIENCE)
            assert not writer.write(b"x"), "full again, for no time yet"
        assert reader.lost == 0

    def test_a_stuck_reader_holds_up_others_only_for_a_while(self, space: Space, told: list[Finding]) -> None:
        writer = space.participant("talker").writer(CHATTER, KEEP_ALL)
        stuck = space.participant("stuck").reader(CHATTER, KEEP_ALL)
        quick = space.participant("quick").reader(CHATTER, KEEP_ALL)
        got: list[bytes] = []
        sent = refused = 0

        def send() -> None:
            nonlocal sent, refused
            if writer.write(numbered(sent)):
                sent += 1
            else:
                refused += 1

        writer.on_room = send
        self.settle(space)
        for _ in range(self.LIMIT + 1):
            send()
            self.settle(space)
            got += take_all(quick)
        assert (sent, refused) == (self.LIMIT, 1)
        self.pass_time(space, self.PATIENCE - 1)
        assert sent == self.LIMIT
        self.pass_time(space, 1)
        assert sent == self.LIMIT + 1, "the writer was called and got through"
        for _ in range(3):
            send()
            self.settle(space)
        assert refused == 1, "who is stuck holds up nobody a second time"
        got += take_all(quick)
        assert got == [numbered(i) for i in range(sent)]
        assert stuck.lost == sent - self.LIMIT
        assert [(f.code, f.who) for f in told] == [("reader-full", "/stuck")]
        assert take_all(stuck) == [numbered(i) for i in range(self.LIMIT)]
        send()
        self.settle(space)
        assert take_all(stuck) == [numbered(sent - 1)], "when it goes on taking, it gets samples again"

    def test_best_effort_keep_all_drops_the_newest(self, space: Space, told: list[Finding]) -> None:
        writer = space.participant("talker").writer(CHATTER, RELIABLE)
        reader = space.participant("listener").reader(
            CHATTER, Qos(Reliability.BEST_EFFORT, history=History.KEEP_ALL)
        )
        self.settle(space)
        for i in range(self.LIMIT + 3):
            assert writer.write(numbered(i))
            self.settle(space)
        assert take_all(reader) == [numbered(i) for i in range(self.LIMIT)]
        assert reader.lost == 3
        assert [f.code for f in told] == ["reader-full"]

    def test_a_closed_reader_lets_its_writers_go(self, space: Space) -> None:
        writer = space.participant("talker").writer(CHATTER, KEEP_ALL)
        reader = space.participant("listener").reader(CHATTER, KEEP_ALL)
        rooms: list[int] = []
        writer.on_room = lambda: rooms.append(1)
        self.settle(space)
        while writer.write(b"x"):
            self.settle(space)
        reader.close()
        self.settle(space)
        assert rooms == [1]
        assert writer.write(b"x")

    def test_late_readers_get_what_transient_local_writers_keep(self, space: Space) -> None:
        writer = space.participant("talker").writer(CHATTER, LATCHED)
        for i in range(5):
            writer.write(numbered(i))
        self.settle(space)
        calls: list[int] = []
        returned = False

        def on_data(reader: Reader) -> None:
            assert returned, "called inside the call that makes the reader"
            calls.append(reader.pending)

        late = space.participant("late").reader(CHATTER, LATCHED, on_data)
        returned = True
        volatile = space.participant("volatile").reader(CHATTER, RELIABLE)
        shallow = space.participant("shallow").reader(CHATTER, LATCHED.replace(depth=1))
        deep = space.participant("deep").reader(CHATTER, LATCHED.replace(depth=10))
        self.settle(space)
        assert calls in ([3], [1]), "once, when all is there or when the first is"
        assert take_all(shallow) == [numbered(4)]
        assert take_all(deep) == [numbered(2), numbered(3), numbered(4)], "the writer keeps 3"
        writer.write(numbered(5))
        self.settle(space)
        assert take_all(late) == [numbered(i) for i in (3, 4, 5)], "depth 3: sample 2 made room for 5"
        assert take_all(volatile) == [numbered(5)]
        assert take_all(shallow) == [numbered(5)]

    def test_history_comes_before_live_samples(self, space: Space, told: list[Finding]) -> None:
        writer = space.participant("talker").writer(CHATTER, LATCHED)
        for i in range(3):
            writer.write(numbered(i))
        self.settle(space)
        late = space.participant("late").reader(CHATTER, LATCHED.replace(depth=10))
        self.settle(space)
        writer.write(numbered(3))
        self.settle(space)
        assert take_all(late) == [numbered(i) for i in range(4)]
        assert told == []

    def test_a_keep_all_history_holds_everything_up_to_the_limit(self, space: Space) -> None:
        qos = KEEP_ALL.replace(durability=Durability.TRANSIENT_LOCAL)
        writer = space.participant("talker").writer(CHATTER, qos)
        for i in range(self.LIMIT + 2):
            writer.write(numbered(i))
        self.settle(space)
        late = space.participant("late").reader(CHATTER, qos)
        self.settle(space)
        assert take_all(late) == [numbered(i) for i in range(2, self.LIMIT + 2)]

    @pytest.mark.parametrize("durability", [Durability.TRANSIENT, Durability.PERSISTENT])
    def test_more_than_transient_local_is_taken_as_that(
        self, space: Space, told: list[Finding], durability: Durability
    ) -> None:
        writer = space.participant("talker").writer(CHATTER, Qos(durability=durability))
        assert writer.qos.durability is Durability.TRANSIENT_LOCAL
        assert [f.code for f in told] == ["durability-lowered"]
        writer.write(b"x")
        reader = space.participant("listener").reader(CHATTER, Qos(durability=durability))
        self.settle(space)
        assert take_all(reader) == [b"x"]

    def test_lifespan(self, space: Space, told: list[Finding]) -> None:
        qos = LATCHED.replace(lifespan=SECOND)
        writer = space.participant("talker").writer(CHATTER, qos)
        reader = space.participant("listener").reader(CHATTER, LATCHED)
        self.settle(space)
        writer.write(b"old")
        self.pass_time(space, SECOND // 2)
        writer.write(b"new")
        self.settle(space)
        assert reader.pending == 2
        self.pass_time(space, SECOND // 2)
        late = space.participant("late").reader(CHATTER, LATCHED)
        self.settle(space)
        assert reader.pending == 1
        assert take_all(reader) == [b"new"]
        assert take_all(late) == [b"new"]
        assert (reader.expired, late.expired) == (1, 0)
        self.settle(space)
        assert [(f.code, f.who) for f in told] == [("sample-expired", "/listener")]

    def test_expired_samples_hold_up_nobody(self, space: Space) -> None:
        writer = space.participant("talker").writer(CHATTER, KEEP_ALL.replace(lifespan=SECOND))
        reader = space.participant("listener").reader(CHATTER, KEEP_ALL)
        self.settle(space)
        while writer.write(b"old"):
            self.settle(space)
        self.pass_time(space, SECOND)
        assert writer.write(b"new")
        self.settle(space)
        take_all(reader)
        self.settle(space)
        assert writer.write(b"newer")
        self.settle(space)
        assert self.take_everything(space, reader)[-1] == b"newer"
        assert (reader.expired, reader.lost) == (self.LIMIT + self.ON_THE_WAY, 0)

    @pytest.mark.parametrize(
        "wanted", [Qos(Reliability.BEST_EFFORT, history=History.KEEP_ALL), Qos(depth=3)], ids=str
    )
    def test_expired_samples_take_no_room(self, space: Space, wanted: Qos) -> None:
        writer = space.participant("talker").writer(CHATTER, RELIABLE.replace(lifespan=SECOND))
        reader = space.participant("listener").reader(CHATTER, wanted)
        self.settle(space)
        held = self.LIMIT if wanted.keeps_all else wanted.depth
        for _ in range(held):
            writer.write(b"old")
            self.settle(space)
        self.pass_time(space, SECOND)
        writer.write(b"new")
        self.settle(space)
        assert take_all(reader) == [b"new"]
        assert (reader.expired, reader.lost) == (held, 0)

    @pytest.mark.parametrize(
        ("offered", "wanted", "met"),
        [
            (("left",), ("left",), True),
            (("left", "right"), ("right",), True),
            (("left",), ("right",), False),
            (("left",), (), False),
            ((), ("left",), False),
            (("left",), ("l*",), True),
            (("",), (), True),
        ],
    )
    def test_partitions(
        self, space: Space, offered: tuple[str, ...], wanted: tuple[str, ...], met: bool
    ) -> None:
        writer = space.participant("talker").writer(CHATTER, RELIABLE.replace(partitions=offered))
        reader = space.participant("listener").reader(CHATTER, RELIABLE.replace(partitions=wanted))
        self.settle(space)
        assert writer.write(b"x")
        self.settle(space)
        assert take_all(reader) == ([b"x"] if met else [])
        assert bool(writer.matched) is bool(reader.matched) is met

    def test_deadlines(self, space: Space, told: list[Finding]) -> None:
        qos = RELIABLE.replace(deadline=100 * MS)
        writer = space.participant("talker").writer(CHATTER, qos)
        reader = space.participant("listener").reader(CHATTER, qos)
        missed: list[str] = []
        writer.on_deadline = lambda: missed.append("writer")
        reader.on_deadline = lambda: missed.append("reader")
        self.settle(space)
        self.pass_time(space, SECOND)
        assert missed == [], "the first sample starts it"
        for _ in range(5):
            writer.write(b"x")
            self.pass_time(space, 99 * MS)
        assert missed == []
        self.pass_time(space, MS)
        assert sorted(missed) == ["reader", "writer"]
        self.pass_time(space, 250 * MS)
        assert (writer.deadline_missed, reader.deadline_missed) == (3, 3)
        assert sorted(f.code for f in told) == ["reader-deadline-missed", "writer-deadline-missed"]
        writer.write(b"x")
        self.pass_time(space, 99 * MS)
        assert writer.deadline_missed == 3
        writer.close()
        self.settle(space)
        self.pass_time(space, SECOND)
        assert reader.deadline_missed == 3, "nobody is there to keep it"

    # Services

    def test_request_and_reply(self, space: Space) -> None:
        asked: list[tuple[bytes, bytes]] = []
        answers: list[tuple[int, bytes]] = []
        replier = space.participant("server").replier(
            ADD, None, lambda identity, data: asked.append((identity, data))
        )
        requester = space.participant("client").requester(
            ADD, None, lambda n, data: answers.append((n, data))
        )
        self.settle(space)
        assert (requester.servers, replier.clients) == (1, 1)
        first, second = requester.send(b"24 42"), requester.send(b"1 1")
        self.settle(space)
        assert first != second
        assert asked == [
            (identity_of(requester.gid, first), b"24 42"),
            (identity_of(requester.gid, second), b"1 1"),
        ]
        assert replier.reply(asked[1][0], b"2")
        assert replier.reply(asked[0][0], b"66")
        self.settle(space)
        assert answers == [(second, b"2"), (first, b"66")]

    def test_requests_and_replies_can_be_taken(self, space: Space) -> None:
        told: list[object] = []
        replier = space.participant("server").replier(ADD, on_data=told.append)
        requester = space.participant("client").requester(ADD, on_data=told.append)
        self.settle(space)
        number = requester.send(b"?")
        self.settle(space)
        assert told == [replier]
        assert replier.pending == 1
        request = replier.take()
        assert request is not None
        assert (request.identity, request.data) == (identity_of(requester.gid, number), b"?")
        assert request.sample.sequence == number
        assert replier.take() is None
        replier.reply(request.identity, b"!")
        self.settle(space)
        assert told == [replier, requester]
        reply = requester.take()
        assert reply is not None
        assert (reply.sequence, reply.data) == (number, b"!")
        assert requester.take() is None

    def test_each_client_gets_its_own_replies(self, space: Space) -> None:
        replier: Replier

        def double(identity: bytes, data: bytes) -> None:
            assert replier.reply(identity, data + data)

        replier = space.participant("server").replier(ADD, None, double)
        answers: dict[int, list[tuple[int, bytes]]] = {i: [] for i in range(5)}

        def keep(i: int, number: int, data: bytes) -> None:
            answers[i].append((number, data))

        clients = [space.participant(f"client{i}").requester(ADD, None, partial(keep, i)) for i in range(5)]
        self.settle(space)
        wanted: dict[int, list[tuple[int, bytes]]] = {i: [] for i in range(5)}
        for round_ in range(3):
            for i, client in enumerate(clients):
                body = f"{i}.{round_} ".encode()
                wanted[i].append((client.send(body), body + body))
        self.settle(space)
        assert answers == wanted

    def test_a_client_that_asks_again_when_answered(self, space: Space) -> None:
        replier = space.participant("server").replier(
            ADD, None, lambda identity, data: replier.reply(identity, data)
        )
        heard: list[int] = []
        depth = 0

        def again(number: int, data: bytes) -> None:
            nonlocal depth
            depth += 1
            assert depth == 1
            heard.append(int.from_bytes(data, "little"))
            if len(heard) < 2000:
                requester.send(numbered(len(heard)))
            depth -= 1

        requester = space.participant("client").requester(ADD, None, again)
        self.settle(space)
        requester.send(numbered(0))
        self.settle(space)
        assert heard == list(range(2000))

    def test_every_server_gets_the_request(self, space: Space, told: list[Finding]) -> None:
        answers: list[bytes] = []
        servers: dict[bytes, Replier] = {}
        for name in (b"a", b"b"):

            def serve(identity: bytes, data: bytes, name: bytes = name) -> None:
                servers[name].reply(identity, name)

            servers[name] = space.participant(name.decode()).replier(ADD, None, serve)
        requester = space.participant("client").requester(ADD, None, lambda n, data: answers.append(data))
        self.settle(space)
        requester.send(b"?")
        self.settle(space)
        assert sorted(answers) == [b"a", b"b"]
        space.participant("ear").reader(Topic(ADD.request_topic, ADD.request_type))
        self.settle(space)
        assert [(f.code, f.subject) for f in told] == [("several-servers", "/add_two_ints")]
        assert space.findings.counts() == {"several-servers": 1}

    def test_a_request_waits_for_its_server(self, space: Space, told: list[Finding]) -> None:
        requester = space.participant("client").requester(ADD)
        numbers = [requester.send(numbered(i)) for i in range(3)]
        self.settle(space)
        assert (requester.servers, requester.waiting) == (0, 3)
        self.pass_time(space, self.REQUEST_WAIT - 1)
        asked: list[tuple[bytes, bytes]] = []
        space.participant("server").replier(ADD, None, lambda identity, data: asked.append((identity, data)))
        self.settle(space)
        assert asked == [(identity_of(requester.gid, n), numbered(i)) for i, n in enumerate(numbers)]
        assert requester.waiting == 0
        self.pass_time(space, self.REQUEST_WAIT)
        assert told == []

    def test_waiting_requests_are_announced_when_the_server_stands(self, space: Space) -> None:
        node = space.participant("node")
        requester = node.requester(ADD)
        requester.send(b"?")
        self.settle(space)
        asked: list[bytes] = []
        servers: list[Replier] = []

        def on_request(identity: bytes, data: bytes) -> None:
            assert servers, "called inside the call that makes the server"
            asked.append(data)

        servers.append(node.replier(ADD, None, on_request))
        self.settle(space)
        assert asked == [b"?"]
        assert space.findings.counts() == {}

    def test_a_request_does_not_wait_for_ever(self, space: Space, told: list[Finding]) -> None:
        requester = space.participant("client").requester(ADD)
        requester.send(b"1")
        self.pass_time(space, self.REQUEST_WAIT // 2)
        requester.send(b"2")
        self.pass_time(space, self.REQUEST_WAIT // 2)
        assert requester.waiting == 1
        (finding,) = told
        assert (finding.code, finding.who, finding.subject) == ("no-server", "/client", "/add_two_ints")
        assert "no server for /add_two_ints" in finding.format()
        asked: list[bytes] = []
        space.participant("server").replier(ADD, None, lambda identity, data: asked.append(data))
        self.settle(space)
        assert asked == [b"2"]

    def test_a_request_that_should_not_wait_fails_at_once(self, space: Space, told: list[Finding]) -> None:
        requester = space.participant("client").requester(ADD)
        for _ in range(3):
            assert requester.send(b"x", wait=False) == 0
        assert requester.waiting == 0
        self.settle(space)
        assert [(f.code, f.who) for f in told] == [("no-server", "/client")]
        assert space.findings.counts() == {"no-server": 3}
        asked: list[tuple[bytes, bytes]] = []
        space.participant("server").replier(ADD, None, lambda identity, data: asked.append((identity, data)))
        self.settle(space)
        number = requester.send(b"y", wait=False)
        self.settle(space)
        assert asked == [(identity_of(requester.gid, number), b"y")]

    def test_waiting_requests_are_bounded_by_the_depth(self, space: Space, told: list[Finding]) -> None:
        requester = space.participant("client").requester(ADD, Qos(depth=2))
        for i in range(5):
            requester.send(numbered(i))
        self.settle(space)
        assert requester.waiting == 2
        assert [(f.code, f.new) for f in told] == [("request-overwritten", 1)]
        assert space.findings.counts() == {"request-overwritten": 3}
        asked: list[bytes] = []
        space.participant("server").replier(ADD, None, lambda identity, data: asked.append(data))
        self.settle(space)
        assert asked == [numbered(3), numbered(4)]

    def test_requests_go_on_when_a_full_server_takes_some(self, space: Space, told: list[Finding]) -> None:
        requester = space.participant("client").requester(ADD, KEEP_ALL)
        replier = space.participant("server").replier(ADD, KEEP_ALL)
        self.settle(space)
        for i in range(self.LIMIT + 3):
            requester.send(numbered(i))
            self.settle(space)
        assert (replier.pending, requester.waiting) == (self.LIMIT, max(0, 3 - self.ON_THE_WAY))
        got = []
        while (request := replier.take()) is not None:
            got.append(request.data)
            self.settle(space)
        assert got == [numbered(i) for i in range(self.LIMIT + 3)]
        assert told == []

    @pytest.mark.parametrize("identity", [b"", bytes(23), bytes(24), bytes(25)])
    def test_a_reply_to_nobody_is_counted(self, space: Space, told: list[Finding], identity: bytes) -> None:
        space.participant("client").requester(ADD)
        replier = space.participant("server").replier(ADD)
        self.settle(space)
        assert not replier.reply(identity, b"x")
        self.settle(space)
        assert [(f.code, f.who) for f in told] == [("reply-unmatched", "/server")]

    def test_a_reply_cut_short_reaches_nobody(self, space: Space) -> None:
        """Whoever writes on the topic of replies: what does not name a request is for no client."""
        requester = space.participant("client").requester(ADD)
        writer = space.participant("stranger").writer(Topic(ADD.reply_topic, ADD.reply_type))
        self.settle(space)
        assert writer.matched
        for related in (None, requester.gid, requester.gid + bytes(7), bytes(24)):
            writer.write(b"x", related=related)
        self.settle(space)
        assert requester.take() is None
        writer.write(b"y", related=identity_of(requester.gid, 7))
        self.settle(space)
        reply = requester.take()
        assert reply is not None
        assert (reply.sequence, reply.data) == (7, b"y")

    def test_a_reply_to_a_client_that_has_gone(self, space: Space) -> None:
        requester = space.participant("client").requester(ADD)
        replier = space.participant("server").replier(ADD)
        self.settle(space)
        requester.send(b"?")
        self.settle(space)
        request = replier.take()
        assert request is not None
        requester.close()
        self.settle(space)
        assert not replier.reply(request.identity, b"!")
        assert space.findings.counts() == {"reply-unmatched": 1}

    def test_services_of_another_type_do_not_meet(self, space: Space, told: list[Finding]) -> None:
        other = Service(ADD.name, ADD.request_topic, ADD.reply_topic, "Other_Request_", "Other_Response_")
        requester = space.participant("client").requester(ADD)
        space.participant("server").replier(other)
        self.settle(space)
        requester.send(b"?")
        assert (requester.servers, requester.waiting) == (0, 1)
        assert {f.code for f in told} == {"type-mismatch"}

    def test_services_are_ordinary_topics(self, space: Space) -> None:
        """Who listens to requests and replies hears them, without being a server."""
        ear = space.participant("ear")
        requests = ear.reader(Topic(ADD.request_topic, ADD.request_type), RELIABLE)
        replies = ear.reader(Topic(ADD.reply_topic, ADD.reply_type), RELIABLE)
        requester = space.participant("client").requester(ADD)
        number = requester.send(b"?")
        self.settle(space)
        assert requester.waiting == 1, "a listener is no server"
        replier = space.participant("server").replier(ADD)
        self.settle(space)
        request = replier.take()
        assert request is not None
        replier.reply(request.identity, b"!")
        self.settle(space)
        assert take_all(requests) == [b"?"]
        sample = replies.take()
        assert sample is not None
        assert (sample.data, sample.related) == (b"!", self.heard_identity(requester, number))

    # Graph

    def test_the_graph_is_a_value(self, space: Space) -> None:
        talker = space.participant("talker", namespace="/lab", enclave="/e")
        silent = space.participant("", owner="client 0x00000007")
        writer, reader = talker.writer(CHATTER, RELIABLE), silent.reader(CHATTER, BEST_EFFORT)
        replier, requester = talker.replier(ADD), silent.requester(ADD)
        self.settle(space)
        graph = space.graph
        info = ParticipantInfo(talker.gid, "talker", "/lab", talker.domain, "/e", "/lab/talker")
        assert graph.nodes == (info,)
        assert info.full_name == "/lab/talker"
        assert {p.gid for p in graph.participants} == {talker.gid, silent.gid}
        assert {p.owner for p in graph.participants} == {"/lab/talker", "client 0x00000007"}
        wanted = Endpoint(writer.gid, Role.WRITER, *CHATTER, RELIABLE, "", info, self.TYPE_HASH)
        assert graph.endpoint(writer.gid) == wanted
        assert graph.endpoint(bytes(16)) is None
        assert wanted in graph.writers
        assert len(graph.writers) == 3
        assert len(graph.readers) == 3
        topic = graph.topic("rt/chatter")
        assert topic is not None
        assert topic in graph.topics
        assert {t.name for t in graph.topics} == {"rt/chatter", ADD.request_topic, ADD.reply_topic}
        assert (topic.types, topic.writers, topic.matches, topic.incompatible) == (
            (CHATTER.type_name,), (wanted,), ((writer.gid, reader.gid),), (),
        )  # fmt: skip
        (service,) = graph.services
        assert graph.service("/add_two_ints") == service
        assert [e.participant.gid for e in service.servers] == [talker.gid]
        assert [(e.participant.gid, e.gid) for e in service.clients] == [(silent.gid, requester.gid)]
        before = graph.participants
        replier.close()
        talker.close()
        self.settle(space)
        assert len(before) == 2
        assert not graph.nodes
        assert graph.topic("rt/nothing") is None
        assert graph.service("/nothing") is None
        assert graph.service("/add_two_ints", domain=77) is None
        assert graph.topic("rt/chatter", domain=77) is None

    def test_changes_of_the_graph_are_told(self, space: Space, events: list[GraphEvent]) -> None:
        talker = space.participant("talker")
        listener = space.participant("listener")
        writer, reader = talker.writer(CHATTER), listener.reader(CHATTER)
        stranger = listener.reader(Topic("rt/chatter", "Other"))
        self.settle(space)

        def names() -> list[tuple[str, bytes]]:
            shown = []
            for event in events:
                if isinstance(event, Appeared | Vanished | Assigned):
                    shown.append((type(event).__name__, event.what.gid))
                else:
                    assert event.writer.gid == writer.gid
                    shown.append((type(event).__name__, event.reader.gid))
            events.clear()
            return shown

        assert sorted(names()) == sorted(
            [
                (Appeared.__name__, talker.gid),
                (Appeared.__name__, listener.gid),
                (Appeared.__name__, writer.gid),
                (Appeared.__name__, reader.gid),
                (Matched.__name__, reader.gid),
                (Appeared.__name__, stranger.gid),
                (Incompatible.__name__, stranger.gid),
            ]
        )
        listener.close()
        self.settle(space)
        assert sorted(names()) == sorted(
            [
                (Vanished.__name__, stranger.gid),
                (Unmatched.__name__, reader.gid),
                (Vanished.__name__, reader.gid),
                (Vanished.__name__, listener.gid),
            ]
        )

    def test_watching_ends_and_may_fail(self, space: Space, events: list[GraphEvent]) -> None:
        def broken(event: GraphEvent) -> None:
            raise LookupError("page")

        cancel = space.graph.watch(broken)
        space.participant("a")
        self.settle(space)
        assert space.findings.counts() == {"callback-failed": 1}
        assert len(events) == 1
        cancel()
        cancel()
        space.participant("b")
        self.settle(space)
        assert space.findings.counts() == {"callback-failed": 1}

    # Life

    def test_closing_a_participant_closes_what_it_made(self, space: Space) -> None:
        node, peer = space.participant("node"), space.participant("peer")
        other, ear = peer.writer(CHATTER), peer.reader(CHATTER)
        writer, reader = node.writer(CHATTER), node.reader(CHATTER)
        requester, replier = node.requester(ADD), node.replier(ADD)
        self.settle(space)
        node.close()
        node.close()
        self.settle(space)
        assert all(e.closed for e in (node, writer, reader, requester, replier))
        assert (other.matched, ear.matched) == ((ear.gid,), (other.gid,))
        for what in (
            lambda: writer.write(b"x"),
            lambda: requester.send(b"x"),
            lambda: replier.reply(bytes(24), b"x"),
            lambda: node.writer(CHATTER),
            lambda: node.reader(CHATTER),
            lambda: node.requester(ADD),
            lambda: node.replier(ADD),
        ):
            with pytest.raises(ClosedError, match="closed"):
                what()
        assert (reader.take(), requester.take(), replier.take()) == (None, None, None)
        assert (reader.pending, reader.matched, writer.matched) == (0, (), ())
        assert (requester.servers, requester.waiting, replier.clients, replier.pending) == (0, 0, 0, 0)

    def test_each_entity_closes_by_itself_and_twice(self, space: Space) -> None:
        node = space.participant("node")
        with node.writer(CHATTER) as writer, node.reader(CHATTER) as reader:
            with node.requester(ADD) as requester, node.replier(ADD) as replier:
                self.settle(space)
                assert requester.servers == 1
            self.settle(space)
            assert writer.matched == (reader.gid,)
        for entity in (writer, reader, requester, replier):
            assert entity.closed
            entity.close()
        self.settle(space)
        assert space.graph.topics == ()
        assert not node.closed

    def test_a_closed_space_takes_nothing_more(self, space: Space) -> None:
        node = space.participant("node")
        writer = node.writer(CHATTER)
        space.close()
        space.close()
        assert space.closed
        assert node.closed
        assert writer.closed
        assert space.tick() is None
        with pytest.raises(ClosedError, match="open another"):
            space.participant("late")

    def test_unread_samples_go_with_the_reader(self, space: Space) -> None:
        writer = space.participant("talker").writer(CHATTER, RELIABLE)
        reader = space.participant("listener").reader(CHATTER, RELIABLE)
        self.settle(space)
        writer.write(b"x")
        self.settle(space)
        reader.close()
        assert reader.take() is None
        assert writer.write(b"y")

    # Identity

    def test_keys_give_the_same_gids_in_every_life(self, space: Space) -> None:
        def live() -> list[bytes]:
            with space.participant("board", key=b"\xba\x5e\xba\x11") as board:
                reader = board.reader(CHATTER, key=0x16)
                board.writer(CHATTER)
                writer, asker = board.writer(CHATTER, key=0x15), board.requester(ADD, key=0x17)
                self.settle(space)
                return [board.gid, writer.gid, reader.gid, asker.gid, board.replier(ADD, key=0x18).gid]

        first, second = live(), live()
        assert first == second
        assert len(set(first)) == 5
        assert all(len(gid) == 16 and gid[:12] == first[0][:12] for gid in first)

    def test_gids_differ(self, space: Space) -> None:
        gids = []
        for key in (None, None, b"1", b"2", bytes(range(12))):
            node = space.participant("same name", key=key)
            gids += [node.gid, node.writer(CHATTER).gid, node.reader(CHATTER).gid, node.requester(ADD).gid]
        assert len(set(gids)) == len(gids)

    def test_a_key_is_used_once(self, space: Space) -> None:
        node = space.participant("one", key=b"k")
        with pytest.raises(ValueError, match="in use by /one"):
            space.participant("two", key=b"k")
        space.participant("elsewhere", key=b"k", domain=99)
        node.writer(CHATTER, key=1)
        node.reader(CHATTER, key=1)
        with pytest.raises(ValueError, match="key 1 is in use"):
            node.writer(CHATTER, key=1)
        with pytest.raises(ValueError, match="key 1 is in use"):
            node.requester(ADD, key=1)
        for wrong in (-1, 0x800000):
            with pytest.raises(ValueError, match="must be from 0"):
                node.writer(CHATTER, key=wrong)
        with pytest.raises(ValueError, match="empty"):
            space.participant("three", key=b"")


class VirtualTime(SpaceConformance):
    """The contract of an engine whose time is a test's. Subclasses open the space."""

    def open_space(self) -> Space:
        self.clock = Clock()
        self.wakes = 0
        self.due: int | None = None
        space = self.make()
        space.on_wake(self.wake)
        return space

    def make(self) -> Space:
        """A new space on `clock`."""
        raise NotImplementedError

    def wake(self) -> None:
        """Arrange for a tick, as an event loop would."""
        self.wakes += 1
        self.due = self.clock.now

    def settle(self, space: Space) -> None:
        """Tick only when the space has asked for it: what it forgets to ask for does not happen."""
        rounds = 0
        while self.due is not None and self.due <= self.clock.now:
            self.due = space.tick()
            rounds += 1
            assert rounds < 10_000

    def pass_time(self, space: Space, ns: int) -> None:
        end = self.clock.now + ns
        self.settle(space)
        while self.due is not None and self.due <= end:
            self.clock.now = max(self.due, self.clock.now)
            self.settle(space)
        self.clock.now = end
