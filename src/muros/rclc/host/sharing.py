"""A context whose executors run in several threads: who waits on the middleware, and how the others are woken.

Theory of operation. Everything that handles are made of belongs to one thread, that of the executor that runs them;
only three things pass between threads: what has come, what is published, and calls that are handed over. So handles
and executors have no locks, and are the same whether there is one thread or many.

- *What has come.* One thread, the carrier, waits on the middleware and lets it work. What it takes for a handle it
  puts into the handle's mailbox, as bytes: it never runs a callback of a handle, and reading a message is done, and
  paid for in time and priority, by the thread that wants it. Each thread has a seat with a bell; mail rings it. What
  the executor takes for its middleware is in truth ``Sharing``: its ``spin_once`` hands the mail of this thread's seat
  to the handles, its ``wait`` sleeps until the bell rings. A mailbox holds as much as the handle's queue; what
  overflows is counted in the handle's ``lost``. A subscription is given the next message when it has processed the
  last, so that there is one queue and not two.
- *What is published* goes straight into the session or the space, which have a lock of their own.
- *Calls.* A request that is sent, or an answer that is given, in another thread than that of the handle is handed over
  and made there (``call_in``).

Threads without a seat, such as the main one, may wait, ask and publish like any other. They are woken after each turn
of the carrier, since nobody knows what they wait for. One of them, that which called ``start``, may run an executor
too: for what no thread has claimed.

While the carrier does not run, everything passes straight through.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

from muros.rclc.errors import RclError
from muros.rclc.host.handles import GuardCondition, Timer
from muros.rclc.memory import Guard

if TYPE_CHECKING:
    from muros.client.qos import Qos
    from muros.rclc._types import Entity, Publisher, Replier, Requester
    from muros.rclc.host.context import Context

__all__ = ["Bell", "Ended", "Seat", "Sharing", "call_elsewhere", "hand_over", "share"]

_NEVER = 1_000_000
_DEPTH = 1000
"""Samples that wait for what has no queue of its own."""
_PATIENCE = 2.0
"""Seconds that the end of the carrier is waited for."""
_NAP = 10
"""Milliseconds for which a middleware is waited on that cannot be woken."""
_LOOK = 5
"""Milliseconds after which an asyncio program looks for what has come while no carrier does."""


class Ended(BaseException):
    """Leaves an executor whose thread is to end, between two callbacks."""


class Bell:
    """What a thread sleeps on; it stays rung until somebody has waited for it. Signal handlers may ring it too."""

    def __init__(self) -> None:
        self._rung = threading.Lock()
        self._rung.acquire()

    def ring(self) -> None:
        """Rings, from any thread."""
        try:
            self._rung.release()
        except RuntimeError:
            pass  # it rings already

    def wait(self, seconds: float) -> bool:
        """Waits until it rings, at most so long; whether it did."""
        return self._rung.acquire(timeout=min(max(seconds, 0.0), threading.TIMEOUT_MAX))


class Seat:
    """Where a thread finds what has come for its handles."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.bell = Bell()
        self.ending = False
        """Whether its thread is to leave its executor."""
        self._due: deque[Mailbox] = deque()
        self._held: deque[Mailbox] = deque()  # their handles have yet to take what they were given
        self._calls: deque[Callable[[], object]] = deque()

    @property
    def waiting(self) -> bool:
        """Whether there is something to hand on."""
        return bool(self._due or self._calls)

    def announce(self, mailbox: Mailbox) -> None:
        """A mailbox has something."""
        self._due.append(mailbox)
        self.bell.ring()

    def hold(self, mailbox: Mailbox) -> None:
        """A mailbox has more than its handle takes now; for this thread alone."""
        self._held.append(mailbox)

    def call(self, function: Callable[[], object]) -> None:
        """Has the thread call a function."""
        self._calls.append(function)
        self.bell.ring()

    def hand_on(self) -> int:
        """Gives the handles what has come, and makes calls; how many that were. What a callback raises comes out."""
        done = 0
        for _ in range(len(self._calls)):
            done += 1
            self._calls.popleft()()
        for boxes in (self._held, self._due):
            for _ in range(len(boxes)):
                mailbox = boxes.popleft()
                if mailbox.seat is self:
                    done += mailbox.hand_on()
        return done


class Mailbox:
    """What has come for one callback of the middleware and waits for the thread that wants it."""

    def __init__(self, take: Callable[..., object], seat: Seat) -> None:
        self.take = take
        self.seat = seat
        """Whose it is; ``move`` gives it to another."""
        owner: Any = getattr(take, "__self__", None)
        self._handle: Any = owner.handle if isinstance(owner, Guard) else owner
        self._depth: int = getattr(self._handle, "depth", 0) or _DEPTH
        self._newest = not hasattr(
            self._handle, "take"
        )  # of requests and replies those that come last are dropped
        self._mail: deque[tuple[Any, ...]] = deque()
        self._announced = False
        self._lost = 0
        self._told = 0

    def put(self, *item: Any) -> None:
        """Takes what the middleware has: ``(..., buf, off, n)``, whose bytes are only lent."""
        *head, buf, off, n = item
        if not (type(buf) is bytes and off == 0 and n == len(buf)):
            buf = bytes(memoryview(buf)[off : off + n])
        if len(self._mail) >= self._depth:
            self._lost += 1
            if self._newest:
                return
            try:
                self._mail.popleft()
            except IndexError:
                pass  # it has just been taken
        self._mail.append((*head, buf, 0, n))
        if not self._announced:
            self._announced = True
            self.seat.announce(self)

    def move(self, seat: Seat) -> None:
        """Belongs to another thread from now on, with what is in it."""
        self.seat = seat
        if self._mail:
            seat.announce(self)

    def hand_on(self) -> int:
        """Gives the handle what is here now; how many that were."""
        self._announced = False
        if self._lost != self._told:
            lost = self._lost
            if hasattr(self._handle, "lost"):
                self._handle.lost += lost - self._told
            self._told = lost
        count = 0
        full = False
        try:
            for _ in range(len(self._mail)):
                full = self._is_full()
                if full:
                    break
                try:
                    item = self._mail.popleft()
                except IndexError:
                    break  # the carrier is about to put a newer one in its place
                count += 1
                self.take(*item)
        finally:
            if full:
                self.seat.hold(self)
            elif self._mail and not self._announced:
                self._announced = True
                self.seat.announce(self)
        return count

    def _is_full(self) -> bool:
        """Whether a subscription has yet to process what it was given: then more would be out of date before it is.

        With a trigger the subscription's own queue decides what is dropped, and one without a callback is asked for
        all that there is.
        """
        handle = self._handle
        return (
            not self._newest
            and getattr(handle, "eager", False)
            and getattr(handle, "callback", None) is not None
            and handle.ready(0)
        )


class Sharing:
    """The middleware of a context that several threads run; what is not here is that of the real one.

    ``start`` begins the carrier, ``stop`` ends it; ``carrier`` is its thread while it runs. Callbacks of states run
    there, and what they raise ends it.
    """

    def __init__(self, context: Context) -> None:
        self.context = context
        self.real: Any = context.middleware
        self.running = False
        self.carrier: threading.Thread | None = None
        self.common = Seat("the other threads")
        self._seats: dict[int, Seat] = {}
        self._owners: WeakKeyDictionary[Any, Seat] = WeakKeyDictionary()
        self._starter = 0  # the thread that may run what nobody has claimed
        self._watching: set[Seat] = set()
        self._bells: list[Callable[[], None]] = []  # of asyncio programs
        self._turned = threading.Condition()
        self._turn = 0
        self._outsiders = 0
        self._local = _Seen()

    def __getattr__(self, name: str) -> Any:
        return getattr(self.real, name)

    # Threads

    def start(
        self,
        prepare: Callable[[], object] = lambda: None,
        on_failure: Callable[[BaseException], object] = lambda error: None,
    ) -> None:
        """Begins the carrier, which calls ``prepare()`` first, and ``on_failure(error)`` if it ends by an error.

        Raises RclError when it runs already.
        """
        if self.carrier is not None:
            raise RclError("the threads of this context run already")
        for handle in self.context.handles:
            self.claim(handle, self.common)
        self._starter = threading.get_ident()
        self.running = True
        carrier = threading.Thread(
            target=self._carry, args=(prepare, on_failure), name="muros carrier", daemon=True
        )
        self.carrier = carrier
        carrier.start()

    def stop(self) -> None:
        """Ends the carrier. What waits in mailboxes goes on to its handles when somebody spins.

        Who is asked to by a callback that holds the lock of the session goes on before the carrier has ended.
        """
        self.running = False
        self._wake_carrier()
        carrier = self.carrier
        if carrier is not None and carrier is not threading.current_thread():
            carrier.join(_PATIENCE)
        self._announce_turn()

    def sit(self, seat: Seat) -> None:
        """This thread has a seat from now on."""
        self._seats[threading.get_ident()] = seat

    def leave(self) -> None:
        """This thread has none any more."""
        self._seats.pop(threading.get_ident(), None)

    def claim(self, handle: Any, seat: Seat) -> None:
        """A handle, with all that it is made of, belongs to the thread of a seat from now on."""
        parts = getattr(handle, "parts", ())
        for part in (handle, *parts):
            self._owners[part] = seat
            entity = getattr(part, "entity", None)
            if entity is None:
                if not parts and not isinstance(part, Timer | GuardCondition):
                    self._watching.add(seat)  # it looks for itself what has happened
                continue
            if not hasattr(type(entity), "taker"):
                raise RclError(
                    f"the middleware of this context cannot be shared by threads: what it makes, such as "
                    f"{type(entity).__name__}, has no taker that can be exchanged"
                )
            box = getattr(entity.taker, "__self__", None)
            if isinstance(box, Mailbox):
                box.move(seat)
            elif entity.taker is not None:
                entity.taker = Mailbox(entity.taker, seat).put

    def call_in(self, handle: Any) -> Callable[[Callable[[], object]], object] | None:
        """What hands a call over to the thread of a handle; None in that thread, and when there are no threads."""
        if not self.running:
            return None
        seat = self._owners.get(handle, self.common)
        return None if seat is self._seat() else seat.call

    # What a middleware does

    @property
    def state(self) -> int:
        """The state of the real one."""
        state: int = self.real.state
        return state

    @property
    def on_state(self) -> Callable[[int], object] | None:
        """Told each new state, by the carrier."""
        told: Callable[[int], object] | None = self.real.on_state
        return told

    @on_state.setter
    def on_state(self, tell: Callable[[int], object] | None) -> None:
        self.real.on_state = tell

    @property
    def on_problem(self) -> Callable[[int, str], object] | None:
        """Told each problem, by the thread that meets it."""
        told: Callable[[int, str], object] | None = self.real.on_problem
        return told

    @on_problem.setter
    def on_problem(self, tell: Callable[[int, str], object] | None) -> None:
        self.real.on_problem = tell

    def participant(self, name: str, domain: int = 0, /) -> Any:
        """A node."""
        return self.real.participant(name, domain)

    def writer(
        self, participant: Any, topic: str, type_name: str, qos: str | Qos = "default", /
    ) -> Publisher:
        """A writer."""
        made: Publisher = self.real.writer(participant, topic, type_name, qos)
        return made

    def reader(
        self,
        participant: Any,
        topic: str,
        type_name: str,
        qos: str | Qos = "default",
        on_data: Callable[..., object] | None = None,
        /,
    ) -> Entity:
        """A reader, whose samples go to whoever runs what no thread has claimed until one has."""
        made: Entity = self.real.reader(participant, topic, type_name, qos, self._boxed(on_data))
        return made

    def requester(
        self,
        participant: Any,
        name: str,
        type_name: str,
        on_reply: Callable[..., object],
        qos: str | Qos = "services",
        /,
    ) -> Requester:
        """A client of a service."""
        made: Requester = self.real.requester(participant, name, type_name, self._boxed(on_reply), qos)
        return made

    def replier(
        self,
        participant: Any,
        name: str,
        type_name: str,
        on_request: Callable[..., object],
        qos: str | Qos = "services",
        /,
    ) -> Replier:
        """A server of a service."""
        made: Replier = self.real.replier(participant, name, type_name, self._boxed(on_request), qos)
        return made

    def spin_once(self, now: int | None = None, /) -> int:
        """Hands on what has come for the handles of this thread."""
        seat = self._seats.get(threading.get_ident())
        if seat is None:
            if self.carrier is None:
                taken: int = self.real.spin_once(now)
                return taken + self._hand_on_rest()
            self._local.turn = self._turn
            seat = self._seat()
            if seat is None:
                return 0
        if seat.ending:
            raise Ended
        return seat.hand_on()

    def wait(self, timeout: float, /) -> None:
        """Waits until something has come for this thread, at most ``timeout`` ms."""
        seat = self._seats.get(threading.get_ident())
        if seat is None:
            if self.carrier is None:
                self.real.wait(timeout)
            else:
                self._wait_for_turn(timeout)
            return
        if seat.ending:
            raise Ended
        seat.bell.wait(timeout / 1000)

    async def wait_async(self, timeout: float, /) -> None:
        """``wait`` in an asyncio program, whose loop goes on meanwhile."""
        import asyncio  # programs without a loop need not load it

        if self.carrier is None:
            await asyncio.sleep(min(timeout, _LOOK) / 1000)
            return
        loop = asyncio.get_running_loop()
        came = asyncio.Event()

        def bell() -> None:
            with suppress(RuntimeError):  # the loop is closed
                loop.call_soon_threadsafe(came.set)

        self._bells.append(bell)
        try:
            if self._local.turn == self._turn and not self.common.waiting:
                with suppress(TimeoutError):
                    await asyncio.wait_for(came.wait(), timeout / 1000)
        finally:
            self._bells.remove(bell)

    def deadline(self, now: int, /) -> int:
        """Milliseconds until ``spin_once`` is wanted."""
        seat = self._seat()
        if seat is self.common and self.carrier is None:
            left: int = self.real.deadline(now)
            return left
        return 0 if seat is not None and seat.waiting else _NEVER

    def ping(self, timeout: int, clock: Callable[[], int], /) -> bool:
        """Whether the agent answers within ``timeout`` ms."""
        answered: bool = self.real.ping(timeout, clock)
        return answered

    def wake(self) -> None:
        """Ends every wait, from any thread."""
        for seat in list(self._seats.values()):
            seat.bell.ring()
        self._announce_turn()
        if self.carrier is None:
            self._wake_carrier()  # who waits there is none

    def close(self) -> None:
        """Has all threads end, and takes leave of the graph."""
        for seat in list(self._seats.values()):
            seat.ending = True
            seat.bell.ring()
        self.stop()
        self.real.close()

    # Helpers

    def _seat(self) -> Seat | None:
        """The seat of this thread; None if it has none and somebody else runs what nobody has claimed."""
        this = threading.get_ident()
        seat = self._seats.get(this)
        if seat is not None:
            return seat
        return self.common if this == self._starter or self.carrier is None else None

    def _boxed(self, take: Callable[..., object] | None) -> Any:
        return None if take is None else Mailbox(take, self.common).put

    def _hand_on_rest(self) -> int:
        """What threads that have ended left behind."""
        return sum(seat.hand_on() for seat in {self.common, *self._owners.values()} if seat.waiting)

    def _carry(self, prepare: Callable[[], object], on_failure: Callable[[BaseException], object]) -> None:
        """The carrier's thread."""
        real = self.real
        clock = self.context.clock
        wakes = hasattr(real, "wake")
        try:
            prepare()
            while self.running and self.context.running:
                now = clock()
                real.spin_once(now)
                self._announce_turn()
                if self.running:
                    left = real.deadline(now)
                    real.wait(max(int(left if wakes else min(left, _NAP)), 0))
        except BaseException as error:
            on_failure(error)
        finally:
            self.running = False
            self.carrier = None
            self._announce_turn()

    def _announce_turn(self) -> None:
        """Wakes the threads without a seat, and those with handles that have no mailbox."""
        with self._turned:
            self._turn += 1
            if self._outsiders:
                self._turned.notify_all()
        for seat in self._watching:
            seat.bell.ring()
        for bell in list(self._bells):
            bell()

    def _wait_for_turn(self, timeout: float) -> None:
        """Waits for the carrier's next turn, if there was none since this thread has looked."""
        with self._turned:
            self._outsiders += 1
            try:
                if self._local.turn == self._turn and not self.common.waiting:
                    self._turned.wait(timeout / 1000)
            finally:
                self._outsiders -= 1

    def _wake_carrier(self) -> None:
        wake = getattr(self.real, "wake", None)
        if wake is not None:
            wake()


class _Seen(threading.local):
    """The turn at which each thread has looked."""

    turn = -1


def call_elsewhere(
    handle: Any,
    room: Callable[[], bool],
    begin: Callable[[Callable[[], object]], object],
    timeout: float,
) -> None:
    """Waits for what another thread does for a handle of its own, at most ``timeout`` seconds.

    That thread calls ``begin(done)`` as soon as there is ``room()``, and ``done()`` when it has come about. Of several
    calls that saw the same room the others wait for more.
    """
    sharing: Sharing = handle.context.sharing
    over = begun = False

    def done() -> None:
        nonlocal over
        over = True
        sharing.wake()

    def start() -> None:
        nonlocal begun
        if room():
            begin(done)
        else:
            begun = False
            sharing.wake()

    end = time.monotonic() + timeout
    while not over:
        left = 1000 * (end - time.monotonic())
        if left <= 0 or not handle.context.running:
            return
        if not begun and room():
            begun = True
            (hand_over(handle) or _at_once)(start)
        sharing.spin_once()
        if not over:
            sharing.wait(int(left if begun else min(left, _NAP)) + 1)


def hand_over(handle: Any) -> Callable[[Callable[[], object]], object] | None:
    """What hands a call over to the thread of a handle; None if this is it, or there are no threads."""
    sharing: Sharing | None = handle.context.sharing
    return None if sharing is None else sharing.call_in(handle)


def share(context: Context) -> Sharing:
    """Has a context shared by threads from now on. RclError where the loop of an asyncio program serves its space."""
    if isinstance(context.middleware, Sharing):
        return context.middleware
    if not getattr(context.middleware, "served", True):
        raise RclError(
            "the asyncio loop of this program serves the space of this context, which threads cannot share: have "
            "tasks `await executor.spin_async()`, or give the context a space of its own, as Context('dds:') has"
        )
    made = Sharing(context)
    context.middleware = made  # type: ignore[assignment]  # nobody sets the state from outside
    context.sharing = made
    return made


def _at_once(function: Callable[[], object]) -> None:
    function()
