"""Several threads use one session with a real agent: nothing is lost, mixed up or waited for in vain."""

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from struct import pack, unpack
from typing import Any

import pytest

from muros.client import CONNECTED, Custom, Qos, Session, Tcp, Udp
from muros.client.raw import Raw
from muros.client.sharing import Turnstile
from muros.compat import ticks_ms
from muros.links import TcpLink, UdpLink
from tests.client.agent_thread import PATIENCE, RunningAgent

WRITERS = 4
SAMPLES = 150
TYPE = "std_msgs/msg/String"
SERVICE = "std_srvs/srv/Empty"
SMALL = 8
LARGE = 1500
"""Bytes of a sample that needs fragments: three messages of 512 bytes."""
LONG = 60_000
"""Milliseconds that nobody waits unless a waking was missed: the time limit of the test ends it first."""


class Spinner:
    """A session that a thread of its own spins, waiting as long as it may."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.ending = False
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self) -> None:
        session = self.session
        while not self.ending:
            session.spin_once()
            if not self.ending:
                session.wait(session.deadline(ticks_ms()))

    def end(self) -> None:
        """Ends the thread."""
        self.ending = True
        self.session.wake()
        self.thread.join(PATIENCE)
        assert not self.thread.is_alive()


class Stage:
    """An agent, and sessions with it that threads spin."""

    def __init__(self) -> None:
        self.udp = UdpLink(0, "127.0.0.1")
        self.tcp = TcpLink(0, "127.0.0.1")
        self.agent = RunningAgent(self.udp, self.tcp)
        self.spinners: list[Spinner] = []

    def session(self, transport: Any = None, **options: Any) -> Session:
        """A session, over UDP unless told else."""
        session = Session(transport or Udp("127.0.0.1", self.udp.port), **options)
        session.on_problem = lambda code, text: None  # that the window is full is told, and tried again
        self.spinners.append(Spinner(session))
        return session

    def close(self) -> None:
        """Ends everything."""
        for spinner in self.spinners:
            spinner.end()
            spinner.session.close()
        self.agent.stop()


@pytest.fixture(autouse=True)
def _hasty() -> Iterator[None]:
    """Threads change places as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.fixture
def stage() -> Iterator[Stage]:
    """A stage."""
    made = Stage()
    yield made
    made.close()


def until(condition: Callable[[], Any]) -> None:
    """Waits until a condition holds."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "it did not come about"
        time.sleep(0.001)


def whole(session: Session) -> bool:
    """Whether a session is connected, and all that was made in it has been created."""
    return session.state == CONNECTED and not any(entity.todo for entity in session.entities)


def together(function: Callable[[int], object]) -> None:
    """Calls a function in several threads at once, with the number of each."""
    threads = [threading.Thread(target=function, args=(number,), daemon=True) for number in range(WRITERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(3 * PATIENCE)
        assert not thread.is_alive()


@pytest.mark.parametrize("size", [SMALL, LARGE])
@pytest.mark.parametrize("queue", [0, 16])
@pytest.mark.parametrize("link", ["udp", "tcp"])
def test_threads_publish_on_one_session(stage: Stage, link: str, queue: int, size: int) -> None:
    session = stage.session(Tcp("127.0.0.1", stage.tcp.port) if link == "tcp" else None, queue=queue)
    other = stage.session(largest=2 * LARGE)
    got: dict[int, list[int]] = {number: [] for number in range(WRITERS)}
    wrong: list[bytes] = []

    def take(buf: Any, off: int, n: int) -> None:
        number, i = unpack("<II", bytes(buf[off : off + 8]))
        if bytes(buf[off + 8 : off + n]) != bytes([number]) * (size - 8):
            wrong.append(bytes(buf[off : off + n]))
        got[number].append(i)

    qos = Qos(depth=WRITERS * SAMPLES)
    node, far = session.participant("talker"), other.participant("listener")
    writers = [session.writer(node, f"rt/t{number}", TYPE, qos) for number in range(WRITERS)]
    for number in range(WRITERS):
        other.reader(far, f"rt/t{number}", TYPE, qos, take)
    until(lambda: whole(session) and whole(other))

    def publish(number: int) -> None:
        for i in range(SAMPLES):
            body = pack("<II", number, i) + bytes([number]) * (size - 8)
            end = time.monotonic() + PATIENCE
            while not writers[number].write_bytes(body):
                assert time.monotonic() < end, "no room for a sample"
                os.sched_yield()

    together(publish)
    until(lambda: sum(map(len, got.values())) >= WRITERS * SAMPLES)
    assert got == {number: list(range(SAMPLES)) for number in range(WRITERS)}
    assert wrong == []


def test_threads_ask_services_and_make_things_at_once(stage: Stage) -> None:
    server, session = stage.session(), stage.session()
    near = server.participant("server")

    def answer(identity: bytes, buf: Any, off: int, n: int) -> None:
        assert replier.reply(identity, Raw(bytes(buf[off : off + n])))

    replier = server.replier(near, "/echo", SERVICE, answer)
    until(lambda: whole(server))
    node = session.participant("client")
    answers: dict[int, list[tuple[int, int]]] = {number: [] for number in range(WRITERS)}

    def ask(number: int) -> None:
        def take(request: int, buf: Any, off: int, n: int) -> None:
            answers[number].append((request, bytes(buf[off : off + n])[0]))

        requester = session.requester(node, "/echo", SERVICE, take)
        for i in range(20):
            sent = 0
            while not sent:
                sent = requester.send(Raw(bytes([i])))
                os.sched_yield()
            until(lambda i=i, sent=sent: (sent, i) in answers[number])  # type: ignore[misc]
        requester.destroy()

    together(ask)
    assert [[i for _, i in mine] for mine in answers.values()] == [list(range(20))] * WRITERS


def test_another_thread_pings_and_closes_while_one_waits(stage: Stage) -> None:
    session = stage.session(keepalive=LONG)
    until(lambda: session.state == CONNECTED)
    assert all(session.ping(1000 * int(PATIENCE)) for _ in range(10))
    session.close()
    until(lambda: session.state != CONNECTED)


def test_who_waits_is_woken_and_so_is_who_is_about_to_wait() -> None:
    gate = Turnstile()
    gate.look()
    gate.wait(None, 0)  # one thread alone: nothing has happened
    looked = threading.Event()
    passed: list[int] = []

    def wait(number: int) -> None:
        gate.look()
        looked.set()
        gate.wait(None, LONG)
        passed.append(number)

    threads = [threading.Thread(target=wait, args=(number,), daemon=True) for number in range(3)]
    for thread in threads:
        looked.clear()
        thread.start()
        assert looked.wait(PATIENCE)
    gate.wake()  # some wait, others are about to
    for thread in threads:
        thread.join(PATIENCE)
    assert sorted(passed) == [0, 1, 2]


def test_a_thread_may_wake_itself_as_handlers_of_signals_do() -> None:
    gate = Turnstile()
    gate.look()
    gate.wake()
    gate.wait(None, LONG)
    gate.look()
    gate.wake(others=True)
    gate.wait(None, 1)  # it knows: so it waits


def test_the_leader_gets_up_for_what_is_due_sooner() -> None:
    gate = Turnstile()

    def wait() -> None:
        gate.look()
        gate.wait(None, LONG)

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    until(lambda: gate._sleeping)
    before = gate._generation
    gate.due(ticks_ms() + 2 * LONG)
    assert gate._generation == before  # it gets up before that anyway
    gate.due(ticks_ms() + LONG // 2)
    thread.join(PATIENCE)
    assert not thread.is_alive()


def test_who_is_about_to_sleep_hears_of_what_is_due_sooner() -> None:
    gate = Turnstile()
    looked, due = threading.Event(), threading.Event()

    def wait() -> None:
        gate.look()
        looked.set()
        assert due.wait(PATIENCE)
        gate.wait(None, LONG)

    thread = threading.Thread(target=wait, daemon=True)
    assert not gate.leading  # nobody has looked
    thread.start()
    assert looked.wait(PATIENCE)
    assert gate.leading
    gate.due(ticks_ms() + 1)
    gate.due(ticks_ms() + LONG // 2)  # the first is what counts
    due.set()
    thread.join(PATIENCE)
    assert not thread.is_alive()


def test_what_is_made_while_another_thread_is_about_to_sleep_is_asked_for(stage: Stage) -> None:
    session = stage.session(keepalive=LONG)
    until(lambda: session.state == CONNECTED)
    looked, made = threading.Event(), threading.Event()
    sleep = session.wait

    def wait(timeout: int) -> None:
        looked.set()
        assert made.wait(PATIENCE)
        sleep(timeout)

    session.wait = wait  # type: ignore[method-assign]
    session.wake()
    assert looked.wait(PATIENCE)
    session.participant("node")
    made.set()
    until(lambda: whole(session))


def test_a_transport_of_ones_own_is_left_now_and_then() -> None:
    """Nobody can wake it, so it is not slept in for long once there are several threads."""
    waits: list[int] = []

    own = Custom(lambda: True, lambda: None, lambda buf, off, n: None, lambda buf: None, wait=waits.append)
    gate = Turnstile()
    gate.look()
    gate.wait(own, LONG)
    gate.wake()
    gate.look()
    gate.wait(own, LONG)
    assert waits == [LONG, 10]
