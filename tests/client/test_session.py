"""The session in virtual time, against the agent core, over a network that fares as each test says."""

import random
from collections.abc import Callable
from typing import Any

import pytest

from muros.client import CONNECTED, CONNECTING, LOST, WAITING, Session
from muros.client import problems as problem
from muros.client.raw import Raw
from muros.client.session import Entity
from muros.links.testing import Datagram
from tests.client.replay import Wire
from tests.client.world import STRING, SimulatedTransport, World

GET_INFO, CREATE, CREATE_CLIENT, STATUS, STATUS_AGENT, WRITE_DATA = 2, 1, 0, 5, 4, 7


class Device:
    """A client with a participant, a writer, a reader and what happened to it."""

    def __init__(self, world: World, qos: str = "default", **arguments: Any) -> None:
        self.world = world
        self.session = world.client(**arguments)
        self.states: list[int] = []
        self.problems: list[tuple[int, str]] = []
        self.got: list[bytes] = []
        self.session.on_state = self.states.append
        self.session.on_problem = lambda code, text: self.problems.append((code, text))
        self.participant: Entity = self.session.participant("/ns/node")
        self.writer: Entity = self.session.writer(self.participant, "rt/out", STRING, qos)
        self.reader: Entity = self.session.reader(
            self.participant,
            "rt/in",
            STRING,
            qos,
            lambda buf, off, n: self.got.append(bytes(buf[off : off + n])),
        )
        self.heard, self.host_reader = world.reader("rt/out", "keep_all" if False else "default")
        self.host_writer = world.writer("rt/in")

    def connect(self) -> "Device":
        """Waits until it is connected."""
        self.world.until(lambda: self.session.state == CONNECTED)
        return self

    @property
    def transport(self) -> SimulatedTransport:
        """Its transport."""
        transport = self.session.transport
        assert isinstance(transport, SimulatedTransport)
        return transport


def kinds(messages: list[tuple[str, bytes]], direction: str, kind: int) -> list[bytes]:
    """The messages of a direction that begin with a kind of submessage."""
    return [m for d, m in messages if d == direction and len(m) > 4 and m[4] == kind]


def test_connects_and_data_flows_both_ways() -> None:
    world = World()
    device = Device(world).connect()
    assert device.states == [CONNECTING, CONNECTED]
    assert device.writer.write_bytes(b"hello")
    device.host_writer.write(b"answer")
    world.run(50)
    assert device.heard == [b"hello"]
    assert device.got == [b"answer"]
    assert not device.problems


def test_best_effort_flows_both_ways() -> None:
    world = World()
    device = Device(world, qos="sensor_data").connect()
    heard, _ = world.reader("rt/out", "sensor_data")
    for i in range(5):
        assert device.writer.write_bytes(b"%d" % i)
        device.host_writer.write(b"%d" % i)
        world.run(20)
    assert heard == device.got == [b"0", b"1", b"2", b"3", b"4"]


def test_waits_for_an_agent_and_asks_every_second() -> None:
    world = World()
    world.stop_agent()
    device = Device(world)
    world.run(4900)
    assert device.session.state == WAITING
    assert len(kinds(device.transport.log, "c>a", CREATE_CLIENT)) == 5
    world.start_agent()
    device.connect()


def test_a_transport_that_is_not_there_yet_is_opened_later() -> None:
    world = World()
    device = Device(world)
    device.transport.openable = False
    world.run(3000)
    assert device.session.state == WAITING
    assert not device.transport.log
    device.transport.openable = True
    device.connect()


def test_an_agent_that_refuses_is_asked_slowly_and_reported() -> None:
    world = World()
    world.stop_agent()
    world.start_agent(max_clients=1)
    other = Device(world, address="other", client_key=1).connect()
    device = Device(world)
    world.run(9000)
    assert device.session.state == WAITING
    assert device.problems[0][0] == problem.SESSION
    assert "no resources" in device.problems[0][1]
    assert len(kinds(device.transport.log, "c>a", CREATE_CLIENT)) <= 3
    other.session.close()
    device.connect()


def test_an_entity_that_is_refused_is_reported_and_the_others_go_on() -> None:
    world = World()
    world.stop_agent()
    world.start_agent(max_objects=4)
    device = Device(world).connect()
    world.run(2000)
    assert [code for code, _ in device.problems] == [problem.ENTITY]
    assert "rt/in" in device.problems[0][1]
    assert device.reader.status >= 0x80
    assert device.writer.write_bytes(b"still")
    world.run(50)
    assert device.heard == [b"still"]


def test_entities_added_later_are_created_at_once() -> None:
    world = World()
    device = Device(world).connect()
    late = device.session.writer(device.participant, "rt/late", STRING)
    heard, _ = world.reader("rt/late")
    assert not late.write_bytes(b"too early")
    world.run(50)
    assert late.write_bytes(b"now")
    world.run(50)
    assert heard == [b"now"]
    assert device.session.state == CONNECTED


def test_many_entities_are_created_a_few_at_a_time() -> None:
    world = World()
    session = world.client()
    participant = session.participant("many")
    for i in range(30):
        session.writer(participant, f"rt/topic_{i}", STRING)
    most = 0

    def watch(_: int) -> None:
        nonlocal most
        most = max(most, len(session.asked))

    world.run(1500, every=watch)
    assert session.state == CONNECTED
    assert 0 < most <= 8
    assert sum(1 for e in world.events if type(e).__name__ == "EntityCreated") == 1 + 30 * 3


def test_a_lost_status_is_asked_for_again() -> None:
    world = World()
    lost: list[int] = []

    def tap(datagram: Datagram) -> bool:
        if datagram.sender == "agent" and len(datagram.data) > 4 and datagram.data[4] == STATUS and not lost:
            lost.append(1)
            world.core.clients[b"\xaa\xbb\xcc\xdd"].outputs[0x80].acknowledge(1, lambda *_: None, world.now)
            return False  # gone for good, as the reference agent loses one when its window is full
        return True

    world.network.tap = tap
    device = Device(world)
    world.until(lambda: device.session.state == CONNECTED, 5000)
    assert lost
    creates = kinds(device.transport.log, "c>a", CREATE)
    assert len(creates) >= 2


def test_silence_is_noticed_and_pings_tell_when_the_agent_is_back() -> None:
    world = World()
    device = Device(world).connect()
    world.network.partition(["client"])
    took = world.until(lambda: device.session.state == LOST)
    assert 1000 <= took <= 3000
    world.run(5000)
    assert device.session.state == LOST
    world.network.heal()
    took = world.until(lambda: device.session.state == CONNECTED)
    assert took <= 350
    assert device.states == [CONNECTING, CONNECTED, LOST, CONNECTED]


def test_an_idle_session_is_kept_up_by_pings() -> None:
    world = World()
    device = Device(world).connect()
    device.transport.log.clear()
    world.run(10_000)
    assert device.session.state == CONNECTED
    pings = kinds(device.transport.log, "c>a", GET_INFO)
    assert 8 <= len(pings) <= 11
    assert len({ping[8:10] for ping in pings}) == len(pings), "each question has an id of its own"


def test_keepalive_can_be_off() -> None:
    world = World()
    device = Device(world, keepalive=0).connect()
    device.transport.log.clear()
    world.network.partition(["client"])
    world.run(10_000)
    assert device.session.state == CONNECTED
    assert not kinds(device.transport.log, "c>a", GET_INFO)


@pytest.mark.parametrize("when", ["receive", "send"])
def test_a_link_that_breaks_is_a_loss_at_once(when: str) -> None:
    world = World()
    device = Device(world).connect()
    device.transport.fault = OSError(111)
    if when == "send":
        device.writer.write_bytes(b"x")
    world.run(5)
    assert device.session.state == LOST
    world.until(lambda: device.session.state == CONNECTED, 400)
    world.run(300)
    assert device.heard == ([b"x"] if when == "send" else [])


def test_a_restarted_agent_gets_everything_anew_and_what_it_missed() -> None:
    world = World()
    device = Device(world).connect()
    assert device.writer.write_bytes(b"before")
    world.run(50)
    world.stop_agent()
    assert device.writer.write_bytes(b"in between")
    world.run(200)
    world.start_agent()
    world.until(lambda: device.session.state == CONNECTING)
    world.until(lambda: device.session.state == CONNECTED, 500)
    assert device.writer.write_bytes(b"after")
    world.run(300)
    assert device.heard == [b"before", b"in between", b"after"]
    device.host_writer.write(b"to the device")
    world.run(50)
    assert device.got == [b"to the device"]


def test_a_large_sample_under_way_when_the_agent_restarts_is_sent_again_whole() -> None:
    world = World()
    device = Device(world).connect()
    large = bytes(range(256)) * 20
    assert device.writer.write_bytes(large)
    world.run(5)
    world.stop_agent()
    world.run(3000)
    world.start_agent()
    device.connect()
    world.until(lambda: large in device.heard, 3000)
    assert device.heard.count(large) == 1


def test_a_changed_address_is_a_new_beginning() -> None:
    world = World()
    device = Device(world).connect()
    device.transport.move("elsewhere")
    world.until(lambda: device.session.state == CONNECTING, 5000)
    device.connect()
    assert device.writer.write_bytes(b"from elsewhere")
    world.run(50)
    assert device.heard == [b"from elsewhere"]


def test_a_session_with_key_survives_a_changed_address() -> None:
    world = World()
    device = Device(world, session_id=0x01).connect()
    device.transport.move("elsewhere")
    assert device.writer.write_bytes(b"same session")
    world.run(3000)
    assert device.heard == [b"same session"]
    assert device.states == [CONNECTING, CONNECTED]


@pytest.mark.parametrize("creation", ["binary", "xml", "reference"])
def test_every_creation_mode(creation: str) -> None:
    world = World()
    device = Device(world, creation=creation).connect()
    assert not device.problems
    assert device.writer.status == device.reader.status == 0


def test_a_small_mtu_cuts_what_is_long() -> None:
    world = World()
    device = Device(world, mtu=64, creation="xml")
    device.connect()
    assert not device.problems
    assert device.writer.write_bytes(bytes(500))
    device.host_writer.write(bytes(700))
    world.run(1000)
    assert device.heard == [bytes(500)]
    assert device.got == [bytes(700)]


def test_hard_liveliness_is_answered() -> None:
    world = World()
    device = Device(world, hard_liveliness=1000, keepalive=0).connect()
    world.run(6000)
    assert world.core.clients
    device.host_writer.write(b"still there")
    world.run(50)
    assert device.got == [b"still there"]


def test_hard_liveliness_removes_a_silent_client() -> None:
    world = World()
    Device(world, hard_liveliness=1000, keepalive=0).connect()
    world.network.partition(["client"])
    world.run(3000)
    assert not world.core.clients


def test_publishing_while_down_is_refused_and_counted() -> None:
    world = World()
    device = Device(world)
    assert not device.writer.write_bytes(b"nobody")
    assert list(device.session.drops) == [1, 0, 0, 0, 0]
    assert [code for code, _ in device.problems] == [problem.OFFLINE]


def test_a_queue_keeps_what_is_published_while_down() -> None:
    world = World()
    device = Device(world, queue=3)
    assert [device.writer.write_bytes(b"%d" % i) for i in range(5)] == [True, True, True, False, False]
    device.connect()
    world.run(300)
    assert device.heard == [b"0", b"1", b"2"]
    assert device.session.drops[1] == 2


def test_a_full_window_refuses_and_reports_seldom() -> None:
    world = World()
    device = Device(world, history=4).connect()
    world.run(50)
    taken = [device.writer.write_bytes(b"%d" % i) for i in range(40)]
    assert taken == [True] * 4 + [False] * 36
    assert device.session.drops[1] == 36
    assert len(device.problems) == 6
    world.run(100)
    assert device.heard == [b"0", b"1", b"2", b"3"]


def test_best_effort_larger_than_a_message_is_refused_with_the_reason() -> None:
    world = World()
    device = Device(world, qos="sensor_data").connect()
    assert not device.writer.write_bytes(bytes(600))
    assert device.session.drops[2] == 1
    assert device.problems[0][0] == problem.TOO_LARGE
    assert "600 B of rt/out" in device.problems[0][1]


def test_a_reliable_sample_is_not_refused_because_a_best_effort_one_was() -> None:
    world = World()
    device = Device(world).connect()
    loose = device.session.writer(device.participant, "rt/loose", STRING, "sensor_data")
    world.run(50)
    assert not loose.write_bytes(bytes(600))
    assert device.writer.write_bytes(b"fine")


def test_a_message_that_cannot_be_written_leaves_no_trace() -> None:
    class Bad(Raw):
        def write(self, buf: bytearray, off: int) -> int:
            buf[off] = 0xEE
            raise ValueError("no such value")

    world = World()
    device = Device(world).connect()
    for _ in range(10):
        with pytest.raises(ValueError, match="no such value"):
            device.writer.publish(Bad(b"12345678"))
    assert device.writer.write_bytes(b"good")
    world.run(50)
    assert device.heard == [b"good"]


def test_reading_can_be_limited_and_renewed() -> None:
    world = World()
    device = Device(world)
    device.reader.read(samples=2)
    device.connect()
    for i in range(4):
        device.host_writer.write(b"%d" % i)
        world.run(20)
    assert device.got == [b"0", b"1"]
    device.got.clear()
    device.reader.read(samples=1)
    world.run(50)
    device.host_writer.write(b"again")
    world.run(50)
    assert len(device.got) == 1


def test_destroyed_entities_go_from_the_agent() -> None:
    world = World()
    device = Device(world).connect()
    device.writer.write_bytes(b"last")
    device.writer.destroy()
    device.reader.destroy()
    device.participant.destroy()
    device.participant.destroy()
    world.run(100)
    (session,) = world.core.clients.values()
    assert not session.objects
    assert device.heard == [b"last"]
    assert not device.writer.write_bytes(b"gone")
    assert device.session.state == CONNECTED


def test_close_says_goodbye() -> None:
    world = World()
    device = Device(world).connect()
    device.session.close()
    assert not world.core.clients
    assert device.session.state == WAITING
    assert device.states[-1] == WAITING
    world.run(5000)
    assert not world.core.clients
    device.session.close()


def test_close_without_an_agent_ends() -> None:
    world = World()
    device = Device(world).connect()
    world.stop_agent()
    before = world.now
    device.session.close()
    assert world.now - before <= 1100


def test_services_both_ways() -> None:
    world = World()
    server, client = world.client("server", client_key=1), world.client("client", client_key=2)
    replies: list[tuple[int, bytes]] = []
    replier = server.replier(
        server.participant("server"),
        "/add",
        "pkg/srv/Add",
        lambda identity, buf, off, n: replier.reply(identity, Raw(b"re:" + bytes(buf[off : off + n]))),
    )
    requester = client.requester(
        client.participant("client"),
        "/add",
        "pkg/srv/Add",
        lambda number, buf, off, n: replies.append((number, bytes(buf[off : off + n]))),
    )
    world.until(lambda: server.state == client.state == CONNECTED)
    world.run(50)
    first, second = requester.send(Raw(b"one")), requester.send(Raw(b"two"))
    assert first
    assert second == first + 1
    world.run(100)
    assert replies == [(first, b"re:one"), (second, b"re:two")]


def test_a_repeated_create_client_is_survived_without_properties() -> None:
    """What the network repeats late makes the reference agent begin its streams again: ours notices and reconnects."""
    world = World()
    device = Device(world, properties=False).connect()
    for i in range(6):
        assert device.writer.write_bytes(b"%d" % i)
        world.run(20)
    (hello, *_) = kinds(device.transport.log, "c>a", CREATE_CLIENT)
    world.port.receive(hello, "client", world.now)
    world.until(lambda: problem.OUT_OF_STEP in dict(device.problems), 5000)
    device.connect()
    world.until(lambda: device.writer.write_bytes(b"after"), 2000)
    world.run(200)
    assert device.heard == [b"0", b"1", b"2", b"3", b"4", b"5", b"after"]
    device.host_writer.write(b"in")
    world.run(100)
    assert device.got == [b"in"]


def test_a_repeated_create_client_changes_nothing_with_properties() -> None:
    world = World()
    device = Device(world).connect()
    (hello, *_) = kinds(device.transport.log, "c>a", CREATE_CLIENT)
    for i in range(6):
        assert device.writer.write_bytes(b"%d" % i)
        world.port.receive(hello, "client", world.now)
        world.run(100)
    assert device.heard == [b"0", b"1", b"2", b"3", b"4", b"5"]
    assert device.states == [CONNECTING, CONNECTED]


def scenario(seed: int, act: Callable[[World, random.Random], None], **arguments: Any) -> Device:
    """Publishes every 40 ms over a bad network while ``act`` makes it worse; then lets it settle."""
    world = World(seed, loss=0.1, duplicate=0.1, reorder=0.1, delay=(1, 20))
    dice = random.Random(seed)
    device = Device(world, **arguments)
    world.until(lambda: device.session.state == CONNECTED, 60_000)
    sent: list[bytes] = []

    def publish(now: int) -> None:
        if now % 40 == 0:
            message = b"%d " % len(sent) + bytes(1500 if dice.random() < 0.05 else 0)
            if device.writer.write_bytes(message):
                sent.append(message)

    device.sent = sent  # type: ignore[attr-defined]
    for _ in range(3):
        world.run(1500, every=publish)
        act(world, dice)
        world.run(500, every=publish)
        world.network.heal()
    world.until(lambda: device.session.state == CONNECTED, 60_000)
    world.run(10_000)
    return device


@pytest.mark.parametrize("seed", [*range(7), 96])
def test_exactly_once_in_order_over_partitions(seed: int) -> None:
    def part(world: World, dice: random.Random) -> None:
        world.network.partition(["client"])
        world.run(dice.choice([200, 1500, 4000]))

    device = scenario(seed, part)
    assert device.heard == device.sent  # type: ignore[attr-defined]
    assert device.states.count(CONNECTING) == 1, "the session was never begun anew"
    assert len(device.heard) > 30


@pytest.mark.parametrize("seed", [*range(7), 96])
def test_nothing_accepted_is_missing_after_restarts(seed: int) -> None:
    def restart(world: World, dice: random.Random) -> None:
        world.stop_agent()
        world.run(dice.choice([100, 1000, 3000]))
        world.start_agent()

    device = scenario(seed, restart, queue=4)
    sent: list[bytes] = device.sent  # type: ignore[attr-defined]
    assert set(sent) <= set(device.heard), "something was lost"
    first_heard = list(dict.fromkeys(device.heard))
    assert first_heard == sent, "first appearances are in order"


def test_arguments_are_checked() -> None:
    for bad in (0, b"", b"12345", bytes(4)):
        with pytest.raises(ValueError, match="client_key"):
            Session(Wire(), bad)
    with pytest.raises(ValueError, match="history"):
        Session(Wire(), 1, history=3)


def test_keys_are_drawn_and_differ() -> None:
    assert len({Session(Wire()).key for _ in range(20)}) == 20


def test_request_ids_wrap_to_ten() -> None:
    session = Session(Wire(), 1)
    session.request = 0xFFFD
    assert [session.number() for _ in range(3)] == [0xFFFE, 10, 11]
    session.request = 0xFFFC
    assert session.number(4) == 13
    session.request = 0xFFFA
    assert session.number(4) == 0xFFFE


def test_foreign_bytes_only_move_counters() -> None:
    dice = random.Random(5)
    world = World()
    device = Device(world).connect()
    session = device.session
    for _ in range(3000):
        length = dice.choice([0, 1, 3, 4, 5, 8, 9, 12, 40])
        message = bytearray(dice.randbytes(length))
        if length > 4 and dice.random() < 0.8:
            message[0] = 0x81
            message[1] = dice.choice([0, 1, 0x80])
            message[4] = dice.randrange(16)
        session.deliver(message, 0, len(message))
        session.spin_once(world.now)
    assert session.state in (CONNECTED, CONNECTING, WAITING, LOST)
    world.until(lambda: session.state == CONNECTED, 10_000)


def test_nothing_is_lost_at_first() -> None:
    assert Session(Wire(), 1).drops == [0] * 5


def test_deadline_says_when_there_is_something_to_do() -> None:
    """Spun only at its own deadlines and when messages come, a session does as well."""
    world = World()
    device = Device(world)
    session = device.session
    world.sessions.clear()
    spins = 0
    wake = 0
    while world.now < 10_000:
        world.now += 1
        world.network.step(world.now)
        world.core.tick(world.now)
        world.space.tick()
        endpoint = device.transport._endpoint
        if world.now >= wake or (endpoint is not None and endpoint.inbox):
            session.spin_once(world.now)
            wake = world.now + session.deadline(world.now)
            spins += 1
    assert session.state == CONNECTED
    assert spins < 200
