"""What a context is told of its session, and what waits for confirmations, in virtual time."""

from typing import Any

import pytest

from muros.client import Session
from muros.client._types import Transport
from muros.rclc import Context
from tests.client.replay import Wire, submessages
from tests.client.world import World
from tests.rclc.test_rclc import two

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32

DELETE = 3


class Counting(Wire):
    """A transport that counts how long it was waited at."""

    def __init__(self) -> None:
        super().__init__()
        self.waited = 0

    def wait(self, timeout: int) -> None:
        """Lets time pass."""
        self.waited += timeout


def test_options_of_the_session_that_is_made() -> None:
    wire: Transport = Wire()
    context = Context(wire, 0x01020304, queue=8, history=8, creation_timeout=500, mtu=256)
    session: Any = context.middleware
    assert isinstance(session, Session)
    assert (session.queue, session.reliable.history, session.mtu) == (8, 8, 252)
    assert session.creation_timeout == 500
    assert session.key == b"\1\2\3\4"


@pytest.mark.parametrize("options", [{"queue": 8}, {"client_key": 5}, {"creation_timeout": 5}])
def test_options_of_a_session_that_there_is(options: dict[str, Any]) -> None:
    (name,) = options
    with pytest.raises(
        TypeError, match=rf"{name} belongs to the session: Context\(Session\(transport, {name}="
    ):
        Context(Session(Wire(), 1), **options)
    with pytest.raises(TypeError, match="belongs to the session"):
        Context("local:", **options)


def test_an_option_that_does_not_exist() -> None:
    with pytest.raises(TypeError, match="Session has no option fast"):
        Context(Wire(), fast=True)  # type: ignore[call-arg]


@pytest.mark.parametrize(("patience", "goodbyes", "waited"), [(0, 1, 0), (250, 3, 250), (1000, 10, 1000)])
def test_how_long_a_close_waits(patience: int, goodbyes: int, waited: int) -> None:
    wire = Counting()
    session = Session(wire, 1, destroy_timeout=patience)
    session.up, session.away = True, 0  # connected, to an agent that has fallen silent
    session.close()
    kinds = [kind for message in wire.sent for kind, *_ in submessages(message)]
    assert (kinds.count(DELETE), wire.waited) == (goodbyes, waited)


def test_publish_waits_for_its_confirmation_when_asked() -> None:
    world = World()
    alice, bob = two(world)
    publisher: Any = alice.node.publisher(Int32, "value")
    quick: Any = alice.node.publisher(Int32, "quick", "sensor_data")
    alice.connect()
    started = world.now
    assert publisher.publish(Int32(data=1))
    assert world.now == started, "it waits for nothing"
    assert publisher.publish(Int32(data=2), timeout=1.0)
    assert alice.session.reliable.first == alice.session.reliable.next
    assert quick.publish(Int32(data=3), timeout=1.0), "best effort is confirmed by nobody, and not waited for"
    world.network.partition(["alice"], ["agent"])
    started = world.now
    assert not publisher.publish(Int32(data=4), timeout=0.3)
    assert 300 <= world.now - started < 400
    publisher.session_timeout = 0.1
    started = world.now
    assert not publisher.publish(Int32(data=5))
    assert 100 <= world.now - started < 200
    world.network.heal()
    del bob


def test_publish_waits_for_room_when_asked() -> None:
    world = World()
    alice, bob = two(world)
    got: list[int] = []
    bob.node.subscription(Int32, "value", lambda message: got.append(message.data))
    publisher: Any = alice.node.publisher(Int32, "value")
    bob.connect()
    assert publisher.publish(Int32(data=1), timeout=2.0), "it waits for the connection"
    world.network.partition(["alice"], ["agent"])
    while publisher.publish(Int32(data=2)):
        pass
    dropped = sum(alice.session.drops)
    assert not publisher.publish(Int32(data=3), timeout=0.1)
    assert sum(alice.session.drops) == dropped + 1, "it was not taken, which is told once"
    world.network.heal()
    assert publisher.publish(Int32(data=4), timeout=2.0)
    bob.spin(bob.executor(), 500)
    assert got == [1, *[2] * alice.session.reliable.history, 4]


def test_publish_waits_for_no_room_that_will_not_come() -> None:
    world = World()
    alice, _ = two(world)
    publisher: Any = alice.node.publisher(Int32, "value")
    quick: Any = alice.node.publisher(Int32, "quick", "sensor_data")
    started = world.now
    assert not quick.publish(Int32(data=1), timeout=1.0), "best effort waits for nothing"
    assert world.now == started
    alice.connect()
    publisher.destroy()
    started = world.now
    assert not publisher.publish(Int32(data=1), timeout=1.0)
    assert world.now == started


def test_requests_and_answers_wait_for_theirs() -> None:
    world = World()
    alice, bob = two(world)
    service = bob.node.service(AddTwoInts, "add", lambda request: AddTwoInts.Response(sum=request.a))
    client = alice.node.client(AddTwoInts, "add")
    client.session_timeout = service.session_timeout = 1.0
    alice.connect()
    bob.connect()
    got: list[Any] = []
    assert client.send(AddTwoInts.Request(a=3), lambda reply: got.append(reply.sum))
    assert alice.session.reliable.first == alice.session.reliable.next
    bob.spin(bob.executor(), 50)
    assert bob.session.reliable.first == bob.session.reliable.next
    alice.spin(alice.executor(), 50)
    assert got == [3]


def test_a_context_waits_until_it_is_connected() -> None:
    world = World()
    alice, _ = two(world)
    alice.node.publisher(Int32, "value")
    assert not alice.context.wait_connected(0.0)
    assert alice.context.wait_connected(2.0)
    assert alice.session.pending == 0
    world.network.partition(["alice"], ["agent"])
    alice.node.publisher(Int32, "other")
    assert not alice.context.wait_connected(0.2)
