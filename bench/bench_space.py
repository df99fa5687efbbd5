"""Speed and size of the local space, beside a floor that does nothing but move samples through a deque.

Run from a checkout: python bench/bench_space.py [samples]
"""

import argparse
import sys
import time
import tracemalloc
from collections import deque
from collections.abc import Callable

from muros.space import History, Qos, Reader, Service, Space, Topic, open_space

TOPIC = Topic("rt/chatter", "std_msgs::msg::dds_::String_")
BODY = bytes(64)
REPEATS = 5
SESSIONS = 1000


def main() -> None:
    """Print one line for each measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("samples", nargs="?", type=int, default=100_000, help="samples of one run")
    samples = parser.parse_args().samples
    floor = best(deque_floor, samples)
    print(f"{'deque append and popleft':44} {floor:6.2f} us")
    for name, run in (
        ("write, take", write_take),
        ("write, on_data, take", write_on_data),
        ("write, take: keep all, reliable", write_take_keep_all),
        ("write to 10 readers, take from each (of one)", write_ten),
        ("request, on_request, reply, on_reply", call_service),
    ):
        cost = best(run, samples)
        print(f"{name:44} {cost:6.2f} us  {cost / floor:5.1f} x floor")
    idle, used = session_size(touch=False), session_size(touch=True)
    print(
        f"{'session of participant, writer, reader':44} {idle:6.0f} B idle, {used:.0f} B after the first sample"
    )


def best(run: Callable[[int], float], samples: int) -> float:
    """Microseconds for each sample, the best of some runs."""
    return min(run(samples) for _ in range(REPEATS)) / samples * 1e6


def deque_floor(n: int) -> float:
    """No space at all."""
    queue: deque[bytes] = deque()
    start = time.perf_counter()
    for _ in range(n):
        queue.append(BODY)
        queue.popleft()
    return time.perf_counter() - start


def write_take(n: int) -> float:
    """One writer, one reader that is asked."""
    return _write_take(n, Qos(depth=10))


def write_take_keep_all(n: int) -> float:
    """The same with back-pressure."""
    return _write_take(n, Qos(history=History.KEEP_ALL))


def _write_take(n: int, qos: Qos) -> float:
    with open_space() as space:
        writer = space.participant("w").writer(TOPIC, qos)
        reader = space.participant("r").reader(TOPIC, qos)
        start = time.perf_counter()
        for _ in range(n):
            writer.write(BODY)
            reader.take()
        return time.perf_counter() - start


def write_on_data(n: int) -> float:
    """One writer, one reader that is told."""

    def on_data(reader: Reader) -> None:
        while reader.take() is not None:
            pass

    with open_space() as space:
        writer = space.participant("w").writer(TOPIC, Qos(depth=10))
        space.participant("r").reader(TOPIC, Qos(depth=10), on_data)
        start = time.perf_counter()
        for _ in range(n):
            writer.write(BODY)
        return time.perf_counter() - start


def write_ten(n: int) -> float:
    """Ten readers; time for each delivery."""
    with open_space() as space:
        writer = space.participant("w").writer(TOPIC, Qos(depth=10))
        readers = [space.participant(f"r{i}").reader(TOPIC, Qos(depth=10)) for i in range(10)]
        start = time.perf_counter()
        for _ in range(n // 10):
            writer.write(BODY)
            for reader in readers:
                reader.take()
        return time.perf_counter() - start


def call_service(n: int) -> float:
    """One client, one server."""
    service = Service("/add", "rq/addRequest", "rr/addReply", "Q", "P")
    replies = 0

    def on_reply(sequence: int, data: bytes) -> None:
        nonlocal replies
        replies += 1

    with open_space() as space:
        server = space.participant("s")
        replier = server.replier(service, on_request=lambda identity, data: replier.reply(identity, data))
        client = space.participant("c").requester(service, on_reply=on_reply)
        start = time.perf_counter()
        for _ in range(n):
            client.send(BODY)
        cost = time.perf_counter() - start
    if replies != n:
        sys.exit(f"{replies} replies to {n} requests")
    return cost


def session_size(*, touch: bool) -> float:
    """Bytes of one session among many, each with a topic of its own name."""
    tracemalloc.start()
    try:
        with open_space() as space:
            before = tracemalloc.get_traced_memory()[0]
            sessions = [_session(space, i, touch) for i in range(SESSIONS)]
            return (tracemalloc.get_traced_memory()[0] - before) / len(sessions)
    finally:
        tracemalloc.stop()


def _session(space: Space, i: int, touch: bool) -> object:
    participant = space.participant(f"board{i}", key=i.to_bytes(4, "little"), owner=f"client 0x{i:08X}")
    topic = Topic(f"rt/board{i}/temperature", "std_msgs::msg::dds_::Int32_")
    writer = participant.writer(topic, Qos(depth=10), key=0x15)
    reader = participant.reader(topic, Qos(depth=10), key=0x16)
    if touch:
        writer.write(BODY)
        reader.take()
    return participant, writer, reader


if __name__ == "__main__":
    main()
