"""One process of `bench_dds.py`: a role played with one of the implementations compared, printed as JSON lines.

    python _dds_worker.py IMPLEMENTATION ROLE DOMAIN SIZE SECONDS

Runs in the environment of the implementation and therefore imports nothing of the others. Prints "ready" when it has
its entities, and its result when it is done: a source and a ping by themselves, the others when their input closes.
"""

import asyncio
import json
import os
import resource
import socket
import sys
import threading
import time
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any, Protocol

TYPE = "std_msgs::msg::dds_::String_"
WARM_UP = 300
"""Round trips that are not counted."""
TURN = 32
"""Samples written before the loop gets its turn."""
ENDPOINTS = 500
"""Writers, and as many readers, of each of two processes with many."""


class Implementation(Protocol):
    """What is the same in all of them."""

    def writer(self, topic: str) -> Callable[[], bool]:
        """A new writer: a function that writes the one sample, False = there is no room."""

    def reader(self, topic: str, on_sample: Callable[[], object]) -> None:
        """A new reader."""

    def matched(self) -> int:
        """How many writers and readers its own have met."""

    def run(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Runs this to its end, and whatever the implementation needs beside it."""


class Muros:
    """The space engine `dds`, as users have it."""

    def __init__(self, domain: int, size: int) -> None:
        from muros.space import History, Qos, Reliability, open_space

        self._loop = asyncio.new_event_loop()
        self._space = open_space(f"dds:{domain}")
        self._space.attach(self._loop)
        self._participant = self._space.participant("bench")
        self._qos = Qos(history=History.KEEP_ALL, reliability=Reliability.RELIABLE)
        self._body = cdr_string(size)
        self._ends: list[Any] = []

    def writer(self, topic: str) -> Callable[[], bool]:
        from muros.space import Topic

        made = self._participant.writer(Topic(topic, TYPE), self._qos)
        self._ends.append(made)
        write, body = made.write, self._body
        return lambda: write(body)

    def reader(self, topic: str, on_sample: Callable[[], object]) -> None:
        from muros.space import Reader, Topic

        def take(reader: Reader) -> None:
            while reader.take() is not None:
                on_sample()

        self._ends.append(self._participant.reader(Topic(topic, TYPE), self._qos, take))

    def matched(self) -> int:
        return sum(len(end.matched) for end in self._ends)

    def run(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        self._loop.run_until_complete(work())
        self._space.close()


class Rtps:
    """The RTPS core and its network, without the space."""

    def __init__(self, domain: int, size: int) -> None:
        from muros.rtps import EndpointQos, History
        from muros.rtps.net import Network, NetworkSettings

        self._loop = asyncio.new_event_loop()
        self._network = Network(NetworkSettings.from_environment(domain=domain))
        self._participant = self._network.core.participant(
            os.urandom(12), name="bench", now=self._network.clock()
        )
        self._qos = EndpointQos(history=History.KEEP_ALL)
        self._payload = b"\0\1\0\0" + cdr_string(size)
        self._ends: list[Any] = []

    def writer(self, topic: str) -> Callable[[], bool]:
        clock, poke, payload = self._network.clock, self._network.poke, self._payload
        made = self._participant.writer(topic, TYPE, self._qos, now=clock())
        self._ends.append(made)
        write = made.write

        def publish() -> bool:
            done = write(payload, clock())
            poke()
            return done != 0

        return publish

    def reader(self, topic: str, on_sample: Callable[[], object]) -> None:
        def take(_: object) -> None:
            on_sample()

        self._ends.append(self._participant.reader(topic, TYPE, self._qos, take, now=self._network.clock()))

    def matched(self) -> int:
        return sum(len(end.matched) for end in self._ends)

    def run(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        self._network.open(self._loop)
        self._loop.run_until_complete(work())
        self._network.close()


class Bare:
    """Datagrams under asyncio and nothing else: for round trips, the floor of whatever is written in Python."""

    def __init__(self, domain: int, size: int) -> None:
        self._loop = asyncio.new_event_loop()
        self._body = cdr_string(size)
        self._port = 7400 + 250 * domain + 200  # those of a participant that nobody has

    def writer(self, topic: str) -> Callable[[], bool]:
        sock, body, to = self._socket(), self._body, self._at(topic)
        return lambda: sock.sendto(body, to) > 0

    def reader(self, topic: str, on_sample: Callable[[], object]) -> None:
        sock = self._socket()
        sock.bind(self._at(topic))

        def take() -> None:
            with suppress(BlockingIOError):
                while sock.recv(65536):
                    on_sample()

        self._loop.add_reader(sock, take)

    def matched(self) -> int:
        return 2

    def run(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        self._loop.run_until_complete(work())

    def _socket(self) -> socket.socket:
        sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sock.setblocking(False)
        return sock

    def _at(self, topic: str) -> tuple[str, int]:
        return "127.0.0.1", self._port + (topic == "rt/back")


class Cyclone:
    """cyclonedds-python: its public API, listeners that wake the loop, typed samples."""

    def __init__(self, domain: int, size: int) -> None:
        from dataclasses import dataclass

        from cyclonedds.core import Policy, Qos
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.idl import IdlStruct

        base: Any = IdlStruct

        @dataclass
        class String(base, typename=TYPE):  # type: ignore[call-arg, misc]
            data: str

        self._type = String
        self._loop = asyncio.new_event_loop()
        self._participant = DomainParticipant(domain)
        self._qos = Qos(
            Policy.Reliability.Reliable(10**10),
            Policy.History.KeepAll,
            Policy.ResourceLimits(max_samples=5000, max_instances=-1, max_samples_per_instance=-1),
        )
        self._sample = String("x" * size)
        self._ends: list[Any] = []

    def writer(self, topic: str) -> Callable[[], bool]:
        from cyclonedds.pub import DataWriter
        from cyclonedds.topic import Topic

        writer = DataWriter(self._participant, Topic(self._participant, topic, self._type), qos=self._qos)
        self._ends.append(writer)
        write, sample = writer.write, self._sample

        def publish() -> bool:
            write(sample)
            return True

        return publish

    def reader(self, topic: str, on_sample: Callable[[], object]) -> None:
        from cyclonedds.core import Listener
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic

        pending = False

        def take() -> None:
            nonlocal pending
            pending = False
            while samples := reader.take(64):
                for _ in samples:
                    on_sample()

        base: Any = Listener

        class Told(base):  # type: ignore[misc]
            def on_data_available(listener, _: object) -> None:  # noqa: N805
                nonlocal pending
                if not pending:
                    pending = True
                    self._loop.call_soon_threadsafe(take)

        reader = DataReader(
            self._participant, Topic(self._participant, topic, self._type), qos=self._qos, listener=Told()
        )
        self._ends.append(reader)

    def matched(self) -> int:
        from cyclonedds.pub import DataWriter

        return sum(
            len(
                end.get_matched_subscriptions()
                if isinstance(end, DataWriter)
                else end.get_matched_publications()
            )
            for end in self._ends
        )

    def run(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        self._loop.run_until_complete(work())


class Rclpy:
    """rclpy: a node and its executor. The loop turns the executor, which waits for it in a thread of its own."""

    def __init__(self, domain: int, size: int) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.qos import HistoryPolicy, QoSProfile

        from std_msgs.msg import String

        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node("bench", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._qos = QoSProfile(history=HistoryPolicy.KEEP_ALL, depth=0)
        self._type = String
        self._message = String(data="x" * size)
        self._writers: list[Any] = []
        self._readers = 0

    def writer(self, topic: str) -> Callable[[], bool]:
        publisher = self._node.create_publisher(self._type, topic.removeprefix("rt/"), self._qos)
        self._writers.append(publisher)
        from rclpy._rclpy_pybind11 import RCLError

        publish, message = publisher.publish, self._message

        def write() -> bool:
            try:
                publish(message)
            except RCLError:  # no room within its time
                return False
            return True

        return write

    def reader(self, topic: str, on_sample: Callable[[], object]) -> None:
        self._readers += 1
        self._node.create_subscription(
            self._type, topic.removeprefix("rt/"), lambda message: on_sample(), self._qos
        )

    def matched(self) -> int:
        names = [publisher.topic_name for publisher in self._writers]
        matched: int = sum(publisher.get_subscription_count() for publisher in self._writers)
        return matched + (self._readers if matched >= len(names) else 0)

    def run(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """The executor spins in this thread, which is rclpy's own way; the work has a thread with a loop."""
        done = threading.Event()

        def other() -> None:
            try:
                asyncio.run(work())
            finally:
                done.set()
                self._executor.wake()

        thread = threading.Thread(target=other)
        thread.start()
        while not done.is_set():
            self._executor.spin_once(timeout_sec=0.2)
        thread.join()
        self._context.shutdown()


def cdr_string(size: int) -> bytes:
    """A std_msgs String of so many characters, without its encapsulation."""
    return (size + 1).to_bytes(4, "little") + b"x" * size + b"\0"


# --- Roles ---------------------------------------------------------------------------------------------------


class Roles:
    """What a process does, in the terms of all implementations."""

    def __init__(self, made: Implementation, seconds: float) -> None:
        self._made = made
        self._seconds = seconds

    async def sink(self) -> None:
        """Counts what comes, from the first to the last of it."""
        count = 0
        first = last = 0.0
        cpu = 0.0

        def on_sample() -> None:
            nonlocal count, first, last, cpu
            last = time.perf_counter()
            if not count:
                first, cpu = last, time.process_time()
            count += 1

        self._made.reader("rt/flood", on_sample)
        say("ready")
        awaited = int(await self._input_closed())
        end = time.perf_counter() + 20
        while count < awaited and time.perf_counter() < end:
            await asyncio.sleep(0.01)
        seconds = last - first
        say({"received": count, "seconds": seconds, "cpu": time.process_time() - cpu})

    async def source(self) -> None:
        """Writes as fast as it can."""
        write = self._made.writer("rt/flood")
        await self._matching(1)
        count = 0
        cpu = time.process_time()
        end = time.perf_counter() + self._seconds
        while time.perf_counter() < end:
            for _ in range(TURN):
                if not write():
                    break
                count += 1
            await asyncio.sleep(0)
        say({"sent": count})
        await self._input_closed()
        say({"cpu": time.process_time() - cpu})

    async def calm(self) -> None:
        """Writes a thousand samples a second."""
        write = self._made.writer("rt/flood")
        await self._matching(1)
        count = 0
        cpu = time.process_time()
        start = time.perf_counter()
        while (now := time.perf_counter()) < start + self._seconds:
            while count < (now - start) * 1000:
                write()
                count += 1
            await asyncio.sleep(start + count / 1000 - time.perf_counter())
        say({"sent": count})
        await self._input_closed()
        say({"cpu": time.process_time() - cpu})

    async def echo(self) -> None:
        """Answers."""
        write = self._made.writer("rt/back")
        self._made.reader("rt/there", write)
        say("ready")
        await self._input_closed()

    async def ping(self) -> None:
        """Asks again and again, and says how long the answers took, in microseconds."""
        loop = asyncio.get_running_loop()
        done = loop.create_future()
        times: list[float] = []
        end = sent = 0.0
        write = self._made.writer("rt/there")

        def on_sample() -> None:
            nonlocal sent
            now = time.perf_counter()
            times.append(now - sent)
            if now >= end and len(times) > WARM_UP:
                loop.call_soon_threadsafe(done.set_result, None)
                return
            sent = time.perf_counter()
            write()

        self._made.reader("rt/back", on_sample)
        await self._matching(2)
        await asyncio.sleep(0.2)
        sent = time.perf_counter()
        end = sent + self._seconds
        write()
        await done
        counted = sorted(times[WARM_UP:])
        p50, p99 = (counted[int(len(counted) * share)] * 1e6 for share in (0.5, 0.99))
        say({"round_trips": len(counted), "p50": p50, "p99": p99})
        await self._input_closed()

    async def one_side(self) -> None:
        """Has many endpoints, whose counterparts are the other side's."""
        await self._many("a", "b")

    async def other_side(self) -> None:
        """The counterpart."""
        await self._many("b", "a")

    async def _many(self, out: str, into: str) -> None:
        before = resident()
        start = time.perf_counter()
        for number in range(ENDPOINTS):
            self._made.writer(f"rt/{out}_{number}")
            self._made.reader(f"rt/{into}_{number}", lambda: None)
            if number % TURN == 0:
                await asyncio.sleep(0)
        made = time.perf_counter() - start
        say("ready")
        await self._matching(2 * ENDPOINTS)
        matched = time.perf_counter() - start
        await asyncio.sleep(0.5)
        cpu = time.process_time()
        await asyncio.sleep(self._seconds)
        idle = (time.process_time() - cpu) / self._seconds
        say({"made": made, "matched": matched, "idle": idle, "bytes": resident() - before})
        await self._input_closed()

    async def _matching(self, ends: int) -> None:
        async with asyncio.timeout(60):
            while self._made.matched() < ends:
                await asyncio.sleep(0.05)

    async def _input_closed(self) -> str:
        """What the input was."""
        return await asyncio.to_thread(sys.stdin.read)


def say(what: object) -> None:
    """To who has started this process."""
    print(json.dumps(what), flush=True)


def resident() -> int:
    """Bytes of memory in use."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


IMPLEMENTATIONS: dict[str, Callable[[int, int], Implementation]] = {
    "muros": Muros,
    "rtps": Rtps,
    "bare": Bare,
    "cyclone": Cyclone,
    "rclpy": Rclpy,
}


def main() -> None:
    """The program."""
    implementation, role, domain, size, seconds = sys.argv[1:]
    made = IMPLEMENTATIONS[implementation](int(domain), int(size))
    made.run(getattr(Roles(made, float(seconds)), role))


if __name__ == "__main__":
    main()
