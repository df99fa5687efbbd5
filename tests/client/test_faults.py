"""The session when things go wrong: request ids that meet, refused entities, callbacks that raise."""

from collections.abc import Callable
from typing import Any

import pytest

from muros.client import CONNECTED, CONNECTING, LOST, WAITING
from muros.client import problems as problem
from muros.client.creating import status
from muros.client.raw import Raw
from tests.client.test_session import Device, kinds
from tests.client.world import STRING, World

LAST_REQUEST = 0xFFFE
FIRST_REQUEST = 10
CREATE_CLIENT = 0


@pytest.mark.parametrize("samples", [5, 0])
def test_reading_again_does_not_take_the_answers_of_an_entity_under_way(samples: int) -> None:
    world = World()
    device = Device(world).connect()
    device.host_writer.write(b"before")
    world.run(50)
    late = device.session.writer(device.participant, "rt/late", STRING)
    device.session.spin_once(world.now)
    device.reader.read(samples)
    world.run(100)
    assert device.session.pending == 0
    assert late.write_bytes(b"now")


def test_every_request_id_may_be_the_first_of_an_entity() -> None:
    world = World()
    device = Device(world, qos="best_effort").connect()
    session = device.session
    for start in range(LAST_REQUEST - 6, LAST_REQUEST + 2):
        session.request = start - 1
        device.writer.write_bytes(b"loose")
        made = session.reader(device.participant, "rt/more", STRING)
        device.reader.read(5)
        world.run(100)
        assert session.pending == len(session.asked) == 0, f"beginning with request {start}"
        assert made.status == 0
    assert not device.problems


def test_an_answer_about_another_object_is_none() -> None:
    world = World()
    device = Device(world).connect()
    session = device.session
    late = session.writer(device.participant, "rt/late", STRING)
    world.network.partition(["client"])
    session.spin_once(world.now)
    status(session, late.request - 3, late.object_id(2), 0x87)
    status(session, late.request, late.object_id(2), 0x87)
    assert len(session.asked) == 3
    assert late.todo == 0b1110
    assert not device.problems
    status(session, late.request - 3, late.object_id(3), 0)
    assert len(session.asked) == 2
    assert late.todo == 0b0110


@pytest.mark.parametrize("queue", [0, 4])
def test_replies_have_the_numbers_of_their_requests_when_ids_wrap(queue: int) -> None:
    world = World()
    server, client = world.client("server", client_key=1), world.client("client", client_key=2, queue=queue)
    replies: list[int] = []
    replier = server.replier(
        server.participant("server"),
        "/add",
        "pkg/srv/Add",
        lambda identity, buf, off, n: replier.reply(identity, Raw(b"r")),
    )
    requester = client.requester(
        client.participant("client"), "/add", "pkg/srv/Add", lambda number, *_: replies.append(number)
    )
    world.until(lambda: server.state == client.state == CONNECTED)
    world.run(50)
    sent = []
    client.request = LAST_REQUEST - 3
    for _ in range(6):
        if queue:
            client.keep()  # they go through the backlog
        sent.append(requester.send(Raw(b"q")))
        world.run(50)
    assert replies == sent == [LAST_REQUEST - 2, LAST_REQUEST - 1, LAST_REQUEST, 10, 11, 12]


def test_what_is_written_to_a_refused_writer_is_refused_and_counted() -> None:
    world = World()
    world.stop_agent()
    world.start_agent(max_objects=3)
    device = Device(world).connect()
    assert device.writer.status >= 0x80
    assert device.writer.todo == 0x10
    assert not device.writer.write_bytes(b"to nobody")
    assert device.session.drops[0] == 1
    assert [code for code, _ in device.problems][-1] == problem.OFFLINE


class TroubleError(Exception):
    """What a user's callback raises."""


def once(function: Callable[..., object]) -> Callable[..., object]:
    """A callback that works and raises, the first time."""
    calls: list[object] = []

    def callback(*arguments: Any) -> None:
        function(*arguments)
        calls.append(arguments)
        if len(calls) == 1:
            raise TroubleError

    return callback


def run(world: World, ms: int) -> int:
    """Lets time pass, spinning on after each TroubleError; how many there were."""
    troubles, end = 0, world.now + ms
    while world.now < end:
        try:
            world.run(end - world.now)
        except TroubleError:
            troubles += 1
    return troubles


def test_a_reader_that_raises_has_had_its_sample() -> None:
    world = World()
    device = Device(world).connect()
    device.reader.deliver = once(lambda buf, off, n: device.got.append(bytes(buf[off : off + n])))
    for i in range(5):
        device.host_writer.write(b"%d" % i)
    assert run(world, 500) == 1
    assert device.got == [b"0", b"1", b"2", b"3", b"4"]


def test_an_on_state_that_raises_stops_nothing() -> None:
    for bad in (CONNECTING, CONNECTED, LOST):
        world = World()
        device = Device(world)
        fail = once(lambda state: None)
        device.session.on_state = lambda state, bad=bad, fail=fail: fail(state) if state == bad else None
        assert run(world, 1000) == (bad != LOST)
        world.network.partition(["client"])
        assert run(world, 3000) == (bad == LOST)
        world.network.heal()
        assert run(world, 1000) == 0
        assert device.session.state == CONNECTED
        assert device.writer.write_bytes(b"well")
        world.run(100)
        assert device.heard == [b"well"]


def test_an_on_problem_that_raises_stops_nothing() -> None:
    world = World()
    world.stop_agent()
    world.start_agent(max_objects=4)
    device = Device(world)
    told: list[int] = []
    device.session.on_problem = once(lambda code, text: told.append(code))
    assert run(world, 2000) == 1
    assert told == [problem.ENTITY]
    assert device.session.pending == len(device.session.asked) == 0
    assert device.writer.write_bytes(b"still")
    world.run(50)
    assert device.heard == [b"still"]


def test_an_on_problem_may_destroy_what_was_refused() -> None:
    world = World()
    world.stop_agent()
    world.start_agent(max_objects=4)
    device = Device(world)
    device.session.on_problem = lambda code, text: device.reader.destroy()
    device.connect()
    world.run(100)
    assert device.session.pending == len(device.session.asked) == 0
    assert device.reader not in device.session.entities


def test_an_on_problem_that_raises_when_the_session_is_refused() -> None:
    world = World()
    world.stop_agent()
    world.start_agent(max_clients=1)
    Device(world, address="other", client_key=1).connect()
    device = Device(world)
    device.session.on_problem = once(lambda code, text: None)
    assert run(world, 4000) == 1
    assert device.session.state == WAITING
    assert len(kinds(device.transport.log, "c>a", CREATE_CLIENT)) == 1, "it asks again slowly"


def test_an_on_problem_that_raises_when_the_streams_began_again() -> None:
    world = World()
    device = Device(world, properties=False).connect()
    for i in range(6):
        assert device.writer.write_bytes(b"%d" % i)
        world.run(20)
    device.session.on_problem = once(lambda code, text: None)
    (hello, *_) = kinds(device.transport.log, "c>a", CREATE_CLIENT)
    world.port.receive(hello, "client", world.now)
    assert run(world, 5000) == 1
    assert device.session.state == CONNECTED
    assert device.states.count(CONNECTING) == 2


def test_a_board_without_room_for_what_it_borrows_goes_on_later(monkeypatch: pytest.MonkeyPatch) -> None:
    """The heap of a board may be full when a message was lost, or the agent is: nothing raises, it is done later."""
    world = World()
    device = Device(world).connect()
    session = device.session

    def nothing(name: str = "") -> None:
        raise MemoryError(name)

    monkeypatch.setattr("muros.client.session.borrow", nothing)
    monkeypatch.setattr(session, "mend", nothing)
    world.network.loss = 0.5
    for i in range(20):
        device.writer.write_bytes(b"%d" % i)
        device.host_writer.write(b"%d" % i)
        world.run(20)
    assert session.mender is None
    world.network.partition(["client"])
    world.run(3000)
    assert session.state == CONNECTED, "it has no room for the guide"
    monkeypatch.undo()
    world.network.heal()
    world.network.loss = 0.0
    world.run(3000)
    assert session.state == CONNECTED
    assert device.got == [b"%d" % i for i in range(20)]
