"""The client on every runtime: the same session, without a network, and what it allocates."""

from muros.client import CONNECTED, CONNECTING, LOST, WAITING, Custom, Qos, Session, TimeSync
from muros.client import ping as ask
from muros.client.names import dds_type, resolve, topic_name
from muros.client.raw import Raw
from muros.compat import MPY, const
from tests.board.agent import Agent
from tests.board.harness import allocates, raises

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Buffer

_READER = const(6)


class Number:
    """A message of one int32 that is below 2**24, written and read without allocating."""

    TYPE = "std_msgs/msg/Int32"

    def __init__(self) -> None:
        self.data = 0

    def size(self) -> int:
        return 4

    def write(self, buf: bytearray, off: int) -> int:
        data = self.data
        buf[off] = data & 255
        buf[off + 1] = data >> 8 & 255
        buf[off + 2] = data >> 16 & 255
        buf[off + 3] = 0
        return off + 4

    def read(self, buf: "Buffer", off: int, n: int) -> None:
        if n < 4:
            raise ValueError("short")
        self.data = buf[off] | buf[off + 1] << 8 | buf[off + 2] << 16


class Board:
    """A session with a writer of each kind and a reader, connected."""

    def __init__(self, mtu: int = 256, qos: str = "default") -> None:
        self.agent = Agent(mtu)
        self.session = Session(self.agent, 0xBA5EBA11)
        node = self.session.participant("board")
        self.reliable = self.session.writer(node, "rt/reliable", "std_msgs/msg/Int32")
        self.loose = self.session.writer(node, "rt/loose", "std_msgs/msg/Int32", "sensor_data")
        self.message = Number()
        self.heard = 0
        self.reader = self.session.reader(node, "rt/in", "std_msgs/msg/Int32", qos, self.on_data)
        self.now = 0
        self.states: "list[int]" = []
        self.session.on_state = self.states.append
        for _ in range(20):
            self.step(10)

    def on_data(self, buf: "Buffer", off: int, n: int) -> None:
        self.message.read(buf, off, n)
        self.heard += 1

    def step(self, ms: int) -> None:
        self.now += ms
        self.session.spin_once(self.now)

    def said_reliably(self, value: int) -> bool:
        self.message.data = value
        return self.reliable.publish(self.message)


def test_a_session_connects_and_writes() -> None:
    board = Board()
    assert board.session.state == CONNECTED
    assert board.states == [CONNECTING, CONNECTED]
    assert board.said_reliably(7)
    assert board.loose.publish(board.message)
    board.step(10)
    assert board.agent.written == [b"\x07\0\0\0", b"\x07\0\0\0"]


def test_samples_arrive() -> None:
    board = Board()
    board.agent.inbox.append(board.agent.data(_READER, b"\x39\x30\0\0"))
    board.step(10)
    assert board.message.data == 12345
    assert board.heard == 1


def test_loss_and_return() -> None:
    board = Board()
    board.agent.quiet = True
    for _ in range(300):
        board.step(10)
    assert board.session.state == LOST
    board.agent.quiet = False
    for _ in range(30):
        board.step(10)
    assert board.session.state == CONNECTED
    assert board.agent.hellos == 1


def test_an_agent_that_forgot_is_told_everything_again() -> None:
    board = Board()
    board.agent.quiet = True
    assert board.said_reliably(5)
    for _ in range(300):
        board.step(10)
    board.agent.quiet = False
    board.agent.knows = 0
    for _ in range(60):
        board.step(10)
    assert board.session.state == CONNECTED
    assert board.agent.hellos == 2
    assert board.agent.written == [b"\x05\0\0\0"]


def test_large_samples_go_in_pieces() -> None:
    board = Board(128)
    data = bytes(range(200)) * 2
    assert board.reliable.publish(Raw(data))
    for _ in range(20):
        board.step(10)
    assert board.session.backlog is None
    assert not board.loose.publish(Raw(data))
    assert board.session.drops[2] == 1


def test_closing() -> None:
    board = Board()
    board.session.close()
    assert board.session.state == WAITING


def test_nothing_is_acknowledged_behind_the_goodbye() -> None:
    board = Board()
    board.agent.inbox.append(board.agent.data(_READER, bytes(4)))
    said = board.agent.said
    board.session.close()
    assert board.agent.said == said + 1, "it would come to an agent that does not know the session any more"
    assert board.heard == 0


def test_ping_without_a_session() -> None:
    assert not ask(Custom(lambda: True, lambda: None, lambda buf, off, n: None, lambda buf: 0), 1, 5)


def test_time_is_asked_for() -> None:
    board = Board()
    sync = TimeSync(board.session)
    sync.request(1000)
    assert not sync.synchronized()
    assert sync.time(0) == (0, 0)


def test_names() -> None:
    assert resolve("a", "/ns", "n") == "/ns/a"
    assert topic_name("rt", "/a") == "rt/a"
    assert dds_type("std_msgs/msg/Int32") == "std_msgs::msg::dds_::Int32_"
    with raises(ValueError):
        topic_name("rt", "/" + "x" * 60)


def test_qos() -> None:
    assert Qos(depth=3).flags == 3
    with raises(ValueError):
        Qos(durability="x")


def test_publishing_allocates_nothing() -> None:
    board = Board()
    board.agent.counting = True
    board.message.data = 77
    ack = bytearray(b"\x81\0\0\0\x0a\x01\x05\0\0\0\0\0\x80")
    stream = board.session.reliable

    def best_effort() -> None:
        board.loose.publish(board.message)

    def reliable() -> None:
        board.reliable.publish(board.message)
        ack[8] = stream.next & 255
        ack[9] = stream.next >> 8
        board.session.deliver(ack, 0, 13)

    assert allocates(best_effort) == 0
    said = board.agent.said
    assert allocates(reliable) == 0
    assert board.agent.said > said
    assert board.session.drops[1] == 0


def test_an_idle_spin_allocates_nothing() -> None:
    board = Board()
    board.agent.counting = True
    session = board.session

    def spin() -> None:
        session.spin_once(board.now)
        session.deadline(board.now)

    assert allocates(spin) == 0

    def pings_too() -> None:
        board.step(400)

    said = board.agent.said
    session._heard = board.now - 10000
    session.ping_attempts = 1000
    assert allocates(pings_too) == 0
    assert board.agent.said > said


def test_receiving_over_a_serial_line_allocates_nothing() -> None:
    from muros.xrce.serial import SerialFramer

    board = Board()
    line = bytearray(600)
    position = [0]

    def keep(buf: bytearray, n: int) -> None:
        line[position[0] : position[0] + n] = memoryview(buf)[:n]
        position[0] += n

    framer = SerialFramer(0, 1, keep)
    for i in range(8):
        message = board.agent.data(_READER, bytes((i, 0x7E, 0x7D, 0)))
        framer.send(message, 0, len(message))
    end = position[0]
    position[0] = 0

    def read(buf: bytearray) -> int:
        n = 0
        while n < 10 and position[0] < end:
            buf[n] = line[position[0]]
            n += 1
            position[0] += 1
        return n

    def nowhere(buf: "Buffer", off: int, n: int) -> None:
        pass

    custom = Custom(lambda: True, lambda: None, nowhere, read, True, 256)
    board.session.transport = custom
    board.session.send = custom.send
    deliver = board.session.deliver

    def receive() -> None:
        custom.receive(deliver)

    while board.heard < 2:
        receive()
    used = 0
    heard = board.heard
    if MPY:
        import gc

        gc.collect()
        gc.disable()
        before = gc.mem_alloc()
        while board.heard < 8:
            receive()
        used = gc.mem_alloc() - before
        gc.enable()
    else:
        while board.heard < 8:
            receive()
    assert board.heard > heard
    assert used == 0
    assert board.message.data == 7 | 0x7E << 8 | 0x7D << 16


def test_a_timer_and_a_subscription_in_an_executor_allocate_nothing() -> None:
    from muros.rclc import Context, Executor

    board = Board()
    context = Context(board.session)
    context.clock = lambda: board.now
    node = context.node("node")
    count = [0, 0]

    def on_timer() -> None:
        count[0] += 1

    def on_message(message: Number) -> None:
        count[1] += message.data

    timer = node.timer(0.0, on_timer)
    subscription = node.subscription(Number, "number", on_message)
    for _ in range(20):
        board.step(10)
    executor = Executor(context)
    board.agent.counting = True
    sample = bytes((5, 0, 0, 0))

    def work() -> None:
        subscription.deliver(sample, 0, 4)
        executor.work(board.now)

    assert allocates(work) == 0
    assert count[0] >= 1
    assert count[1] == 5 * count[0]
    timer.cancel()

    def idle() -> None:
        executor.round(0)

    assert allocates(idle) == 0
