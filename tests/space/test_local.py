"""The local engine: the contract of all engines, and what is its own."""

import asyncio
from collections.abc import Callable
from functools import partial

import pytest

from bench.bench_space import session_size
from muros.findings import Finding, Findings
from muros.space import (
    ClosedError,
    Durability,
    Qos,
    Reader,
    Space,
    SpaceError,
    Topic,
    UnknownEngineError,
    open_space,
    register_engine,
)
from muros.space.local import Limits, LocalSpace, open_local
from tests.space.conformance import (
    ADD,
    CHATTER,
    KEEP_ALL,
    LATCHED,
    MS,
    RELIABLE,
    SECOND,
    Clock,
    VirtualTime,
    numbered,
    take_all,
)


class TestLocal(VirtualTime):
    """The contract."""

    def make(self) -> Space:
        return open_space(
            "local:",
            clock=self.clock,
            resource_limit=self.LIMIT,
            max_blocking_time=self.PATIENCE,
            request_wait=self.REQUEST_WAIT,
        )


@pytest.fixture
def clock() -> Clock:
    return Clock()


class TestOpening:
    """URLs and options."""

    def test_the_number_is_the_domain_of_who_names_none(self) -> None:
        with open_space("local:42") as space:
            assert (space.url, space.domain) == ("local:42", 42)
            assert space.participant("a").domain == 42
            assert space.participant("b", domain=0).domain == 0
            space.participant("c").writer(CHATTER)
            assert space.graph.topic(CHATTER.name) == space.graph.topic(CHATTER.name, 42) is not None
            assert space.graph.topic(CHATTER.name, 0) is None
        with open_space() as space:
            assert (space.url, space.domain) == ("local:", 0)

    def test_spaces_are_separate(self) -> None:
        with open_space() as one, open_space() as two:
            writer = one.participant("w").writer(CHATTER)
            reader = two.participant("r").reader(CHATTER)
            writer.write(b"x")
            assert reader.take() is None
            assert writer.gid[:8] != reader.gid[:8]

    @pytest.mark.parametrize("url", ["", "local", "warp:", "loca:", ":local", "LOCAL:"])
    def test_an_unknown_engine_names_the_known(self, url: str) -> None:
        with pytest.raises(UnknownEngineError, match="known: local:"):
            open_space(url)

    @pytest.mark.parametrize("url", ["local:x", "local:-1", "local: 1", "local:²"])
    def test_a_domain_is_a_number(self, url: str) -> None:
        with pytest.raises(SpaceError, match="write local: or local:42"):
            open_space(url)

    def test_options(self) -> None:
        with pytest.raises(TypeError, match=r"no option colour .*known: resource_limit"):
            open_space("local:", colour=1)
        for name, bad in (
            ("resource_limit", 0),
            ("callbacks", 0),
            ("max_blocking_time", -1),
            ("request_wait", -1),
        ):
            with pytest.raises(ValueError, match=f"{name} is {bad}"):
                open_local("", **{name: bad})  # type: ignore[arg-type]
        assert Limits() == Limits(5000, 100 * MS, 5 * SECOND, 1000)

        with pytest.raises(TypeError, match="callbacks is 'many'"):
            open_space("local:", callbacks="many")

    def test_engines_can_be_added(self) -> None:
        seen: list[tuple[str, dict[str, object]]] = []

        def factory(
            rest: str, *, findings: Findings | None, clock: Callable[[], int], **options: object
        ) -> Space:
            seen.append((rest, options))
            return LocalSpace(findings=findings, clock=clock)

        register_engine("added-in-a-test", factory)
        with open_space("added-in-a-test:rest:of:it", depth=3):
            assert seen == [("rest:of:it", {"depth": 3})]
        with pytest.raises(ValueError, match="already"):
            register_engine("added-in-a-test", factory)
        for bad in ("", "a:b"):
            with pytest.raises(ValueError, match="no name"):
                register_engine(bad, factory)

    def test_findings_may_be_shared(self, clock: Clock) -> None:
        findings = Findings()
        with open_space(findings=findings, clock=clock) as space:
            assert space.findings is findings
            space.participant("a").writer(CHATTER, Qos(durability=Durability.PERSISTENT))
        (finding,) = findings.snapshot()
        assert finding.first == clock.now / SECOND


class TestTime:
    """Ticks, wake-ups, a clock that jumps."""

    def test_an_idle_space_needs_no_ticks(self, clock: Clock) -> None:
        with open_space(clock=clock) as space:
            writer = space.participant("w").writer(CHATTER, RELIABLE)
            reader = space.participant("r").reader(CHATTER, RELIABLE)
            wakes: list[int] = []
            space.on_wake(lambda: wakes.append(1))
            assert space.tick() is None
            writer.write(b"x")
            take_all(reader)
            assert space.tick() is None
            assert wakes == []

    def test_wakes_are_for_what_comes_earlier_than_promised(self, clock: Clock) -> None:
        with open_space(clock=clock) as space:
            client = space.participant("c").requester(ADD)
            wakes: list[int] = []
            space.on_wake(lambda: wakes.append(1))
            client.send(b"1")
            assert wakes == [1]
            assert space.tick() == clock.now + 5 * SECOND
            client.send(b"2")
            assert wakes == [1], "the second request waits no shorter"
            writer = space.participant("w").writer(CHATTER, Qos(deadline=SECOND))
            writer.write(b"x")
            assert wakes == [1, 1]
            assert space.tick() == clock.now + SECOND
            space.on_wake(None)
            space.participant("w2").writer(CHATTER, Qos(deadline=MS)).write(b"x")
            assert wakes == [1, 1]

    def test_summaries_of_findings_come_with_the_tick(self, clock: Clock) -> None:
        told: list[Finding] = []
        with open_space(clock=clock) as space:
            space.findings.on_finding(told.append)
            writer = space.participant("w").writer(CHATTER, RELIABLE)
            space.participant("r").reader(CHATTER, Qos(depth=1))
            for i in range(4):
                writer.write(numbered(i))
            assert [f.new for f in told] == [1]
            due = space.tick()
            assert due is not None
            assert clock.now + 9 * SECOND < due < clock.now + 11 * SECOND
            clock.now = due
            assert space.tick() is None
            assert [f.new for f in told] == [1, 2]

    def test_a_clock_set_back_makes_nobody_wait_longer(self, clock: Clock) -> None:
        with open_space(clock=clock, resource_limit=1) as space:
            writer = space.participant("w").writer(CHATTER, KEEP_ALL)
            reader = space.participant("r").reader(CHATTER, KEEP_ALL)
            writer.write(b"1")
            assert not writer.write(b"2")
            space.tick()
            clock.now -= 3600 * SECOND
            due = space.tick()
            assert due is not None
            assert clock.now < due <= clock.now + 100 * MS
            clock.now = due
            space.tick()
            assert writer.write(b"2")
            assert reader.lost == 1

    def test_many_periods_at_once(self, clock: Clock) -> None:
        """A process that slept for a day counts its missed deadlines without a loop over them."""
        with open_space(clock=clock) as space:
            writer = space.participant("w").writer(CHATTER, Qos(deadline=1000))
            calls: list[int] = []
            writer.on_deadline = lambda: calls.append(1)
            writer.write(b"x")
            clock.now += 86_400 * SECOND
            space.tick()
            assert writer.deadline_missed == 86_400 * 10**6
            assert calls == [1]

    def test_timers_of_what_has_gone_leave_nothing(self, clock: Clock) -> None:
        with LocalSpace(clock=clock) as space:
            for i in range(2000):
                with space.participant(f"p{i}") as p:
                    p.writer(CHATTER, Qos(deadline=3600 * SECOND)).write(b"x")
                    p.requester(ADD).send(b"x")
            assert len(space._core.timers) < 200
            assert space.tick() is None


class TestLoop:
    """A space attached to an asyncio loop serves itself."""

    def test_what_needs_time_happens(self) -> None:
        async def main() -> None:
            with open_space() as space:
                loop = asyncio.get_running_loop()
                node = space.participant("node")
                came, missed, told = asyncio.Event(), asyncio.Event(), asyncio.Event()
                node.writer(CHATTER, LATCHED).write(b"x")
                node.reader(CHATTER, LATCHED, lambda reader: came.set())
                space.attach(loop)
                space.attach(loop)
                await came.wait()
                writer = node.writer(CHATTER, Qos(deadline=MS))
                writer.on_deadline = missed.set
                writer.write(b"x")
                await missed.wait()
                space.findings.on_finding(lambda finding: told.set())
                node.requester(ADD).send(b"x", wait=False)
                await told.wait()

        asyncio.run(main())

    def test_one_loop_at_a_time(self) -> None:
        with open_space() as space:
            node = space.participant("node")
            node.writer(CHATTER, LATCHED).write(b"x")
            for _ in range(2):
                loop = asyncio.new_event_loop()
                came = asyncio.Event()
                space.attach(loop)
                node.reader(CHATTER, LATCHED, lambda reader, came=came: came.set())  # type: ignore[misc]
                loop.run_until_complete(came.wait())
                other = asyncio.new_event_loop()
                with pytest.raises(SpaceError, match="another event loop"):
                    space.attach(other)
                other.close()
                loop.close()
                node.writer(CHATTER, Qos(deadline=MS)).write(b"x")
        with pytest.raises(ClosedError):
            space.attach(loop)

    def test_a_closed_space_leaves_the_loop_alone(self) -> None:
        loop = asyncio.new_event_loop()
        with open_space() as space:
            space.attach(loop)
            space.participant("node").requester(ADD).send(b"x")
            loop.run_until_complete(asyncio.sleep(0))
        loop.run_until_complete(asyncio.sleep(0))
        loop.close()


class TestOrder:
    """The queue of callbacks."""

    def test_an_endless_exchange_lets_the_loop_breathe(self, clock: Clock) -> None:
        with open_space(clock=clock, callbacks=10) as space:
            node = space.participant("node")
            writer = node.writer(CHATTER, RELIABLE)
            calls, wakes = 0, 0

            def forever(reader: Reader) -> None:
                nonlocal calls
                calls += 1
                take_all(reader)
                writer.write(b"x")

            def wake() -> None:
                nonlocal wakes
                wakes += 1

            space.on_wake(wake)
            node.reader(CHATTER, RELIABLE, forever)
            writer.write(b"x")
            assert (calls, wakes) == (10, 1)
            assert space.tick() == clock.now
            assert calls == 20

    def test_delivery_is_in_the_writers_call(self, clock: Clock) -> None:
        with open_space(clock=clock) as space:
            got: list[bytes] = []
            writer = space.participant("w").writer(CHATTER, RELIABLE)
            space.participant("r").reader(CHATTER, RELIABLE, lambda reader: got.extend(take_all(reader)))
            writer.write(b"1")
            assert got == [b"1"]

    def test_history_is_announced_by_the_next_tick(self, clock: Clock) -> None:
        with open_space(clock=clock) as space:
            space.participant("w").writer(CHATTER, LATCHED).write(b"1")
            wakes: list[int] = []
            calls: list[Reader] = []
            space.on_wake(lambda: wakes.append(1))
            reader = space.participant("r").reader(CHATTER, LATCHED, calls.append)
            space.participant("r2").reader(CHATTER, LATCHED, lambda reader: take_all(reader))
            assert (reader.pending, calls, wakes) == (1, [], [1]), "woken once for both"
            space.tick()
            assert calls == [reader]

    def test_a_finding_watcher_may_use_the_space(self, clock: Clock) -> None:
        """Whatever it does, the samples of one writer stay in order."""
        with open_space(clock=clock) as space:
            writer = space.participant("w").writer(CHATTER, RELIABLE)
            small = space.participant("small").reader(CHATTER, Qos(depth=1))
            large = space.participant("large").reader(CHATTER, RELIABLE)
            space.findings.on_finding(lambda f: writer.write(b"in the watcher"))
            for i in range(3):
                writer.write(numbered(i))
            assert take_all(large) == [numbered(0), numbered(1), b"in the watcher", numbered(2)]
            assert small.lost == 3

    def test_waiting_writers_are_called_in_turn(self, clock: Clock) -> None:
        with open_space(clock=clock, resource_limit=1) as space:
            node = space.participant("node")
            reader = node.reader(CHATTER, KEEP_ALL)
            order: list[int] = []
            writers = [node.writer(CHATTER, KEEP_ALL) for _ in range(3)]
            for i, writer in enumerate(writers):

                def send(i: int = i) -> None:
                    if writers[i].write(numbered(i)):
                        order.append(i)

                writer.on_room = send
            writers[0].write(b"full")
            for writer in writers:
                assert not writer.write(b"x")
            for _ in range(4):
                reader.take()
                space.tick()
            assert order == [0, 1, 2]

    def test_who_waits_is_called_when_there_is_plenty_or_no_patience_left(self, clock: Clock) -> None:
        with open_space(clock=clock, resource_limit=2) as space:
            node = space.participant("node")
            reader = node.reader(CHATTER, KEEP_ALL)
            writers = [node.writer(CHATTER, KEEP_ALL) for _ in range(4)]
            called: list[int] = []
            for i, writer in enumerate(writers):
                writer.on_room = partial(called.append, i)

            def all_wait() -> None:
                while writers[0].write(b"x"):
                    pass
                assert not any(writer.write(b"x") for writer in writers)
                called.clear()

            all_wait()
            reader.take()
            space.tick()
            assert called == [0], "room for one"
            reader.take()
            space.tick()
            assert called == [0, 1, 2, 3], "room for all"
            all_wait()
            clock.now += 100 * MS
            space.tick()
            assert called == [0, 1, 2, 3], "no patience left"
            before = reader.lost
            assert all(writer.write(b"x") for writer in writers)
            assert reader.lost == before + 4
            reader.close()
            assert space.tick() is not None, "the summary of the finding"
            clock.now += 60 * SECOND
            assert space.tick() is None, "no timer is left"

    def test_a_full_reader_that_closes_leaves_no_timer(self, clock: Clock) -> None:
        with open_space(clock=clock, resource_limit=1) as space:
            node = space.participant("node")
            reader, writer = node.reader(CHATTER, KEEP_ALL), node.writer(CHATTER, KEEP_ALL)
            assert writer.write(b"1")
            assert not writer.write(b"2")
            assert space.tick() == clock.now + 100 * MS
            reader.close()
            assert space.tick() is None

    def test_a_steady_competitor_does_not_starve_a_writer(self, clock: Clock) -> None:
        """Patience counts from a writer's own first refusal, whoever wins the room in between."""
        with open_space(clock=clock, resource_limit=1) as space:
            node = space.participant("node")
            reader = node.reader(CHATTER, KEEP_ALL)
            greedy, meek = node.writer(CHATTER, KEEP_ALL), node.writer(CHATTER, KEEP_ALL)
            greedy.write(b"0")
            for _ in range(10):
                assert not meek.write(b"meek")
                clock.now += 10 * MS
                assert reader.take() is not None
                assert greedy.write(b"greedy")
            assert meek.write(b"meek")
            assert reader.lost == 1

    def test_a_closed_writer_leaves_the_line(self, clock: Clock) -> None:
        with open_space(clock=clock, resource_limit=2) as space:
            node = space.participant("node")
            reader = node.reader(CHATTER, KEEP_ALL)
            gone, stays = node.writer(CHATTER, KEEP_ALL), node.writer(CHATTER, KEEP_ALL)
            calls: list[str] = []
            gone.on_room = lambda: calls.append("gone")
            stays.on_room = lambda: calls.append("stays")
            gone.write(b"1")
            gone.write(b"2")
            assert not gone.write(b"3")
            assert not stays.write(b"3")
            gone.close()
            reader.take()
            space.tick()
            assert calls == ["stays"]

    def test_callbacks_of_the_dead_are_not_called(self, clock: Clock) -> None:
        with open_space(clock=clock) as space:
            space.participant("w").writer(CHATTER, LATCHED).write(b"1")
            calls: list[Reader] = []
            reader = space.participant("r").reader(CHATTER, LATCHED, calls.append)
            reader.close()
            space.tick()
            assert calls == []

    def test_interrupts_pass_and_leave_the_queue_usable(self, clock: Clock) -> None:
        with open_space(clock=clock) as space:
            interrupts = [KeyboardInterrupt()]

            def on_data(reader: Reader) -> None:
                take_all(reader)
                if interrupts:
                    raise interrupts.pop()
                calls.append(reader)

            calls: list[Reader] = []
            writer = space.participant("w").writer(CHATTER, RELIABLE)
            space.participant("r").reader(CHATTER, RELIABLE, on_data)
            with pytest.raises(KeyboardInterrupt):
                writer.write(b"1")
            writer.write(b"2")
            assert len(calls) == 1


class TestBounds:
    """Memory and numbers."""

    def test_depth_is_limited(self, clock: Clock) -> None:
        told: list[Finding] = []
        with open_space(clock=clock, resource_limit=10) as space:
            space.findings.on_finding(told.append)
            writer = space.participant("w").writer(CHATTER, Qos(depth=1000))
            assert told == [], "a volatile writer holds nothing"
            reader = space.participant("r").reader(CHATTER, Qos(depth=65535))
            assert [f.code for f in told] == ["depth-limited"]
            for i in range(20):
                writer.write(numbered(i))
            assert take_all(reader) == [numbered(i) for i in range(10, 20)]

    def test_a_burst_of_losses_queues_one_report(self, clock: Clock) -> None:
        with LocalSpace(clock=clock) as space:
            node = space.participant("node")
            trigger, burst = node.writer(CHATTER, RELIABLE), node.writer(Topic("rt/burst", "T"), RELIABLE)
            slow = node.reader(Topic("rt/burst", "T"), Qos(depth=1))
            waiting: list[int] = []

            def on_data(reader: Reader) -> None:
                take_all(reader)
                for i in range(1000):
                    burst.write(numbered(i))
                waiting.append(len(space._core.queue))

            node.reader(CHATTER, RELIABLE, on_data)
            trigger.write(b"go")
            assert slow.lost == 999
            assert waiting == [1]
            (finding,) = space.findings.snapshot()
            assert (finding.code, finding.count) == ("reader-too-slow", 999)

    def test_nothing_is_left_of_participants_that_have_gone(self, clock: Clock) -> None:
        with LocalSpace(clock=clock) as space:
            for i in range(50):
                with space.participant(f"p{i}") as p:
                    p.writer(Topic(f"rt/t{i}", "T")).write(b"x")
                    p.reader(Topic(f"rt/t{i}", "T"))
                    p.requester(ADD)
                    p.replier(ADD)
            (domain,) = space._domains.values()
            assert (domain.topics, domain.endpoints, domain.participants) == ({}, {}, {})
            for i in range(1000):
                space.participant("tourist", domain=i).close()
            assert len(space._domains) == 1

    def test_a_fleet_is_lean(self) -> None:
        assert session_size(touch=False) < 2000
        assert session_size(touch=True) < 3000

    def test_a_closed_writer_says_so(self) -> None:
        with open_space() as space:
            writer = space.participant("w").writer(CHATTER, KEEP_ALL)
            writer.close()
            with pytest.raises(ClosedError, match="writer of rt/chatter is closed"):
                writer.write(b"x")
