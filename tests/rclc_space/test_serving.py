"""Who runs the spaces: one thread or several, inside an asyncio program, in forks, at the end of a program."""

import asyncio
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

from muros.agent import Agent
from muros.client import Qos, Udp
from muros.links import UdpLink
from muros.rclc import Context, Executor, RclError
from muros.space import Space, open_space
from muros.space.rclc import _serving
from tests.rclc_space.ways import PATIENCE

from std_msgs.msg import Int32


def listen(context: Context, topic: str, got: list[int]) -> None:
    """Keeps what comes on a topic."""
    context.node("listener").subscription(Int32, topic, lambda message: got.append(message.data))


def talk(context: Context, topic: str) -> Any:
    """A publisher."""
    return context.node("talker").publisher(Int32, topic, Qos(depth=1000))


def asleep() -> None:
    """Waits until somebody sleeps in the loop."""
    _until(lambda: _serving.server().asleep)


def _waiting(followers: int) -> bool:
    """Whether somebody sleeps in the loop, and so many others wait beside him."""
    serving = _serving.server()
    return serving._followers == followers and serving.asleep


def _until(condition: Callable[[], Any]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.001)


def run(work: Callable[[], object]) -> threading.Thread:
    """Does something in another thread."""
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def over(*threads: threading.Thread) -> None:
    """The threads have ended by themselves."""
    for thread in threads:
        thread.join(PATIENCE)
        assert not thread.is_alive()


class Counting(_serving._Selector):
    """A selector that counts how often it was asked."""

    count = 0

    def select(self, timeout: float | None = None) -> Any:
        """Counts."""
        type(self).count += 1
        return super().select(timeout)


def test_waiting_is_sleeping(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_serving, "_Selector", Counting)
    monkeypatch.setattr(Counting, "count", 0)
    context = Context(url)
    calls: list[int] = []
    context.node("node").timer(0.05, lambda: calls.append(1))
    executor = Executor(context)
    while len(calls) < 3:
        executor.spin_some(1.0)
    assert Counting.count < 20, "it does not look again and again"
    context.close()


@pytest.mark.skipif(not _serving._EPOLL, reason="no epoll here")
def test_short_waits_are_not_rounded_up_to_milliseconds(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []
    original = select.select

    def watched(read: Any, write: Any, failed: Any, seconds: float) -> Any:
        asked.append(seconds)
        return original(read, write, failed, seconds)

    monkeypatch.setattr(select, "select", watched)
    context = Context("local:")
    while not asked:
        context.middleware.wait(0.25)  # type: ignore[arg-type]
    context.close()
    assert 0 < asked[0] <= 0.00025


def test_what_comes_from_another_thread_wakes_who_waits(url: str) -> None:
    here, there = Context(url), Context(url)
    got: list[int] = []
    listen(there, "value", got)
    publisher = talk(here, "value")
    executor = Executor(there)
    for i in range(20):
        thread = run(lambda: executor.spin_some(60.0))
        asleep()
        assert publisher.publish(Int32(data=i))
        over(thread)
    assert got == list(range(20))
    here.close()
    there.close()


def test_of_two_that_wait_one_serves_and_hands_over(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONASYNCIODEBUG", "1")  # which has loops look for calls of other threads
    contexts = [Context(url) for _ in range(3)]
    got: list[list[int]] = [[], []]
    for i in range(2):
        listen(contexts[i], f"value_{i}", got[i])
    publishers = [talk(contexts[2], f"value_{i}") for i in range(2)]
    serving = _serving.server()
    for first in (0, 1):
        threads = []
        for i in range(2):
            threads.append(run(partial(Executor(contexts[i]).spin_some, 60.0)))
            _until(partial(_waiting, i))
        publishers[first].publish(Int32(data=1))
        over(threads[first])
        asleep()
        other = 1 - first
        # only the loop does this, so the one that is left has to run it
        with serving.lock:
            serving.loop.call_later(0.001, publishers[other].publish, Int32(data=2))
        over(threads[other])
    assert got == [[1, 2], [2, 1]]
    for context in contexts:
        context.close()


def test_publishing_from_many_threads(url: str) -> None:
    talkers = [Context(url) for _ in range(3)]
    listener = Context(url)
    got: list[int] = []
    listener.node("listener").subscription(
        Int32, "value", lambda message: got.append(message.data), Qos(depth=1000)
    )
    executor = Executor(listener)

    def work(which: int) -> None:
        publisher = talk(talkers[which], "value")
        for i in range(200):
            publisher.publish(Int32(data=which * 1000 + i))

    threads = [run(partial(work, i)) for i in range(3)]
    end = time.monotonic() + PATIENCE
    while len(got) < 600:
        assert time.monotonic() < end
        executor.spin_some(0.1)
    over(*threads)
    for which in range(3):
        assert [n % 1000 for n in got if n // 1000 == which] == list(range(200))
    for context in (*talkers, listener):
        context.close()


@pytest.mark.parametrize("end", ["close", "wake"])
def test_ending_a_wait_from_another_thread(url: str, end: str) -> None:
    context = Context(url)
    middleware: Any = context.middleware
    thread = run(lambda: middleware.wait(60_000))
    asleep()
    getattr(middleware, end)()
    over(thread)
    context.close()


def test_inside_an_asyncio_program(url: str) -> None:
    async def main() -> list[int]:
        talker, listener = Context(url), Context(url)
        got: list[int] = []
        listen(listener, "value", got)
        publisher = talk(talker, "value")
        executor = Executor(listener)
        executor.add(listener.handles[0])
        ticks = 0

        async def clock() -> None:
            nonlocal ticks
            while True:
                await asyncio.sleep(0)
                ticks += 1

        task = asyncio.create_task(clock())
        for i in range(5):
            publisher.publish(Int32(data=i))
            while len(got) <= i:
                executor.spin_some(0.001)
                await asyncio.sleep(0)
        assert ticks, "others had their turn"
        task.cancel()
        talker.close()
        listener.close()
        return got

    assert asyncio.run(main()) == list(range(5))


def test_a_space_that_the_program_s_own_loop_serves() -> None:
    async def main() -> None:
        with open_space("local:") as space:
            space.attach(asyncio.get_running_loop())
            one, other = Context(space), Context(space)
            got: list[int] = []
            listen(other, "value", got)
            publisher = talk(one, "value")
            executor = Executor(other)
            publisher.publish(Int32(data=1))
            while not got:
                executor.spin_some()
                await asyncio.sleep(0)
            with pytest.raises(RclError, match=r"waiting would stop the asyncio loop.*spin_async"):
                executor.spin()
            with pytest.raises(RclError, match="Make the context in the thread of that loop"):
                await asyncio.to_thread(Context, space)
            one.close()
            other.close()
            assert not space.closed

    asyncio.run(main())


def test_a_node_shares_the_space_of_an_agent_in_one_program() -> None:
    async def main() -> None:
        link = UdpLink(0, "127.0.0.1")
        with open_space("local:") as space:
            context = Context(space)
            got: list[int] = []
            listen(context, "value", got)
            executor = Executor(context)
            agent = Agent(space)
            agent.add_link(link)
            await agent.start()
            board = run(partial(_board, link.port))
            while not got:
                executor.spin_some()
                await asyncio.sleep(0.001)
            assert got[0] == 5
            context.node("ender").publisher(Int32, "end").publish(Int32())
            while board.is_alive():
                await asyncio.sleep(0.001)
            agent.close()
            context.close()

    asyncio.run(asyncio.wait_for(main(), PATIENCE))


def _board(port: int) -> None:
    """Publishes through the agent until it is told to end."""
    context = Context(Udp("127.0.0.1", port))
    publisher = talk(context, "value")
    context.node("ear").subscription(Int32, "end", lambda message: setattr(context, "running", False))
    context.node("heart").timer(0.01, lambda: publisher.publish(Int32(data=5)))
    Executor(context).spin()
    context.close()


def test_a_space_that_a_loop_elsewhere_serves() -> None:
    loop = asyncio.new_event_loop()
    with open_space("local:") as space:
        space.attach(loop)
        with pytest.raises(
            RclError, match=r"another event loop.*Make the context in the thread of that loop"
        ):
            Context(space)
        loop.close()
        Context(space).close()


def test_a_callback_of_the_space_cannot_wait() -> None:
    with open_space("local:") as space:
        context = Context(space)
        context.node("node")
        failures: list[str] = []
        space.findings.on_finding(lambda finding: failures.append(finding.format()))
        _serving.server().loop.call_soon(_report, space, lambda: Executor(context).spin_some(1.0))
        Executor(context).spin_some()
        assert "a callback of the space cannot wait" in failures[0]
        context.close()


def _report(space: Space, work: Callable[[], object]) -> None:
    """Does something on the loop, as a watcher of the graph might."""
    cancel = space.graph.watch(lambda event: work())
    space.participant("new").close()
    cancel()


def test_nothing_is_left_of_the_last_context(url: str) -> None:
    Context(url).close()
    assert _serving.server()._loop is None
    context = Context(url)
    loop: Any = _serving.server().loop
    context.close()
    assert loop.is_closed()


FORK = """
import os, sys
from muros.rclc import Context, Executor
from std_msgs.msg import Int32

def work():
    context = Context(sys.argv[1])
    got = []
    node = context.node("node")
    node.subscription(Int32, "value", lambda message: got.append(message.data))
    node.publisher(Int32, "value").publish(Int32(data=3))
    Executor(context).spin_some(5.0)
    return context, got

context, got = work()
child = os.fork()
if child == 0:
    inner, again = work()
    os._exit(0 if again == [3] else 1)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
print(got)
"""

END = """
import sys
from muros.rclc import Context, Executor
from muros.space import open_space
from std_msgs.msg import Int32

space = open_space("local:")
for context in (Context(sys.argv[1]), Context(space)):
    context.on_state(print)
    node = context.node("node")
    node.publisher(Int32, "value", "sensor_data")
    Executor(context).spin_some()
    node.subscription(Int32, "value", print)
print("over")
"""


@pytest.mark.parametrize(
    ("program", "out", "err"),
    [
        (FORK, "[3]\n", ""),
        (END, "CONNECTED\nCONNECTED\nover\nWAITING\nWAITING\n", "muros: /node gets no rt/value from /node"),
    ],
    ids=["fork", "end"],
)
def test_programs_that_end_without_a_word(url: str, program: str, out: str, err: str) -> None:
    done = subprocess.run(
        [sys.executable, "-X", "dev", "-c", program, url], capture_output=True, text=True, timeout=30
    )
    assert (done.returncode, done.stdout) == (0, out)
    lines = done.stderr.splitlines()
    assert [line.startswith(err) for line in lines] == [True] * (2 if err else 0), done.stderr


CTRL_C = """
from muros.rclc import Context, Executor
context = Context("local:")
context.on_state(lambda state: print(state, flush=True))
context.node("node")
Executor(context).spin()
print("after")
"""


def test_ctrl_c_on_a_program() -> None:
    process = subprocess.Popen(
        [sys.executable, "-X", "dev", "-c", CTRL_C],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "CONNECTED\n"
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    finally:
        process.kill()
        process.wait()
    assert (process.returncode, out, err) == (0, "WAITING\nafter\n", "")
