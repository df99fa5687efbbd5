"""Wrong use of rclc is said at once and in one line; Ctrl-C ends a program in peace."""

import re
import signal
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest

from muros.client import Session, Udp
from muros.client.raw import Raw
from muros.links import UdpLink
from muros.rclc import Context, Executor, InvalidNameError, Node, RclError, all_of, any_of, one
from tests.client.agent_thread import RunningAgent
from tests.client.world import World
from tests.rclc.test_rclc import Board, two

from example_interfaces.action import Fibonacci
from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32, String

FIVE: Any = 5


def nothing(*_: object) -> None:
    """A callback."""


CASES: list[tuple[Callable[[Any], object], type[Exception], int, str]] = [
    (lambda n: n.publisher(Int32, "a b"), InvalidNameError, 103, "'ns/a b': names are made of letters"),
    (lambda n: n.subscription(Int32, "/1x/é", nothing), InvalidNameError, 103, "'1x/é': names are made of"),
    (lambda n: n.publisher(Int32, ""), InvalidNameError, 103, "a topic or service needs a name"),
    (lambda n: n.publisher(Int32, "x" * 60), InvalidNameError, 103, "is too long: 66 characters"),
    (lambda n: n.service(AddTwoInts, "a-b", nothing), InvalidNameError, 104, "'ns/a-b'"),
    (lambda n: n.client(AddTwoInts, "a//b"), InvalidNameError, 104, "'ns/a//b'"),
    (lambda n: n.context.node("x" * 60), InvalidNameError, 201, "node " + "x" * 60 + " is too long"),
    (lambda n: n.context.node(5), TypeError, 11, "the name of a node is a str, not 5"),
    (lambda n: n.publisher(Int32, 5), TypeError, 11, "the name of a topic or service is a str, not 5"),
    (
        lambda n: n.publisher(AddTwoInts, "t"),
        TypeError,
        11,
        "example_interfaces/srv/AddTwoInts is no message",
    ),
    (lambda n: n.publisher(Int32(), "t"), TypeError, 11, "the class Int32 itself, not an object of it"),
    (lambda n: n.publisher(str, "t"), TypeError, 11, "such as std_msgs.msg.Int32, not <class 'str'>"),
    (lambda n: n.subscription(None, "t", nothing), TypeError, 11, "such as std_msgs.msg.Int32, not None"),
    (
        lambda n: n.subscription(Int32, "t", 5),
        TypeError,
        11,
        "the callback of a subscription is a function, not 5",
    ),
    (lambda n: n.service(Int32, "s", nothing), TypeError, 11, "std_msgs/msg/Int32 is no service"),
    (
        lambda n: n.service(AddTwoInts, "s", None),
        TypeError,
        11,
        "the callback of a service is a function, not None",
    ),
    (lambda n: n.client(Int32, "s"), TypeError, 11, "std_msgs/msg/Int32 is no service"),
    (lambda n: n.client(5, "s"), TypeError, 11, "such as example_interfaces.srv.AddTwoInts, not 5"),
    (
        lambda n: n.publisher(Int32, "t").publish(3),
        TypeError,
        11,
        "publish takes std_msgs/msg/Int32 here, not 3",
    ),
    (lambda n: n.publisher(Int32, "t").publish(String()), TypeError, 11, "here, not std_msgs/msg/String"),
    (
        lambda n: n.client(AddTwoInts, "s").call(3),
        TypeError,
        11,
        "example_interfaces/srv/AddTwoInts_Request here",
    ),
    (
        lambda n: n.client(AddTwoInts, "s").send(AddTwoInts.Request(), 3),
        TypeError,
        11,
        "on_reply is a function",
    ),
    (
        lambda n: n.timer(-1, nothing),
        ValueError,
        11,
        "the period of a timer is -1: it must be a number of seconds",
    ),
    (lambda n: n.timer("1", nothing), ValueError, 11, "the period of a timer is '1'"),
    (lambda n: n.timer(float("nan"), nothing), ValueError, 11, "the period of a timer is nan"),
    (lambda n: n.timer(1, None), TypeError, 11, "the callback of a timer is a function, not None"),
    (
        lambda n: Context(Udp("127.0.0.1"), domain_id=99999),
        ValueError,
        11,
        "domain_id is 99999: it must be from 0 to 232",
    ),
    (
        lambda n: Context(None),
        TypeError,
        11,
        "Context needs a transport such as Udp('192.168.1.10', 8888), not None",
    ),
    (lambda n: Context(Udp), TypeError, 11, "Context needs a transport"),
    (lambda n: Context(Session(Udp("127.0.0.1")), 5), TypeError, 11, "client_key belongs to the session"),
    (lambda n: Executor(n), TypeError, 11, "Executor needs a context"),
    (lambda n: Executor(n.context, handles=-1), ValueError, 11, "handles is -1"),
    (lambda n: Executor(n.context, trigger=FIVE), TypeError, 11, "trigger is a function, not 5"),
    (lambda n: Executor(n.context).add(5), TypeError, 11, "an executor cannot run 5: add subscriptions"),
    (
        lambda n: Executor(n.context).add(n.client(AddTwoInts, "s"), FIVE),
        TypeError,
        11,
        "the callback of a handle",
    ),
    (lambda n: Executor(n.context).spin_period(0), ValueError, 11, "period is 0"),
    (
        lambda n: n.parameters().on_change(FIVE),
        TypeError,
        11,
        "the callback of a change is a function, not 5",
    ),
    (
        lambda n: n.action_client(Fibonacci, "f").cancel(FIVE),
        TypeError,
        11,
        "a goal is 16 bytes, as of goal.id, not 5",
    ),
    (
        lambda n: n.action_client(Fibonacci, "f").cancel(stamp=FIVE),
        TypeError,
        11,
        "stamp is (seconds, nanoseconds)",
    ),
    (
        lambda n: n.action_client(Fibonacci, "f").cancel(on_answer=FIVE),
        TypeError,
        11,
        "on_answer is a function",
    ),
    (lambda n: n.parameters().get(FIVE), TypeError, 11, "the name of a parameter is a str, not 5"),
    (lambda n: n.parameters().set(FIVE, 1), TypeError, 11, "the name of a parameter is a str, not 5"),
    (lambda n: n.parameters().update(FIVE), TypeError, 11, "set by a dict of names and values, not 5"),
]


@pytest.mark.parametrize(("use", "kind", "code", "said"), CASES, ids=[case[3] for case in CASES])
def test_wrong_use(use: Callable[[Node], object], kind: type[Exception], code: int, said: str) -> None:
    board = Board(World())
    node = board.context.node("node", "ns")
    handles, entities = list(board.context.handles), list(board.session.entities)
    with pytest.raises(kind, match=re.escape(said)) as caught:
        use(node)
    assert getattr(caught.value, "code", None) == code
    assert "\n" not in str(caught.value)
    if "needs" not in said:
        assert board.context.handles[: len(handles)] == handles
    assert board.session.entities[: len(entities)] == entities


@pytest.mark.parametrize("make", ["publisher", "subscription", "service", "client"])
def test_what_was_refused_leaves_nothing_behind(make: str) -> None:
    board = Board(World())
    kind = AddTwoInts if make in ("service", "client") else Int32
    callback = [nothing] if make in ("subscription", "service") else []
    with pytest.raises(ValueError, match="is too long"):
        getattr(board.node, make)(kind, "x" * 60, *callback)
    assert board.context.handles == []
    assert board.node.entities == []
    assert len(board.session.entities) == 1, "the participant"


def test_urls_are_for_spaces_and_middlewares_that_are_registered() -> None:
    with pytest.raises(
        ValueError, match=r"known: local:.*Through an agent: Context\(Udp\('127.0.0.1', 8888\)\)"
    ):
        Context("nothing:")


def test_a_service_whose_callback_returns_nonsense_is_named() -> None:
    world = World()
    alice, bob = two(world)
    alice.node.service(AddTwoInts, "add", lambda request: 5)
    client = bob.node.client(AddTwoInts, "add")
    server = alice.executor()
    alice.connect()
    bob.connect()
    client.send(AddTwoInts.Request(), nothing)

    def ask() -> None:
        for _ in range(50):
            alice.spin(server, 5)
            bob.spin(bob.executor(), 5)

    with pytest.raises(
        TypeError,
        match=r"service '/add' was answered with 5. Its callback returns AddTwoInts.Response\(\.\.\.\)",
    ):
        ask()


def test_a_service_of_the_same_context_cannot_be_called_but_asked() -> None:
    world = World()
    board = Board(world)
    service = board.node.service(AddTwoInts, "add", lambda r: AddTwoInts.Response(sum=r.a + r.b))
    client = board.node.client(AddTwoInts, "add")
    board.connect()
    with pytest.raises(
        RclError, match=r"service '/add' is served by this very context.*send\(request, on_reply\)"
    ):
        client.call(AddTwoInts.Request(a=1, b=2))
    answers: list[Any] = []
    client.send(AddTwoInts.Request(a=1, b=2), answers.append)
    board.spin(board.executor(), 100)
    assert [answer.sum for answer in answers] == [3]
    service.destroy()
    assert client.call(AddTwoInts.Request(), timeout=0.05) is None


def test_malformed_samples_are_counted_and_told_once(capsys: pytest.CaptureFixture[str]) -> None:
    board = Board(World())
    subscription = board.node.subscription(String, "words", nothing)
    for _ in range(3):
        subscription.deliver(b"\xff\xff", 0, 2)
    assert subscription.malformed == 3
    assert capsys.readouterr().err == (
        "muros: a sample of 2 B on 'words' is no std_msgs/msg/String and was dropped. "
        "Does somebody publish another type there?\n"
    )
    told: list[tuple[int, str]] = []
    board.context.on_problem(lambda code, text: told.append((code, text)))
    board.node.subscription(Int32, "number", nothing).deliver(b"\0", 0, 1)
    assert [code for code, _ in told] == [12]
    assert "a sample of 1 B on 'number' is no std_msgs/msg/Int32" in told[0][1]


def test_problems_of_the_session_come_through_the_context() -> None:
    board = Board(World())
    told: list[str] = []
    board.context.on_problem(lambda code, text: told.append(text))
    board.node.publisher(Int32, "value").publish(Int32(data=1))
    assert told == [
        "4 B of rt/value dropped: no agent is connected. Session(queue=N) keeps up to N samples until then."
    ]


def test_a_sample_that_is_serialised_already_needs_no_type() -> None:
    world = World()
    board = Board(world)
    got: list[int] = []
    publisher = board.node.publisher(Int32, "value")
    board.node.subscription(Int32, "value", lambda message: got.append(message.data))
    board.connect()
    assert publisher.publish(Raw(Int32(data=7).serialize()))
    board.spin(board.executor(), 50)
    assert got == [7]


def test_triggers() -> None:
    world = World()
    alice, bob = two(world)
    laser, imu = alice.node.publisher(Int32, "laser"), alice.node.publisher(Int32, "imu")
    got: list[str] = []

    def listen(who: str) -> list[Any]:
        def listener(topic: str) -> Any:
            return bob.node.subscription(
                Int32, topic, lambda message: got.append(f"{who} {topic} {message.data}")
            )

        return [listener("laser"), listener("imu")]

    both, either, single = listen("both"), listen("either"), listen("one")
    executors = [
        bob.executor(trigger=all_of(*both)),
        bob.executor(trigger=any_of()),
        bob.executor(trigger=one(single[1])),
    ]
    for executor, handles in zip(executors, (both, either, single), strict=True):
        for handle in handles:
            executor.add(handle)
    alice.connect()
    bob.connect()

    def spin() -> list[str]:
        got.clear()
        for _ in range(10):
            world.run(5)
            for executor in executors:
                executor.spin_some()
        return sorted(got)

    laser.publish(Int32(data=1))
    alice.connect()
    assert spin() == ["either laser 1"]
    imu.publish(Int32(data=2))
    alice.connect()
    assert spin() == ["both imu 2", "both laser 1", "either imu 2", "one imu 2", "one laser 1"]


def test_a_trigger_of_a_timer() -> None:
    board = Board(World())
    calls: list[int] = []
    timer = board.node.timer(0.1, lambda: calls.append(board.world.now))
    executor = board.executor(trigger=one(timer))
    executor.add(timer)
    start = board.world.now
    board.spin(executor, 350)
    assert [now - start for now in calls] == [100, 200, 300]


def test_ping_of_a_context() -> None:
    board = Board(World()).connect()
    assert board.context.ping()
    board.world.stop_agent()
    assert not board.context.ping(0.2)


def test_closing_twice_is_closing_once() -> None:
    board = Board(World()).connect()
    board.context.close()
    board.context.close()
    assert not board.world.core.clients


@pytest.mark.parametrize("spin", ["spin", "spin_period"])
def test_an_interrupt_ends_spinning_with_a_goodbye(spin: str) -> None:
    board = Board(World()).connect()

    def interrupt() -> None:
        raise KeyboardInterrupt

    board.node.timer(0.05, interrupt)
    executor = board.executor()
    getattr(executor, spin)(*([0.01] if spin == "spin_period" else []))
    assert board.context.state == "WAITING"
    assert not board.world.core.clients


PROGRAM = """
import sys
from muros.client import Udp
from muros.rclc import Context, Executor
context = Context(Udp("127.0.0.1", int(sys.argv[1])))
context.on_state(lambda state: print(state, flush=True))
context.node("node")
Executor(context).spin()
print("after")
"""


def test_ctrl_c_on_a_program() -> None:
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link)
    events: list[str] = []
    agent._agent.on_event(lambda event: events.append(type(event).__name__))
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(link.port)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        while process.stdout.readline() != "CONNECTED\n":
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    finally:
        process.kill()
        process.wait()
        agent.stop()
    assert (process.returncode, out, err) == (0, "WAITING\nafter\n", "")
    assert events[-1] == "ClientGone"
