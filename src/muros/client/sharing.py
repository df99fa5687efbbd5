"""A session that several threads use. Hosts only: boards have one thread and pay for no lock.

Theory of operation. One lock guards all that a session has; it is held while messages are taken, made and sent, and
never while somebody sleeps. So what callbacks of a session do, they do with the lock held: they may publish, but must
not wait for another thread that does.

Only one thread at a time sleeps in the transport, the *leader*. Others that wait meanwhile *follow*: they are told
when the leader has got up. A message that one thread has taken may be what another one waits for: so whatever comes
moves the session's generation on and ends every wait. A thread remembers the generation it saw when it looked at the
session last, and does not wait at all when there has been a newer one since: so nothing is missed between looking and
waiting. What makes something due sooner than the leader meant to get up, such as the repetition of what was just
published, wakes it. Where another thread has looked and nobody sleeps yet, that may be missed as well: so it is kept
for whoever leads next.

A leader sleeps on the file of the transport and on a pipe, and a byte in the pipe wakes it. A transport of the user's
own has no file that we know of: its leader gets up every 10 ms once there is more than one thread.
"""

from __future__ import annotations

import os
import select
import threading
import weakref
from typing import TYPE_CHECKING, Any

from muros.client import entities, services
from muros.client import session as board
from muros.client.link import CONNECTED
from muros.compat import ticks_add, ticks_diff, ticks_ms

if TYPE_CHECKING:
    from muros.client._types import Message, OnData, Outgoing, Transport
    from muros.client.hosts import Session

_SLICE = 10
"""Milliseconds that the leader of several threads sleeps in a transport without a file."""


class Turnstile:
    """Where the threads of a session wait."""

    def __init__(self) -> None:
        self._changed = threading.Condition()  # its lock may be taken again by a signal's handler
        self._generation = 0
        self._seen = _Seen()
        self._sleeping = False  # whether there is a leader
        self._followers = 0
        self._end = 0  # the tick at which the leader gets up
        self._sooner: int | None = None  # the tick by which the next leader gets up, if any
        self._threads = 0
        self.several = False
        """Whether more than one thread looks at the session, or wakes those who wait."""
        self._pipe: tuple[int, int] | None = None
        self._poller: Any = None
        self._polled: Any = None

    def look(self) -> None:
        """This thread is about to look at the session."""
        self._remember(self._generation)

    @property
    def leading(self) -> bool:
        """Whether somebody sleeps, or may be about to since another thread has looked: who must hear of what is due."""
        return self._sleeping or self._threads > (self._seen.generation >= 0)

    @property
    def seen(self) -> int:
        """The generation that this thread has seen, for another one that is to wait in its place."""
        return self._seen.generation

    def adopt(self, generation: int) -> None:
        """This thread waits in the place of one that has seen a generation."""
        self._remember(generation)

    def wake(self, others: bool = False) -> None:
        """Ends every wait, and the next one of each thread that has not looked since; from any thread.

        ``others``: but not the next one of this thread, which knows already.
        """
        with self._changed:
            fresh = self._seen.generation == self._generation
            self._generation += 1
            if others and fresh:
                self._seen.generation = self._generation
            self.several = True
            if self._followers:
                self._changed.notify_all()
            if self._sleeping and self._pipe is not None:
                try:
                    os.write(self._pipe[1], b"\0")
                except BlockingIOError:
                    pass  # there is enough in it to wake anybody

    def due(self, tick: int) -> None:
        """Something is due at a tick: a leader that would sleep longer gets up, and so does the next one."""
        with self._changed:
            if not self._sleeping:
                if self._sooner is None or ticks_diff(self._sooner, tick) > 0:
                    self._sooner = tick
            elif ticks_diff(self._end, tick) > 0:
                self.wake()

    def wait(self, transport: Transport | None, timeout: int) -> None:
        """Waits until something may have come over the transport or ``wake`` is called, at most ``timeout`` ms."""
        with self._changed:
            if self._missed:
                return
            if self._sleeping:
                self.several = True
                self._followers += 1
                try:
                    self._changed.wait(timeout / 1000)
                finally:
                    self._followers -= 1
                return
            now = ticks_ms()
            if self._sooner is not None:
                timeout = max(0, min(timeout, ticks_diff(self._sooner, now)))
                self._sooner = None
            self._end = ticks_add(now, timeout)
            if self._pipe is None:
                self._make_pipe()
            self._sleeping = True
        try:
            if not self._missed:  # a signal's handler may have come in between, lock or no lock
                self._sleep(transport, timeout)
        finally:
            with self._changed:
                self._sleeping = False
                if self._followers:
                    self._changed.notify_all()

    @property
    def _missed(self) -> bool:
        """Whether something has happened since this thread looked."""
        return self.several and self._seen.generation != self._generation

    def _remember(self, generation: int) -> None:
        if self._seen.generation < 0:
            with self._changed:
                self._threads += 1
                self.several = self.several or self._threads > 1
        self._seen.generation = generation

    def _sleep(self, transport: Transport | None, timeout: int) -> None:
        assert self._pipe is not None
        file = getattr(transport, "_file", None)
        if transport is not None and file is None:
            transport.wait(min(timeout, _SLICE) if self.several else timeout)
            return
        if self._poller is None or self._polled is not file:
            self._poller = select.poll()
            self._poller.register(self._pipe[0], select.POLLIN)
            if file is not None:
                self._poller.register(file, select.POLLIN)
            self._polled = file
        for descriptor, _ in self._poller.poll(timeout):
            if descriptor == self._pipe[0]:
                os.read(descriptor, 4096)

    def _make_pipe(self) -> None:
        self._pipe = os.pipe()
        for descriptor in self._pipe:
            os.set_blocking(descriptor, False)
            weakref.finalize(self, os.close, descriptor)


class _Seen(threading.local):
    """The generation that each thread has seen."""

    generation = -1


class Endpoint(board.Entity):
    """A node, a writer or a reader of a session, for any thread."""

    session: Session

    @property
    def taker(self) -> OnData | None:
        """What takes the samples of a reader; it may be exchanged."""
        taker = self.session.objects[self.id]
        return self.deliver if taker is self else taker.deliver  # type: ignore[no-any-return]

    @taker.setter
    def taker(self, taker: OnData | None) -> None:
        self.deliver = taker
        self.session.objects[self.id] = self

    def publish(self, message: Outgoing) -> bool:
        """Sends a message; False when it was not taken. See ``muros.client.session.Entity``."""
        with self.session.lock:
            taken = super().publish(message)
        self.session.hurry()
        return taken

    def offer(self, message: Outgoing) -> bool | None:
        """``publish``, but None, in place of a problem, where there may be room for the message later."""
        with self.session.lock:
            if self._crowded():
                return None
            return self.publish(message)

    def _crowded(self) -> bool:
        """Whether a reliable message has no room now, and may have later."""
        session, stream = self.session, self.stream
        if not stream.reliable or self.status or self not in session.entities:
            return False
        if session.backlog is not None:
            return len(session.backlog.items) >= session.queue
        ready = session.state == CONNECTED and self.todo == 0
        return not session.queue and not (ready and stream.next - stream.first & 0xFFFF < stream.history)

    def destroy(self) -> None:
        """Has the agent delete it."""
        with self.session.lock:
            entities.destroy(self)
        self.session.wake()

    def read(
        self,
        samples: int = entities.UNLIMITED,
        seconds: int = 0,
        bytes_per_second: int = 0,
        pace: int = 0,
    ) -> None:
        """Asks again for samples; see ``muros.client.entities.read``."""
        with self.session.lock:
            entities.read(self, samples, seconds, bytes_per_second, pace)
        self.session.wake()


class _Side(Endpoint):
    """A side of a service."""

    callback: Any

    @property
    def taker(self) -> Any:
        """What takes replies or requests; it may be exchanged."""
        return self.callback

    @taker.setter
    def taker(self, taker: Any) -> None:
        self.callback = taker


class Requester(_Side, services.Requester):
    """The client's side of a service, for any thread."""

    KIND = 7

    def send(self, request: Message) -> int:
        """Sends a request; its number, or 0 when it was not taken."""
        with self.session.lock:
            return super().send(request)


class Replier(_Side, services.Replier):
    """The server's side of a service, for any thread."""

    KIND = 8

    def reply(self, identity: bytes, reply: Message) -> bool:
        """Answers a request; False when it was not taken."""
        with self.session.lock:
            return super().reply(identity, reply)
