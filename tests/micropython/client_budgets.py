"""What the client and rclc may cost on a board, beside ``budgets``: programs, sessions, entities, speed.

Code is measured as a board has it that is connected and steady: what only making, connecting, creating, mending and
closing need is borrowed and gone by then (see ``muros.compat``), which ``test_client_budgets`` holds. Most limits are
the promises. A floor that is made small for its program keeps them, see ``muros.cli._small``: its rows say "small". The
others stand a little above the figures of today, so that they do not get worse.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

from muros.cli.board import COMPILED_THERE
from muros.interfaces import board
from muros.links import UdpLink
from tests.client.agent_thread import RunningAgent
from tests.micropython.budgets import (
    PROGRAMS,
    Budget,
    drift,
    import_heap,
    instructions,
    live_heap,
    object_heap,
    smallest,
    smallest_of,
)
from tests.micropython.gauge import heap_cost
from tests.micropython.runtimes import ROOT
from tests.micropython.tree import Tree, board_tree, compiled, small_compiled, small_tree

GAUGE = ("mpy-cross", "gauge")

PUBLISHER = (
    "muros.client.custom, muros.xrce.serial, muros.xrce.streams, muros.rclc.context, "
    "muros.client.session, std_msgs.msg"
)
"""What a program with publishers over a serial line keeps in memory while it is connected."""
CORE = (
    "muros.rclc.context, muros.rclc.executor, muros.rclc.subscription, muros.rclc.timer, muros.rclc.service, "
    "muros.rclc.client, muros.client.session, muros.client.services, muros.client.timesync, muros.xrce.streams"
)
"""What a program keeps that has publishers, subscriptions, services, clients, timers, an executor, and the time."""
TROUBLED = CORE + ", muros.client.echo, muros.client.backlog, muros.xrce.fragments, muros.xrce.mending"
"""The same while samples come and go in pieces, during a ping, and once a message was lost."""

SMALL_PUBLISHER = """
from muros.client import Custom, Session
from muros.rclc import Context
from std_msgs.msg import Int32

session = Session(Custom(begin, end, put, get, framing=True))
publisher = Context(session).node("board").publisher(Int32, "number")
while True:
    session.spin_once()
    publisher.publish(Int32(data=1))
"""
"""A program of the same kind, for which the floor is made small. What it imports is measured."""
SMALL_CORE = """
from muros.client import Session, TimeSync
from muros.rclc import Context, Executor

session = Session(transport)
context = Context(session)
node = context.node("board")
publisher = node.publisher(Number, "number")
node.subscription(Number, "number", print)
node.timer(1.0, publish)
node.service(Add, "add_two_ints", answer)
client = node.client(Add, "add_two_ints")
time = TimeSync(session)
executor = Executor(context)
while context.ping():
    time.request()
    client.send(Add.Request(), print)
    publisher.publish(Number(data=time.time()[0]))
    executor.spin_some(1.0)
"""
"""A program with everything that the core is for; its transport is not counted."""

WHOLE = """
compat exports
xrce/__init__ xrce/session xrce/streams xrce/beginning xrce/requests
xrce/mending xrce/fragments xrce/create
client/__init__ client/session client/methods client/start client/chance client/making client/names client/qos
client/link client/hello client/creating client/entities client/backlog
client/closing client/problems client/services client/timesync client/exchange client/echo client/presence
rclc/__init__ rclc/context rclc/contexts rclc/node rclc/errors rclc/executor rclc/handles rclc/subscription
rclc/timer rclc/service rclc/client
"""
"""The modules of the core, those that are borrowed too: what a board needs in flash beside transports and messages."""

SESSION = """
from muros.client import Session
from muros.rclc import Context, Executor
from tests.board.agent import Agent
from tests.board.test_client import Number
import muros.client.services, muros.rclc.subscription, muros.rclc.service, muros.rclc.timer
class Service:
    TYPE = "example_interfaces/srv/AddTwoInts"
    Request = Response = Number
context = Context(Session(Agent(256), 1))
node = context.node("board")
agent = Agent(256)
"""
CONNECTED = """
import muros.client.chance, muros.compat
muros.compat.collect = lambda: None  # one of the builds has no safe collector
muros.client.chance.draw = int  # one of the builds has no entropy
from tests.board.test_client import Board
from muros.client.raw import Raw
board = Board(256)
session = board.session
class Sink:
    def send(self, buf, off, n):
        pass
    def receive(self, deliver):
        return 0
session.transport = Sink()
session.send = session.transport.send
message = Raw(bytes(64))
ack = bytearray(b"\\x81\\0\\0\\0\\x0a\\x01\\x05\\0\\0\\0\\0\\0\\x80")
def acknowledged():
    board.reliable.publish(message)
    ack[8] = session.reliable.next & 255
    ack[9] = session.reliable.next >> 8
    session.deliver(ack, 0, 13)
    session.spin_once(board.now)
"""


@cache
def messages(*names: str) -> Tree:
    """Generated classes for boards, as files."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        return {
            path.relative_to(folder).as_posix(): path.read_bytes() for path in board.generate(names, folder)
        }


def imported(modules: str, types: Sequence[str] = ()) -> float:
    """Bytes on a 32-bit heap of some modules and of the message classes of some types."""
    lines = [f"import {modules}"] + [f"from {t.split('/')[0]}.msg import {t.split('/')[2]}" for t in types]
    return import_heap("\n".join(lines), messages(*types))


def with_tests(measure: Callable[..., float], setup: str, expression: str) -> float:
    """A measure whose set-up uses the agent and the messages of the board tests."""
    return measure(setup, expression, _tests())


def running(form: str, limit: int) -> float:
    """kB of the smallest 64-bit heap in which the program talks to itself through the agent over UDP."""
    with _agent() as port:
        return smallest("talker_listener", form, limit, ["127.0.0.1", port], messages("std_msgs/msg/String"))


def heap_of_a_program() -> float:
    """Bytes that a publisher and a subscription of 64 B leave on a 32-bit heap, everything loaded and connected."""
    program = (
        "from tests.board.agent import Agent\nimport std_msgs.msg\n",
        "from muros.client import Session\nfrom muros.rclc import Context, Executor\nfrom std_msgs.msg import String\n"
        "context = Context(Session(Agent(256), 1))\nnode = context.node('board')\n"
        "publisher = node.publisher(String, 'loop')\nnode.subscription(String, 'loop', print)\n"
        "executor = Executor(context)\nfor _ in range(20): executor.spin_some()\n"
        "publisher.publish(String(data='x' * 59))\nexecutor.spin_some()\n",
    )
    return live_heap(program[0], program[1], {**messages("std_msgs/msg/String"), **_tests()})


def flash() -> float:
    """Bytes of .mpy of the whole core."""
    tree = compiled(board_tree())
    return sum(len(tree[f"muros/{module}.mpy"]) for module in WHOLE.split())


def imported_small(program: str, types: Sequence[str] = (), borrowed: str = "") -> float:
    """Bytes on a 32-bit heap of what a program imports of a floor that is small for it, and of what is borrowed."""
    tree = small_compiled(small_tree(messages(*types), [program]))
    return heap_cost(tree, program.strip().split("\n\n")[0] + borrowed)


def running_small(limit: int, form: str = "mpy") -> float:
    """As ``running``, with a floor that is small for the program."""
    program = PROGRAMS / "talker_listener.py"
    most = None if form == "mpy" else COMPILED_THERE
    tree = small_tree(messages("std_msgs/msg/String"), [program.read_text()], native=True, most=most)
    tree[program.name] = program.read_bytes()
    with _agent() as port:
        made = small_compiled(tree, "x64") if form == "mpy" else tree
        return smallest_of(made, program.stem, limit, ["127.0.0.1", port])


def flash_small() -> float:
    """Bytes of .mpy of all that a board gets for a program with everything, but its transport and messages."""
    return sum(map(len, small_compiled(small_tree({}, [SMALL_CORE])).values()))


@contextmanager
def _agent() -> Iterator[str]:
    """The port of an agent on loopback."""
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link)
    try:
        yield str(link.port)
    finally:
        agent.stop()


def with_agent(extra: Tree) -> Tree:
    """The board floor and more, compiled, with the agent of the board tests."""
    return compiled({**board_tree(), **extra, **_tests()})


def _tests() -> Tree:
    names = ("agent.py", "harness.py", "test_client.py")
    return {f"tests/board/{name}": (ROOT / "tests/board" / name).read_bytes() for name in names}


CLIENT_BUDGETS: tuple[Budget, ...] = (
    Budget(
        "import of a program that publishes Int32 over serial",
        17_700,
        "B",
        GAUGE,
        partial(imported, PUBLISHER, ("std_msgs/msg/Int32",)),
    ),
    Budget(
        "import of client and rclc, everything but transports", 20_000, "B", GAUGE, partial(imported, CORE)
    ),
    Budget(
        "the same with pieces under way, a ping and losses", 26_000, "B", GAUGE, partial(imported, TROUBLED)
    ),
    Budget("bytecode of the same with what is borrowed", 37_800, "B", ("mpy-cross",), flash),
    Budget(
        "import of a program that publishes Int32 over serial, small",
        12_000,
        "B",
        GAUGE,
        partial(imported_small, SMALL_PUBLISHER, ("std_msgs/msg/Int32",)),
    ),
    Budget("import of client and rclc, small", 13_000, "B", GAUGE, partial(imported_small, SMALL_CORE)),
    Budget(
        "the same with pieces under way, a ping and losses, small",
        20_000,
        "B",
        GAUGE,
        partial(imported_small, SMALL_CORE, borrowed="\nimport muros.trouble, muros.client.methods"),
    ),
    Budget(
        "bytecode of client and rclc with what is borrowed, small", 16_000, "B", ("mpy-cross",), flash_small
    ),
    Budget(
        "session, MTU 256, history 4, both directions",
        3_200,
        "B",
        GAUGE,
        partial(with_tests, object_heap, SESSION, "Session(agent, 1)"),
    ),
    Budget(
        "publisher",
        160,
        "B",
        GAUGE,
        partial(with_tests, object_heap, SESSION, "node.publisher(Number, 'temperature')"),
    ),
    Budget(
        "subscription",
        224,
        "B",
        GAUGE,
        partial(with_tests, object_heap, SESSION, "node.subscription(Number, 'temperature', None)"),
    ),
    Budget(
        "executor and timer",
        224,
        "B",
        GAUGE,
        partial(with_tests, object_heap, SESSION, "(Executor(context), node.timer(1.0, None))"),
    ),
    Budget(
        "service",
        320,
        "B",
        GAUGE,
        partial(with_tests, object_heap, SESSION, "node.service(Service, 'add_two_ints', None)"),
    ),
    Budget("live heap, publisher and subscription of 64 B, connected", 28_000, "B", GAUGE, heap_of_a_program),
    Budget(
        "smallest heap of the same over UDP, as .mpy, 64 bit",
        66,
        "kB",
        ("unix", "mpy-cross"),
        partial(running, "mpy", 66),
    ),
    Budget(
        "smallest heap of the same over UDP, small, 64 bit",
        40,
        "kB",
        ("unix", "mpy-cross"),
        partial(running_small, 40),
    ),
    Budget(
        "smallest heap of the same over UDP, small, as .py, 64 bit",
        64,
        "kB",
        ("unix",),
        partial(running_small, 64, "py"),
    ),
    Budget(
        "smallest heap of the same over UDP, as .py, 64 bit",
        102,
        "kB",
        ("unix",),
        partial(running, "py", 102),
    ),
    Budget(
        "instructions to publish 64 B, best effort",
        66_000,
        "",
        ("fuel", "mpy-cross"),
        partial(with_tests, instructions, CONNECTED, "board.loose.publish(message)"),
    ),
    Budget(
        "instructions to publish 64 B, reliable, acknowledged, and to spin",
        176_000,
        "",
        ("fuel", "mpy-cross"),
        partial(with_tests, instructions, CONNECTED, "acknowledged()"),
    ),
    Budget(
        "drift of the heap over 100 000 acknowledged messages",
        0,
        "B",
        GAUGE,
        lambda: drift(CONNECTED, "acknowledged()", 100_000, _tests()),
    ),
)
