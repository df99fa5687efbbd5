"""rclc straight on a space beside the space itself: what the executor and the messages' classes add.

Run from a checkout: python bench/bench_rclc.py [--trips 3000] [--domain 100]

The first lines are costs within one process over `local:`. The last two are round trips of an Int32 between two
processes over `dds:` on loopback: through rclc, where both sides spin, and at the door of the space under asyncio.
"""

import argparse
import asyncio
import os
import subprocess
import sys
import time
from collections.abc import Callable

from muros.rclc import Context, Executor
from muros.space import Qos, Reader, Topic, open_space

from std_msgs.msg import Int32

INT32 = "std_msgs::msg::dds_::Int32_"
PATIENCE = 10.0
"""Seconds until the other side is there, and until an answer comes."""
WARM = 200
"""Round trips that are not counted."""


def main() -> None:
    """Print one line for each measure; with a role, be the other side."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trips", type=int, default=3000, help="round trips")
    parser.add_argument("--domain", type=int, default=100, help="a DDS domain that nobody uses")
    parser.add_argument("--role", choices=("rclc", "door"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    url = f"dds:{options.domain}"
    if options.role:
        if options.role == "rclc":
            answer_by_rclc(url)
        else:
            asyncio.run(answer_at_the_door(url))
        return
    in_one_process(20_000)
    trips: dict[str, Callable[[str, int], list[float]]] = {
        "rclc": ask_by_rclc,
        "door": lambda url, count: asyncio.run(ask_at_the_door(url, count)),
    }
    for role, ask in trips.items():
        words = [sys.executable, __file__, "--domain", str(options.domain), "--role", role]
        other = subprocess.Popen(words)
        try:
            times = sorted(ask(url, options.trips + WARM)[WARM:])
        finally:
            other.kill()
            other.wait()
        half, late = times[len(times) // 2] * 1e6, times[len(times) * 99 // 100] * 1e6
        print(f"round trip over dds: by {role:24} {half:6.0f} us, 99 % within {late:.0f} us")


def in_one_process(count: int) -> None:
    """What a pass, a message and a message back cost."""
    one, other = Context("local:"), Context("local:")
    got: list[int] = []
    other.node("listener").subscription(Int32, "value", lambda message: got.append(message.data))
    publisher = one.node("talker").publisher(Int32, "value")
    executor = Executor(other)

    def publish() -> None:
        publisher.publish(Int32(data=1))
        executor.spin_some()

    for name, work in (("pass with nothing to do", executor.spin_some), ("publish, pass, callback", publish)):
        start = time.perf_counter()
        for _ in range(count):
            work()
        print(f"{name:44} {(time.perf_counter() - start) / count * 1e6:6.1f} us")
    assert len(got) == count
    one.close()
    other.close()


def answer_by_rclc(url: str) -> None:
    """The other side, by rclc."""
    context = Context(url)
    node = context.node("answering")
    pong = node.publisher(Int32, "pong")
    node.subscription(Int32, "ping", pong.publish)
    Executor(context).spin()


def ask_by_rclc(url: str, count: int) -> list[float]:
    """Seconds of round trips by rclc."""
    context = Context(url)
    node = context.node("asking")
    ping = node.publisher(Int32, "ping")
    got: list[int] = []
    node.subscription(Int32, "pong", lambda message: got.append(message.data))
    executor = Executor(context)
    times = []

    def until(condition: Callable[[], object]) -> None:
        end = time.monotonic() + PATIENCE
        while not condition():
            if time.monotonic() > end:
                raise SystemExit("bench: the other side does not answer")
            executor.spin_some(PATIENCE)

    def knock() -> bool:
        ping.publish(Int32(data=-1))
        executor.spin_some(0.05)
        return bool(got)

    until(knock)
    got.clear()
    while executor.spin_some(0.2):
        got.clear()

    def answered(number: int) -> Callable[[], bool]:
        return lambda: len(got) > number

    for i in range(count):
        start = time.perf_counter()
        ping.publish(Int32(data=i))
        until(answered(i))
        times.append(time.perf_counter() - start)
    context.close()
    return times


async def answer_at_the_door(url: str) -> None:
    """The other side, at the door of a space."""
    space = open_space(url)
    space.attach(asyncio.get_running_loop())
    participant = space.participant("answering")
    writer = participant.writer(Topic("rt/pong", INT32), Qos.preset("default"))

    def on_data(reader: Reader) -> None:
        while (sample := reader.take()) is not None:
            writer.write(sample.data)

    participant.reader(Topic("rt/ping", INT32), Qos.preset("default"), on_data)
    await asyncio.Event().wait()


async def ask_at_the_door(url: str, count: int) -> list[float]:
    """Seconds of round trips at the door of a space."""
    times: list[float] = []
    start = 0.0
    over = asyncio.Event()
    with open_space(url) as space:
        space.attach(asyncio.get_running_loop())
        participant = space.participant("asking")
        writer = participant.writer(Topic("rt/ping", INT32), Qos.preset("default"))

        def ask() -> None:
            nonlocal start
            start = time.perf_counter()
            writer.write(b"\1\0\0\0")

        def on_data(reader: Reader) -> None:
            while reader.take() is not None:
                times.append(time.perf_counter() - start)
                if len(times) < count:
                    ask()
                else:
                    over.set()

        reader = participant.reader(Topic("rt/pong", INT32), Qos.preset("default"), on_data)
        while not (writer.matched and reader.matched):
            await asyncio.sleep(0.05)
        ask()
        await asyncio.wait_for(over.wait(), PATIENCE)
    return times


if __name__ == "__main__":
    main()
