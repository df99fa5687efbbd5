"""What passes between the threads of a context: mailboxes, bells, and who may do what."""

import asyncio
import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from muros.rclc import Context, Executor, GuardCondition, RclError, Threads
from muros.rclc.host.sharing import Bell, Ended, Mailbox, Seat, call_elsewhere, share

from std_msgs.msg import Int32


class Queue:
    """A handle with a queue, which keeps what comes last or, as services do, what came first."""

    def __init__(self, depth: int, newest: bool = True) -> None:
        self.depth = depth
        self.lost = 0
        self.got: list[Any] = []
        if newest:
            self.take = lambda: None

    def deliver(self, *item: Any) -> None:
        """Takes an item."""
        self.got.append(item)


def fill(queue: Queue, count: int) -> tuple[Seat, Mailbox]:
    """A mailbox into which so many have come."""
    seat = Seat("seat")
    box = Mailbox(queue.deliver, seat)
    for number in range(count):
        box.put(bytes([number]), 0, 1)
    return seat, box


def test_a_mailbox_holds_as_much_as_the_queue_and_keeps_the_newest() -> None:
    queue = Queue(3)
    seat, _ = fill(queue, 8)
    assert seat.hand_on() == 3
    assert [item[0][0] for item in queue.got] == [5, 6, 7]
    assert queue.lost == 5


def test_a_mailbox_of_requests_keeps_those_that_came_first() -> None:
    queue = Queue(3, newest=False)
    seat, _ = fill(queue, 8)
    assert seat.hand_on() == 3
    assert [item[0][0] for item in queue.got] == [0, 1, 2]
    assert queue.lost == 5


def test_what_is_lent_is_copied() -> None:
    queue = Queue(3)
    seat, box = fill(queue, 0)
    buf = bytearray(b"..abc..")
    box.put(7, buf, 2, 3)
    buf[:] = bytes(7)
    whole = b"whole"
    box.put(8, whole, 0, 5)
    seat.hand_on()
    assert queue.got == [(7, b"abc", 0, 3), (8, whole, 0, 5)]
    assert queue.got[1][1] is whole


def test_mail_follows_a_handle_to_another_thread() -> None:
    queue = Queue(3)
    seat, box = fill(queue, 2)
    other = Seat("other")
    box.move(other)
    assert seat.hand_on() == 0
    assert not queue.got
    assert other.hand_on() == 2


def test_a_callback_that_raises_loses_nothing_of_what_waits() -> None:
    queue = Queue(5)
    seat, box = fill(queue, 4)
    taken: list[int] = []

    def take(buf: bytes, off: int, n: int) -> None:
        taken.append(buf[0])
        if buf[0] == 1:
            raise ValueError("one")

    box.take = take
    with pytest.raises(ValueError, match="one"):
        seat.hand_on()
    assert seat.waiting
    seat.hand_on()
    assert taken == [0, 1, 2, 3]


def test_a_bell_stays_rung_until_somebody_has_waited() -> None:
    bell = Bell()
    assert not bell.wait(0)
    bell.ring()
    bell.ring()
    assert bell.wait(60)
    assert not bell.wait(0)


def test_before_and_after_the_threads_everything_is_as_it_was() -> None:
    context = Context("local:")
    node = context.node("node")
    got: list[int] = []
    node.subscription(Int32, "number", lambda msg: got.append(msg.data))
    publisher = node.publisher(Int32, "number")
    sharing = share(context)
    assert share(context) is sharing
    executor = Executor(context)
    for number in range(3):
        assert publisher.publish(Int32(data=number))
        assert executor.spin_until(lambda number=number: number in got, 20)  # type: ignore[misc]
        if number < 2:
            sharing.start()
            with pytest.raises(RclError, match="run already"):
                sharing.start()
            sharing.stop()
    assert context.state == "CONNECTED"
    assert context.ping()
    context.close()
    assert got == [0, 1, 2]


def test_a_thread_with_a_seat_leaves_its_executor_when_it_is_to_end() -> None:
    context = Context("local:")
    sharing = share(context)
    seat = Seat("seat")
    sharing.sit(seat)
    sharing.wait(0)
    assert sharing.spin_once() == 0
    seat.ending = True
    with pytest.raises(Ended):
        sharing.wait(0)
    with pytest.raises(Ended):
        sharing.spin_once()
    sharing.leave()
    context.close()


def test_executors_of_asyncio_programs_are_woken_by_the_carrier() -> None:
    """They run what no thread has claimed, and wait up to a minute."""
    context = Context("local:")
    node = context.node("node")
    ran: list[str] = []
    guard = GuardCondition(context, lambda: ran.append("guard"))
    node.subscription(Int32, "number", lambda msg: ran.append(f"number {msg.data}"))
    publisher = node.publisher(Int32, "number")
    threads = Threads(context)
    threads.executor("own").add(node.timer(60.0, lambda: None))

    async def main() -> None:
        executor = Executor(context, timeout=60.0)
        with threads:
            spinning = asyncio.create_task(executor.spin_until_async(lambda: len(ran) == 2, 50.0))
            await asyncio.sleep(0)
            threading.Thread(target=publisher.publish, args=(Int32(data=5),)).start()
            while not ran:
                await asyncio.sleep(0)
            threading.Thread(target=guard.trigger).start()
            assert await spinning

    asyncio.run(main())
    context.close()
    assert ran == ["number 5", "guard"]


def test_a_middleware_that_cannot_be_shared_is_said() -> None:
    class Entity:
        """Has no taker that can be exchanged."""

    context = Context("local:")
    node = context.node("node")
    subscription = node.subscription(Int32, "number", None)
    subscription.entity = Entity()
    threads = Threads(context)
    with pytest.raises(RclError, match="cannot be shared by threads: what it makes, such as Entity"):
        threads.executor("own").add(subscription)
    context.handles.clear()
    context.close()


def test_a_call_whose_room_another_has_taken_begins_again() -> None:
    rooms = [True, False, True, True]
    begun: list[int] = []
    sharing = SimpleNamespace(
        wake=lambda: None,
        spin_once=lambda: None,
        wait=lambda left: None,
        call_in=lambda handle: lambda function: function(),
    )
    handle = SimpleNamespace(context=SimpleNamespace(sharing=sharing, running=True))

    def begin(done: Callable[[], object]) -> None:
        begun.append(len(rooms))
        done()

    call_elsewhere(handle, lambda: rooms.pop(0), begin, timeout=60.0)
    assert begun == [0]
