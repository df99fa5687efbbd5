"""Time synchronisation: the arithmetic, its bound, and against the agent core over a network with delays."""

import struct

from hypothesis import given
from hypothesis import strategies as st

from muros.client import CONNECTED, Session, TimeSync
from muros.xrce.constants import TIMESTAMP_REPLY
from tests.client.replay import Wire
from tests.client.world import WALL, World


def reply(stamp: bytes, received: int, transmitted: int) -> bytes:
    """A TIMESTAMP_REPLY for the stamp of a request; times in ns."""
    times = (divmod(transmitted, 10**9), divmod(received, 10**9))
    return b"\x81\0\0\0\x0f\x01\x18\0" + b"".join(struct.pack("<II", *time) for time in times) + stamp


def exchange(sync: TimeSync, at: int, there: int, held: int, back: int, offset: int) -> int:
    """One exchange in microseconds: asked at ``at``; the agent's clock is ``offset`` ahead. When it was over."""
    sync.request(at)
    wire = sync.session.transport
    assert isinstance(wire, Wire)
    stamp = wire.sent[-1][8:16]
    came, left = at + there + offset, at + there + held + offset
    message = reply(stamp, came * 1000, left * 1000)
    sync._on_reply(message, 8, 24, at + there + held + back)
    return at + there + held + back


def fresh() -> TimeSync:
    """On a session that is not connected: requests go out all the same."""
    return TimeSync(Session(Wire(), 1))


DELAYS = st.integers(0, 50_000)


@given(DELAYS, DELAYS, DELAYS, st.integers(10**15, 2 * 10**15), st.integers(0, 10**12))
def test_the_error_stays_within_its_bound(there: int, held: int, back: int, offset: int, at: int) -> None:
    sync = fresh()
    end = exchange(sync, at, there, held, back, offset)
    seconds, nanoseconds = sync.time(end)
    assert 0 <= nanoseconds < 10**9
    ours, true = seconds * 10**9 + nanoseconds, (end + offset) * 1000
    assert abs(ours - true) <= sync.error(end) * 1000 + 1000
    assert sync.round_trip == there + back


def test_equal_delays_give_the_exact_time() -> None:
    sync = fresh()
    end = exchange(sync, 5_000_000, 700, 30, 700, WALL // 1000)
    assert sync.time(end + 250_000) == divmod((end + 250_000) * 1000 + WALL, 10**9)


def test_the_shortest_round_trip_counts() -> None:
    sync = fresh()
    offset = WALL // 1000
    exchange(sync, 0, 100, 0, 100, offset)
    end = exchange(sync, 1_000_000, 100, 0, 40_000, offset)
    assert sync.round_trip == 200
    assert sync.time(end) == divmod((end + offset) * 1000, 10**9)
    for i in range(2, 10):
        end = exchange(sync, i * 1_000_000, 300, 0, 300, offset)
    assert sync.round_trip == 600, "the best is forgotten with time"


def test_the_bound_grows_with_time() -> None:
    sync = fresh()
    end = exchange(sync, 0, 100, 0, 100, WALL // 1000)
    assert sync.error(end + 10_000_000) == sync.error(end) + 1000


def test_answers_to_nothing_are_passed_over() -> None:
    sync = fresh()
    assert (sync.time(5), sync.error(5), sync.synchronized()) == ((0, 0), -1, False)
    sync._on_reply(reply(bytes(8), WALL, WALL), 8, 24, 100)
    assert not sync.synchronized()
    end = exchange(sync, 1_000, 100, 0, 100, WALL // 1000)
    wire = sync.session.transport
    assert isinstance(wire, Wire)
    sync._on_reply(reply(wire.sent[-1][8:16], 5, 5), 8, 24, end + 10)  # doubled by the network
    assert sync.time(end)[0] == (WALL // 1000 + end) // 10**6


@given(st.binary(min_size=24, max_size=24), st.integers(0, 10**9))
def test_nonsense_does_no_harm(body: bytes, now: int) -> None:
    sync = fresh()
    sync.request(now)
    wire = sync.session.transport
    assert isinstance(wire, Wire)
    sync._on_reply(body[:16] + wire.sent[-1][8:16], 0, 24, now + 1000)
    seconds, nanoseconds = sync.time(now + 2000)
    assert 0 <= nanoseconds < 10**9
    assert seconds >= 0


def test_against_the_agent() -> None:
    world = World(seed=3, delay=(1, 30))
    session = world.client()
    world.until(lambda: session.state == CONNECTED)
    sync = TimeSync(session)
    replies = 0

    def on_time(buf: bytes, off: int, n: int) -> None:
        nonlocal replies
        replies += 1
        sync._on_reply(buf, off, n, world.now * 1000)

    session.objects[-TIMESTAMP_REPLY] = on_time
    for _ in range(8):
        sync.request(world.now * 1000)
        world.run(100, 1)
    assert replies == 8
    seconds, nanoseconds = sync.time(world.now * 1000)
    off = abs(seconds * 10**9 + nanoseconds - (WALL + world.now * 1_000_000))
    assert off <= sync.error(world.now * 1000) * 1000
