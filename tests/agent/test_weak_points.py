"""What the reference agent is known to do badly, one test for each: wedged readers, lost answers, ghosts and more.

Here all of it works.
"""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from muros.client.qos import Qos
from muros.space import History, Topic
from muros.space import Qos as SpaceQos
from muros.xrce import create
from muros.xrce.constants import (
    KIND_DATAREADER,
    KIND_DATAWRITER,
    REUSE,
    STATUS_ERR_UNKNOWN_REFERENCE,
    STATUS_OK,
    STREAM_BEST_EFFORT,
    STREAM_RELIABLE,
)
from tests.agent.raw import (
    BEST_EFFORT,
    KEEP_ALL,
    PARTICIPANT,
    PUBLISHER,
    READER,
    RELIABLE,
    SUBSCRIBER,
    TOPIC,
    WRITER,
    Raw,
    submessage,
)
from tests.agent.replay import Bench


def codes(bench: Bench) -> dict[str, int]:
    return bench.findings.counts()


def in_space(bench: Bench) -> tuple[int, int, int]:
    """Participants, writers and readers in the space."""
    graph = bench.space.graph
    return len(graph.participants), len(graph.writers), len(graph.readers)


# Samples and sizes


@pytest.mark.parametrize("mtu", [64, 508])
@pytest.mark.parametrize("more", range(-6, 7))
def test_best_effort_sizes_around_the_mtu(mtu: int, more: int) -> None:
    """A sample that just does not fit is dropped and told; the reader goes on."""
    bench = Bench()
    client = Raw(bench, mtu=mtu).tree(qos=RELIABLE)
    client.read(stream=STREAM_BEST_EFFORT)
    size = mtu - 4 - 4 - 4 + more
    for data in (b"x" * size, b"small"):
        client.write(data)
    assert client.samples() == ([b"small"] if more > 0 else [b"x" * size, b"small"])
    assert codes(bench).get("best-effort-too-big", 0) == (1 if more > 0 else 0)
    if more > 0:
        text = next(f for f in bench.findings.snapshot() if f.code == "best-effort-too-big").format()
        assert f"{size} B do not fit its best-effort MTU of {mtu} B" in text
        assert "reliable stream" in text


@pytest.mark.parametrize("more", [-1, 0, 1, 10_000])
def test_a_sample_around_64_kb_to_a_client(more: int) -> None:
    bench = Bench()
    client = Raw(bench).tree()
    client.read()
    data = bytes(range(256)) * 256
    data = data[: 65_527 + more] if more <= 1 else data + bytes(more)
    client.write(data)
    client.write(b"small")
    assert client.samples() == ([data, b"small"] if more <= 0 else [b"small"])
    assert codes(bench).get("sample-too-long", 0) == (1 if more > 0 else 0)


def test_a_sample_over_64_kb_to_a_client_that_takes_them() -> None:
    bench = Bench(max_sample_to_client=200_000)
    client = Raw(bench).tree()
    client.read()
    data = bytes(range(250)) * 400
    client.write(data)
    assert client.samples() == [data]


@pytest.mark.parametrize("size", [0, 1, 56, 57, 60, 61, 500, 3000])
@pytest.mark.parametrize("keyed", [False, True])
def test_reliable_samples_of_any_size_at_a_tiny_mtu(size: int, keyed: bool) -> None:
    bench = Bench()
    client = Raw(bench, mtu=64, session_id=1 if keyed else 0x81).tree()
    client.read()
    data = bytes(i & 255 for i in range(size))
    client.write(data)
    client.write(b"next")
    assert client.samples() == [data, b"next"]


# Nobody waits for another


def test_deleting_one_client_while_others_run() -> None:
    """Leaving takes no time: everything happens in the call that brought the DELETE."""
    bench = Bench()
    clients = [Raw(bench, f"c{n}", 0x100 + n).tree(f"rt/t{n}") for n in range(50)]
    for client in clients:
        client.read()
    before = bench.now
    for client in clients[::2]:
        assert client.goodbye() == STATUS_OK
    assert bench.now == before
    for n, client in enumerate(clients):
        client.write(b"still here")
        assert client.samples() == ([b"still here"] if n % 2 else [])
    assert in_space(bench) == (25, 25, 25)


def test_replacing_a_read_happens_at_once() -> None:
    bench = Bench()
    client = Raw(bench).tree()
    first = client.read()
    second = client.read()
    client.write(b"a")
    assert [(got.ids, got.data) for got in client.got() if got.kind == 9] == [(second, b"a")]
    assert first != second


def test_a_client_that_does_not_acknowledge_delays_nobody() -> None:
    bench = Bench()
    slow, quick = Raw(bench, "slow", 1).tree(), Raw(bench, "quick", 2).tree()
    slow.read()
    quick.read()
    slow.got()
    slow.acknowledges = False
    for n in range(100):
        quick.write(bytes((n,)))
        assert quick.samples() == [bytes((n,))]
    assert len(slow.samples()) == 16


# Nothing left behind


@pytest.mark.parametrize("session_id", [0x81, 0x01])
def test_a_key_with_another_session_id_leaves_nothing_behind(session_id: int) -> None:
    bench = Bench()
    for turn in range(10):
        client = Raw(bench, "a", 0xCAFE, session_id=session_id + turn).tree()
        client.read()
        assert in_space(bench) == (1, 1, 1)
    assert len(bench.core.clients) == 1
    assert len(bench.port.sessions) == 1
    assert client.goodbye() == STATUS_OK
    assert in_space(bench) == (0, 0, 0)
    assert not bench.port.sessions
    assert not bench.core.unacknowledged


def test_a_key_with_the_same_session_id_keeps_its_entities() -> None:
    bench = Bench()
    client = Raw(bench).tree()
    assert client.connect() == STATUS_OK
    assert in_space(bench) == (1, 1, 1)
    client.read()
    client.write(b"a")
    assert client.samples() == [b"a"]


def test_goodbye_from_a_keyed_session_leaves_nothing_behind() -> None:
    bench = Bench()
    client = Raw(bench, session_id=1).tree()
    assert client.goodbye() == STATUS_OK
    assert in_space(bench) == (0, 0, 0)
    assert not bench.port.sessions
    assert client.goodbye() == STATUS_OK  # once more, from nobody known


def test_what_follows_a_goodbye_in_its_message_makes_nothing() -> None:
    for stream in (0, STREAM_BEST_EFFORT, STREAM_RELIABLE):
        bench = Bench()
        client = Raw(bench)
        client.connect()
        client.send(
            stream,
            submessage(3, b"\0\2\xff\xfe"),
            submessage(1, client.ids(PARTICIPANT) + create.of_participant("ghost", 0)),
            submessage(2, b"\0\x0a\xff\xfd\1\0\0\0"),
        )
        assert in_space(bench) == (0, 0, 0)
        assert not bench.core.clients
        assert not bench.core.unacknowledged


def test_closing_a_link_removes_every_client_of_it() -> None:
    bench = Bench()
    for key in range(1, 6):
        Raw(bench, "line", key, session_id=1).tree()
    assert in_space(bench)[0] == 5
    bench.core.detach(bench.port, bench.now)
    assert in_space(bench) == (0, 0, 0)
    assert not bench.core.clients


def test_a_ghost_is_forgotten_when_asked_to() -> None:
    bench = Bench(forget_silent=60_000)
    silent, lively = Raw(bench, "a", 1).tree(), Raw(bench, "b", 2).tree()
    for now in range(5_000, 120_000, 5_000):
        bench.advance(now)
        assert lively.ping()
        assert (1).to_bytes(4, "big") in bench.core.clients or now >= 60_000
    assert list(bench.core.clients) == [lively.key]
    assert in_space(bench) == (1, 1, 1)
    assert "client 0x00000001 gone: silent for" in [event.text() for event in bench.events][-1]
    assert not silent.ping()


def test_without_being_asked_no_ghost_is_forgotten() -> None:
    bench = Bench()
    client = Raw(bench).tree()
    bench.advance(10 * 60_000)
    assert client.ping()


def test_a_lost_client_is_kept_for_a_while() -> None:
    bench = Bench(keep_lost=30_000)
    client = Raw(bench).tree()
    bench.core.gone(bench.port, client.address, "cable pulled", bench.now)
    bench.advance(29_000)
    assert in_space(bench) == (1, 1, 1)
    bench.advance(31_000)
    assert in_space(bench) == (0, 0, 0)
    assert len(bench.core._calls) == 0


def test_a_lost_client_that_comes_back_goes_on() -> None:
    bench = Bench(keep_lost=30_000)
    reader, writer = Raw(bench, "r", 1).tree(qos=KEEP_ALL), Raw(bench, "w", 2).tree(qos=KEEP_ALL)
    reader.read()
    writer.write(b"0")
    assert reader.samples() == [b"0"]
    bench.core.gone(bench.port, "r", "cable pulled", bench.now)
    for n in range(1, 41):
        writer.write(bytes((n,)))
    assert reader.samples() == []
    bench.advance(20_000)
    reader.acknack(reader.expected[STREAM_RELIABLE])
    assert reader.samples() == [bytes((n,)) for n in range(1, 41)]
    assert len(bench.core.clients) == 2


def test_an_idle_agent_sleeps() -> None:
    """Nothing to do, nothing to wake up for; a silent client that owes acknowledgements wakes it once a second."""
    bench = Bench()
    client = Raw(bench).tree()
    client.read()
    bench.advance(1_000)
    client.got()
    bench.advance(2_000)
    assert bench.core.tick(bench.now) is None
    client.write(b"never acknowledged")
    assert bench.core.tick(bench.now) == bench.now + 50
    bench.advance(40_000)
    bench.take()
    assert bench.core.tick(bench.now) == bench.now + 1_000
    bench.advance(80_000)
    assert bench.take() == []
    client.acknowledges = False
    assert client.ping()
    bench.advance(bench.now + 1_500)
    assert any(message[4] == 11 for message in bench.take()), "no HEARTBEAT once it is heard again"


def test_a_line_that_flaps_keeps_no_timers() -> None:
    bench = Bench(keep_lost=30_000)
    client = Raw(bench).tree()
    for _ in range(1000):
        bench.core.gone(bench.port, client.address, "flap", bench.now)
        assert client.ping()
    assert len(bench.core._calls) <= 130
    bench.advance(60_000)
    assert client.ping()


# Answers


def test_no_status_is_lost_with_a_full_window() -> None:
    bench = Bench()
    client = Raw(bench, acknowledges=False)
    client.connect()
    asked = []
    for _ in range(100):
        ids = client.ids(PARTICIPANT)
        asked.append(ids)
        client.send(STREAM_RELIABLE, submessage(1, ids + create.of_participant("n", 0), REUSE | 1))
    assert len([got for got in client.got() if got.kind == 5]) == 16
    client.acknowledges = True
    client.acknack(16)
    assert [got.ids for got in client.got() if got.kind == 5] == asked[16:]


def test_no_status_is_lost_behind_a_large_sample() -> None:
    bench = Bench()
    client = Raw(bench, mtu=64).tree(qos=KEEP_ALL)
    client.read()
    client.acknowledges = False
    client.write(bytes(60_000))
    ids = client.ids(WRITER)
    client.send(STREAM_RELIABLE, submessage(3, ids))
    assert client.status_of(ids) == -1
    client.acknowledges = True
    client.acknack(client.expected[0x80])
    assert client.status_of(ids) == STATUS_OK


def test_answers_nobody_acknowledges_are_bounded() -> None:
    """Beyond the limit requests are held unacknowledged: a window of the client waits, nothing grows."""
    bench = Bench(max_waiting=50)
    client = Raw(bench, acknowledges=False)
    client.connect()
    for _ in range(300):
        client.send(STREAM_RELIABLE, submessage(3, client.ids(WRITER)))
    session = bench.core.clients[client.key]
    assert session.outputs[0x80].waiting() == 50
    assert session.inputs[0x80].expected == 16 + 50
    client.acknowledges = True
    client.acknack(16)
    assert len(client.statuses()) == 16 + 50
    client.heartbeat(0, 81)
    assert session.inputs[0x80].expected == 16 + 50 + 16
    assert client.statuses() == [STATUS_ERR_UNKNOWN_REFERENCE] * 16


def test_the_middle_of_a_message_fails_and_the_rest_goes_on() -> None:
    bench = Bench()
    client = Raw(bench).tree()
    client.read()
    client.send(
        STREAM_RELIABLE,
        submessage(7, client.ids(WRITER) + b"a"),
        submessage(7, client.ids(0x0995) + b"nowhere"),
        submessage(99, b"?"),
        submessage(7, client.ids(WRITER) + b"b"),
        submessage(3, client.ids(0x0995)),
    )
    got = client.got()
    assert [g.data for g in got if g.kind == 9] == [b"a", b"b"]
    assert [g.status for g in got if g.kind == 5] == [STATUS_ERR_UNKNOWN_REFERENCE]
    assert codes(bench) == {"unknown-writer": 1, "unknown-submessage": 1}


def test_the_middle_of_a_message_fails_and_ends_it_as_in_the_reference() -> None:
    bench = Bench(stop_at_failure=True)
    client = Raw(bench).tree()
    client.read()
    client.send(
        STREAM_RELIABLE,
        submessage(7, client.ids(WRITER) + b"a"),
        submessage(7, client.ids(0x0995) + b"nowhere"),
        submessage(7, client.ids(WRITER) + b"b"),
    )
    client.write(b"c")
    assert client.samples() == [b"a", b"c"]


def test_a_heartbeat_on_a_best_effort_stream_is_answered_with_zeros() -> None:
    bench = Bench()
    client = Raw(bench)
    client.connect()
    client.send(STREAM_BEST_EFFORT, submessage(7, client.ids(WRITER) + b"x"))
    client.heartbeat(0xFFFF, 0xFFFF, STREAM_BEST_EFFORT)
    assert [got.body for got in client.got()] == [b"\0\0\0\0\1"]


def test_data_is_not_repeated_for_every_nack() -> None:
    """A NACK that repeats itself while the answer is on its way costs nothing."""
    bench = Bench()
    client = Raw(bench, acknowledges=False).tree()
    client.acknack(6)
    client.read()
    for n in range(8):
        client.write(bytes((n,)))
    bench.take()
    for _ in range(50):
        client.acknack(6, 0x0001)
    assert len([m for m in bench.take() if m[1] == 0x80]) == 1


# Reading


def test_max_samples_0_cancels_at_once() -> None:
    bench = Bench()
    client = Raw(bench).tree()
    client.read()
    client.write(b"a")
    assert client.samples() == [b"a"]
    client.read(samples=0)
    for _ in range(5):
        client.write(b"b")
        bench.advance(bench.now + 200)
        assert client.samples() == []


@pytest.mark.parametrize("samples", [1, 3])
def test_max_samples_ends_the_read(samples: int) -> None:
    bench = Bench()
    client = Raw(bench).tree()
    client.read(samples=samples)
    for n in range(6):
        client.write(bytes((n,)))
    assert client.samples() == [bytes((n,)) for n in range(samples)]


def test_max_elapsed_time_ends_the_read() -> None:
    bench = Bench()
    client = Raw(bench).tree()
    client.read(seconds=2)
    client.write(b"in time")
    bench.advance(2_100)
    client.write(b"late")
    assert client.samples() == [b"in time"]


def test_a_rate_below_a_samples_size_delivers_slowly() -> None:
    bench = Bench()
    client = Raw(bench).tree()
    client.read(rate=100)
    for n in range(3):
        client.write(bytes((n,)) * 300)
    arrived = []
    while bench.now < 12_000:
        bench.advance(bench.now + 100)
        arrived += [bench.now] * len(client.samples())
    assert len(arrived) == 3
    gaps = [later - earlier for earlier, later in pairwise(arrived)]
    assert all(2_000 <= gap <= 3_200 for gap in gaps), arrived


@given(
    st.integers(1, 5_000), st.lists(st.integers(1, 900), min_size=1, max_size=20), st.sampled_from([0x80, 1])
)
@settings(max_examples=25)
def test_max_bytes_per_second_holds_over_any_time(rate: int, sizes: list[int], stream: int) -> None:
    bench = Bench()
    client = Raw(bench, mtu=1000).tree(qos=KEEP_ALL)
    client.read(stream=stream, rate=rate)
    for size in sizes:
        client.write(bytes(size))
    total = 0
    for _ in range(40):
        bench.advance(bench.now + 250)
        total += sum(map(len, client.samples()))
        assert total <= rate + rate * bench.now / 1000 + 900
    assert len(bench.core._calls) <= 130
    assert total >= min(sum(sizes), rate * 9)


def test_min_pace_period_spaces_samples() -> None:
    bench = Bench()
    client = Raw(bench).tree()
    client.read(pace=500)
    for n in range(4):
        client.write(bytes((n,)))
    arrived = []
    while bench.now < 5_000:
        bench.advance(bench.now + 50)
        arrived += [bench.now] * len(client.samples())
    assert len(arrived) == 4
    assert all(450 <= b - a <= 550 for a, b in pairwise(arrived)), arrived


def test_replaced_reads_keep_no_timers_and_no_place_in_line() -> None:
    bench = Bench()
    client = Raw(bench).tree(qos=KEEP_ALL)
    for n in range(40):
        client.write(bytes((n,)) * 200)
    for _ in range(2000):
        client.read(rate=1)
    assert len(bench.core._calls) <= 130
    client.got()
    client.acknowledges = False
    for _ in range(2000):
        client.read()
    assert len(bench.core.clients[client.key]._waiting) <= 10
    bench.take()


def test_a_read_of_nothing_known_is_refused_on_the_reliable_stream() -> None:
    bench = Bench()
    client = Raw(bench).tree()
    ids = client.read(0x0996)
    assert [(g.stream, g.status) for g in client.got() if g.kind == 5 and g.ids == ids] == [
        (0x80, STATUS_ERR_UNKNOWN_REFERENCE)
    ]


# QoS


def test_deadline_and_lifespan_reach_the_space() -> None:
    bench = Bench()
    client = Raw(bench).base()
    qos = Qos(reliable=True, depth=7, deadline=250, lifespan=400).asked
    assert client.make(WRITER, create.of_endpoint(KIND_DATAWRITER, TOPIC, qos, PUBLISHER)) == STATUS_OK
    assert client.make(READER, create.of_endpoint(KIND_DATAREADER, TOPIC, qos, SUBSCRIBER)) == STATUS_OK
    for endpoint in (*bench.space.graph.writers, *bench.space.graph.readers):
        assert endpoint.qos.deadline == 250_000_000
        assert endpoint.qos.depth == 7
    assert bench.space.graph.writers[0].qos.lifespan == 400_000_000
    client.write(b"old")
    bench.advance(500)
    client.write(b"new")
    client.read()
    assert client.samples() == [b"new"]


def test_incompatible_qos_is_told() -> None:
    bench = Bench()
    writer, reader = Raw(bench, "w", 1).base(), Raw(bench, "r", 2).base()
    writer.make(WRITER, create.of_endpoint(KIND_DATAWRITER, TOPIC, BEST_EFFORT, PUBLISHER))
    reader.make(READER, create.of_endpoint(KIND_DATAREADER, TOPIC, RELIABLE, SUBSCRIBER))
    reader.read()
    writer.write(b"a")
    assert reader.samples() == []
    assert any("reliab" in finding.format() for finding in bench.findings.snapshot())


def test_a_full_reader_that_keeps_all_pushes_back_and_loses_nothing() -> None:
    """The writer's stream is held, its messages stay unacknowledged, and everything arrives once and in order."""
    bench = Bench(resource_limit=5)
    keep_all = SpaceQos(history=History.KEEP_ALL)
    reader = bench.space.participant("slow").reader(Topic("rt/chatter", "T"), keep_all)
    client = Raw(bench).base()
    client.make(WRITER, create.of_endpoint(KIND_DATAWRITER, TOPIC, KEEP_ALL, PUBLISHER))
    first = client.numbers[STREAM_RELIABLE]
    stream = bench.core.clients[client.key].inputs[STREAM_RELIABLE]
    messages = [submessage(7, client.ids(WRITER) + bytes((n, half))) for n in range(10) for half in (0, 1)]
    for n in range(10):
        client.send(STREAM_RELIABLE, *messages[2 * n : 2 * n + 2])
    assert reader.pending == 5
    assert stream.expected == first + 2
    got: list[bytes] = []
    for n in range(10):
        # the client says it all again, as it does while nothing is acknowledged
        client.tell(client.message(STREAM_RELIABLE, first + 2 + n % 3, *messages[4:6]))
        client.heartbeat(first, first + 9)
        while (sample := reader.take()) is not None:
            got.append(sample.data)
        bench.space.tick()
    assert got == [bytes((n, half)) for n in range(10) for half in (0, 1)]
    assert stream.expected == first + 10
    assert reader.lost == 0


def test_a_writer_that_is_deleted_while_its_stream_is_held_frees_the_stream() -> None:
    bench = Bench(resource_limit=1)
    bench.space.participant("dead").reader(Topic("rt/chatter", "T"), SpaceQos(history=History.KEEP_ALL))
    client = Raw(bench).base()
    client.make(WRITER, create.of_endpoint(KIND_DATAWRITER, TOPIC, KEEP_ALL, PUBLISHER))
    client.write(b"a")
    number = client.send(STREAM_RELIABLE, submessage(7, client.ids(WRITER) + b"b"))
    assert client.delete(WRITER, stream=STREAM_BEST_EFFORT) == STATUS_OK
    client.heartbeat(number, number)
    assert client.delete(0x0025) == STATUS_ERR_UNKNOWN_REFERENCE
    assert codes(bench)["unknown-writer"] == 1
