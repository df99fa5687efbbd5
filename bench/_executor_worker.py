"""One measure of one executor, as a process: `bench_executor.py` starts it, in the Python that has the implementation.

    python _executor_worker.py muros|rclpy MEASURE SECONDS [URL]

Prints one JSON object. Both implementations do the same work with the same few lines; what differs is in two classes.
"""

import json
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

WARM = 0.3
"""Seconds that are not counted."""
PATIENCE = 10.0
"""Seconds until both ends of a topic or service have met."""


class Muros:
    """A context, a node and an executor of muros."""

    def __init__(self, url: str) -> None:
        from muros.rclc import Context, Executor

        from example_interfaces.srv import AddTwoInts
        from std_msgs.msg import Int32

        self._context = Context(url)
        self._node = self._context.node("bench")
        self._executor = Executor(self._context)
        self._number, self._sum = Int32, AddTwoInts

    def timer(self, period: float, callback: Callable[[], object]) -> None:
        self._node.timer(period, callback)

    def guard(self, callback: Callable[[], object]) -> Callable[[], object]:
        from muros.rclc import GuardCondition

        trigger: Callable[[], object] = GuardCondition(self._context, callback).trigger
        return trigger

    def topic(self, name: str, callback: Callable[[int], object]) -> Callable[[int], object]:
        kind = self._number
        self._node.subscription(kind, name, lambda message: callback(message.data))
        publish = self._node.publisher(kind, name).publish
        return lambda number: publish(kind(data=number))

    def service(self, name: str, callback: Callable[[int], object]) -> Callable[[int], object]:
        request, response = self._sum.Request, self._sum.Response
        self._node.service(self._sum, name, lambda asked: response(sum=asked.a + asked.b))
        client = self._node.client(self._sum, name)
        return lambda number: client.send(request(a=number, b=1), lambda reply: callback(reply.sum))

    def spin(self, over: Callable[[], bool]) -> None:
        while not over():
            self._executor.spin_some(0.1)

    def close(self) -> None:
        self._context.close()


class Rclpy:
    """A node of rclpy and its SingleThreadedExecutor."""

    def __init__(self, url: str) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor

        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=int(url.partition(":")[2]))
        self._node = rclpy.create_node("bench", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)

    def timer(self, period: float, callback: Callable[[], object]) -> None:
        self._node.create_timer(period, callback)

    def guard(self, callback: Callable[[], object]) -> Callable[[], object]:
        trigger: Callable[[], object] = self._node.create_guard_condition(callback).trigger
        return trigger

    def topic(self, name: str, callback: Callable[[int], object]) -> Callable[[int], object]:
        from std_msgs.msg import Int32

        self._node.create_subscription(Int32, name, lambda message: callback(message.data), 10)
        publish = self._node.create_publisher(Int32, name, 10).publish
        return lambda number: publish(Int32(data=number))

    def service(self, name: str, callback: Callable[[int], object]) -> Callable[[int], object]:
        from example_interfaces.srv import AddTwoInts

        def answer(request: Any, response: Any) -> Any:
            response.sum = request.a + request.b
            return response

        self._node.create_service(AddTwoInts, name, answer)
        client = self._node.create_client(AddTwoInts, name)
        if not client.wait_for_service(PATIENCE):
            raise SystemExit("the service did not come")

        def ask(number: int) -> None:
            future = client.call_async(AddTwoInts.Request(a=number, b=1))
            future.add_done_callback(lambda done: callback(done.result().sum))

        return ask

    def spin(self, over: Callable[[], bool]) -> None:
        while not over():
            self._executor.spin_once(0.1)

    def close(self) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.shutdown()


class Counter:
    """Counts callbacks once they are warm, for so many seconds."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self.begin()

    def begin(self) -> None:
        """Begins anew."""
        self.count = 0
        self._begin = time.perf_counter() + WARM
        self._end = self._begin + self._seconds
        self._began = 0.0
        self._cpu = 0.0

    def __call__(self, _: int = 0) -> None:
        self.count += 1

    def over(self) -> bool:
        """Whether the time is over."""
        now = time.perf_counter()
        if self._cpu == 0.0 and now >= self._begin:
            self._began, self._cpu, self.count = now, time.process_time(), 0
        return now >= self._end

    def result(self) -> dict[str, float]:
        """Callbacks per second, and microseconds of processor time of each."""
        spent, cpu = time.perf_counter() - self._began, time.process_time() - self._cpu
        return {"rate": self.count / spent, "cpu": cpu / max(self.count, 1) * 1e6}


def timers(bench: Any, seconds: float, number: int = 1) -> dict[str, Any]:
    """Timers that are always ready."""
    counter = Counter(seconds)
    for _ in range(number):
        bench.timer(0.0, counter)
    bench.spin(counter.over)
    return counter.result()


def guards(bench: Any, seconds: float) -> dict[str, Any]:
    """A guard condition that triggers itself."""
    counter = Counter(seconds)

    def again() -> None:
        counter()
        trigger()

    trigger = bench.guard(again)
    trigger()
    bench.spin(counter.over)
    return counter.result()


def chain(bench: Any, seconds: float) -> dict[str, Any]:
    """A message whose callback publishes the next."""
    times: list[float] = []
    last = 0.0
    counter = Counter(seconds)

    def again(number: int) -> None:
        nonlocal last
        now = time.perf_counter()
        times.append(now - last)
        counter()
        last = now
        if number >= 0:  # not while the ends meet
            publish(number + 1)

    publish = bench.topic("chain", again)
    _meet(bench, publish, times)
    counter.begin()
    last = time.perf_counter()
    publish(0)
    bench.spin(counter.over)
    return counter.result() | _percentiles(times[-counter.count :])


def stream(bench: Any, seconds: float, topics: int = 10) -> dict[str, Any]:
    """Ten topics; each pass of a timer publishes on all of them."""
    heard: list[int] = []
    counter = Counter(seconds)

    def hear(number: int) -> None:
        counter()
        heard.append(number)

    publishers = [bench.topic(f"stream_{i}", hear) for i in range(topics)]
    for publish in publishers:
        heard.clear()
        _meet(bench, publish, heard)

    def send() -> None:
        for publish in publishers:
            publish(1)

    bench.timer(0.001, send)
    counter.begin()
    bench.spin(counter.over)
    return counter.result()


def services(bench: Any, seconds: float) -> dict[str, Any]:
    """A request whose reply sends the next: two callbacks, of the server and of the client."""
    times: list[float] = []
    last = time.perf_counter()

    def again(number: int) -> None:
        nonlocal last
        now = time.perf_counter()
        times.append(now - last)
        counter()
        last = now
        ask(number)

    ask = bench.service("sum", again)
    counter = Counter(seconds)
    ask(0)
    bench.spin(counter.over)
    return counter.result() | _percentiles(times[-counter.count :])


def calm(bench: Any, seconds: float) -> dict[str, Any]:
    """A message each 10 ms, so that the executor sleeps before it: from publish to callback."""
    times: list[float] = []
    last = 0.0
    counter = Counter(seconds)

    def hear(number: int) -> None:
        times.append(time.perf_counter() - last)
        counter()

    def send() -> None:
        nonlocal last
        last = time.perf_counter()
        publish(1)

    publish = bench.topic("calm", hear)
    _meet(bench, publish, times)
    bench.timer(0.01, send)
    counter.begin()
    bench.spin(counter.over)
    return counter.result() | _percentiles(times[-counter.count :])


def jitter(bench: Any, seconds: float, period: float) -> dict[str, Any]:
    """A timer: by how much the time between two calls differs from the period, and how many calls were missed."""
    stamps: list[float] = []
    bench.timer(period, lambda: stamps.append(time.perf_counter()))
    begin = time.perf_counter()
    bench.spin(lambda: time.perf_counter() > begin + WARM + seconds)
    stamps = [stamp for stamp in stamps if stamp > begin + WARM]
    off = [abs(b - a - period) * 1e6 for a, b in pairwise(stamps)]
    expected = round((stamps[-1] - stamps[0]) / period) if off else int(seconds / period)
    result: dict[str, Any] = {"calls": len(stamps), "missed": max(0, expected - len(off)), "off": off}
    if off:
        ordered = sorted(off)
        result |= {"mean": sum(off) / len(off), "p99": ordered[len(off) * 99 // 100], "max": ordered[-1]}
    return result


def _meet(bench: Any, publish: Callable[[int], object], heard: list[Any]) -> None:
    """Publishes until something is heard, then waits until nothing more comes."""
    end = time.monotonic() + PATIENCE
    while not heard:
        if time.monotonic() > end:
            raise SystemExit("the topic's ends did not meet")
        publish(-1)
        _pass(bench, 0.05)
    while heard:
        heard.clear()
        _pass(bench, 0.2)


def _pass(bench: Any, seconds: float) -> None:
    end = time.monotonic() + seconds
    bench.spin(lambda: time.monotonic() > end)


def _percentiles(times: list[float]) -> dict[str, float]:
    ordered = sorted(times)
    if not ordered:
        return {}
    return {"p50": ordered[len(ordered) // 2] * 1e6, "p99": ordered[len(ordered) * 99 // 100] * 1e6}


MEASURES: dict[str, Callable[[Any, float], dict[str, Any]]] = {
    "timer": timers,
    "10 timers": lambda bench, seconds: timers(bench, seconds, 10),
    "guard condition": guards,
    "message": chain,
    "10 messages": stream,
    "service": services,
    "calm message": calm,
    "100 Hz": lambda bench, seconds: jitter(bench, seconds, 0.01),
    "1 kHz": lambda bench, seconds: jitter(bench, seconds, 0.001),
}


def main(implementation: str, measure: str, seconds: str, url: str) -> None:
    """Prints what was measured."""
    bench = Muros(url) if implementation == "muros" else Rclpy(url)
    print(json.dumps(MEASURES[measure](bench, float(seconds))), flush=True)
    bench.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
