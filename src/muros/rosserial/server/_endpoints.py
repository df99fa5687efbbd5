"""A board's topics and services: what becomes of its frames, and which frames it gets.

Each belongs to a `Board` and holds its counterpart in the world. Nothing is sent to an id that the board has not
given, and nothing longer than the buffer that it announced: boards check neither and would overwrite their memory.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

from muros.rosserial.constants import OVERHEAD
from muros.rosserial.messages import TopicInfo
from muros.rosserial.packets import frame
from muros.rosserial.server._door import BodyError, Caller, Publisher, Server, Shape, Subscriber

if TYPE_CHECKING:
    from muros.rosserial.server._board import Board

__all__ = ["Endpoint", "Publication", "ServiceClient", "ServiceServer", "Subscription"]


_HELD = 64
"""Messages of one topic that are kept for a slow line while the board says what it has."""


class Endpoint:
    """What all have in common. ``infos`` are the board's words: one for a topic, two for a service."""

    kind = ""

    def __init__(self, board: Board, infos: tuple[TopicInfo, ...], shape: Shape) -> None:
        self.board = board
        self.infos = infos
        self.name = infos[0].topic_name
        self.type_name = infos[0].message_type
        self.round = 0
        """The number of the topic request that it was named after last."""
        self.shape = shape
        self.confirmed = True
        """Whether the board has named it since it may have started again, perhaps with other topics."""

    @property
    def says(self) -> tuple[Any, ...]:
        """What makes it another one when it changes."""
        return (self.type_name, *(info.md5sum for info in self.infos))

    def fits(self, n: int, buffer_size: int) -> bool:
        """Whether ``n`` bytes may go to the board; says it if not, and if the line is slow for so many."""
        if n > buffer_size:
            self.board.report(
                "too-long-for-board",
                subject=self.name,
                what=f"{{n}} message{{s}} on {self.name} not sent to {self.board.who}",
                why=f"{n} B do not fit its input buffer of {buffer_size} B",
                remedy="Enlarge INPUT_SIZE of the board's NodeHandle_, or send shorter messages",
            )
            return False
        self.warn_slow(n)
        return True

    def warn_slow(self, n: int) -> None:
        """Says it if ``n`` bytes take so long on the line that boards drop them."""
        byte_us = self.board.output.byte_us
        limit = self.board.core.limits.slow_frame
        if byte_us and (n + OVERHEAD) * byte_us > 1000 * limit:
            self.board.report(
                "slow-line",
                subject=self.name,
                what=f"{{n}} message{{s}} on {self.name} to {self.board.who} may be dropped by the board",
                why=f"{n + OVERHEAD} B take {(n + OVERHEAD) * byte_us / 1000:.0f} ms at this rate, and ros_lib gives a "
                f"frame up after {limit} ms",
                remedy="Use a higher baud rate or shorter messages; boards with USB of their own are not affected",
            )

    def malformed(self, error: BodyError, direction: str) -> None:
        """Says that a message is not of its type."""
        self.board.report(
            "malformed-message",
            subject=self.name,
            what=f"{{n}} message{{s}} on {self.name} {direction} {self.board.who} dropped",
            why=str(error),
            remedy="Check that the firmware's message headers were generated for this type",
        )

    def restart(self) -> None:
        """The board has started again: whatever it waited for, it does not any more."""

    def resume(self) -> None:
        """The board has named it: what has waited meanwhile may go."""

    def close(self) -> None:
        """Takes it out of the world."""
        raise NotImplementedError


class Publication(Endpoint):
    """A topic that the board publishes."""

    kind = "publisher"

    def __init__(self, board: Board, infos: tuple[TopicInfo, ...], publisher: Publisher) -> None:
        super().__init__(board, infos, publisher)
        self.publisher = publisher
        self._publish = publisher.publish

    def receive(self, body: bytes, now: int) -> bool:
        """A message of the board; False if it is none."""
        try:
            self._publish(body)
        except BodyError as error:
            self.malformed(error, "from")
            return False
        return True

    def close(self) -> None:
        """Takes it out of the world."""
        self.publisher.close()


class Subscription(Endpoint):
    """A topic that the board reads."""

    kind = "subscriber"

    def __init__(self, board: Board, infos: tuple[TopicInfo, ...]) -> None:
        super().__init__(board, infos, NO_SHAPE)
        self.subscriber: Subscriber | None = None
        self._queued = False
        self._waiting: deque[bytes] = deque()
        self._most = board.core.limits.backlog

    def begin(self, subscriber: Subscriber) -> None:
        """Its counterpart is there."""
        self.subscriber = self.shape = subscriber

    def on_data(self) -> None:
        """Something came where nothing was."""
        if not self._queued:
            self._queued = True
            self.board.output.add(self)
            self.board.send()

    def next(self, now: int) -> bytes | None:
        """The next frame for the board: the oldest message, or on a slow line the oldest of the newest few."""
        if not self.confirmed:
            self._queued = False
            return None
        info = self.infos[0]
        if self.board.output.byte_us:
            self.hurry()
        while True:
            body = self._waiting.popleft() if self._waiting else self._take()
            if body is None:
                self._queued = False
                return None
            if self.fits(len(body), info.buffer_size):
                return frame(info.topic_id, body, self.board.version)

    def restart(self) -> None:
        """What waited was for whom the board was: a robot that starts must not carry out old commands."""
        self._waiting.clear()
        if self.subscriber is not None:
            self.subscriber.forget()

    def resume(self) -> None:
        """What has waited in the world may go, all of it: it was not the line that it waited for."""
        if self.board.output.byte_us:
            self._most = max(self._most, _HELD)
            self._collect()
            self._most = max(self.board.core.limits.backlog, len(self._waiting))
        self.on_data()

    def _take(self) -> bytes | None:
        assert self.subscriber is not None
        while True:
            try:
                return self.subscriber.take()
            except BodyError as error:
                self.malformed(error, "to")

    def hurry(self) -> None:
        """Lets what is old go, as the line is slower than what is published."""
        if not self._waiting:
            self._most = self.board.core.limits.backlog
        self._collect()

    def _collect(self) -> None:
        """Takes what has come, and drops the oldest beyond the number that may wait here; latched ones all wait."""
        if self.subscriber is None or self.subscriber.latched:
            return
        waiting = self._waiting
        dropped = 0
        while (body := self._take()) is not None:
            waiting.append(body)
            if len(waiting) > self._most:
                waiting.popleft()
                dropped += 1
        if dropped:
            self.board.report(
                "line-too-slow",
                subject=self.name,
                what=f"{{n}} message{{s}} on {self.name} not sent to {self.board.who}",
                why="newer ones came before the line had room for them",
                remedy="Publish less often or shorter messages, or use a higher baud rate",
                n=dropped,
            )

    def close(self) -> None:
        """Takes it out of the world."""
        self.board.output.remove(self)
        if self.subscriber is not None:
            self.subscriber.close()


class ServiceServer(Endpoint):
    """A service that the board serves: one call at a time, as answers carry no number.

    After a call that was not answered in time the next one waits a while: an answer that comes late after all would be
    taken for its answer.
    """

    kind = "service server"

    def __init__(self, board: Board, infos: tuple[TopicInfo, ...]) -> None:
        super().__init__(board, infos, NO_SHAPE)
        self.server: Server | None = None
        self.until: int | None = None
        """When the call in flight, or the wait for a late answer, is over."""
        self._request: Any = None
        self._late = False

    def begin(self, server: Server) -> None:
        """Its counterpart is there."""
        self.server = self.shape = server

    def on_data(self) -> None:
        """A request came."""
        board = self.board
        now = board.core.clock()
        self.turn(now)
        board.pump(now)

    def turn(self, now: int) -> None:
        """Sends the next request, if the board is free for it."""
        if self.until is not None:
            if now < self.until:
                return
            if not self._late:
                self._missed(now)
                return
            self.until = None
        board = self.board
        assert self.server is not None
        info = self.infos[1]
        while self.confirmed and not board.output.holds:
            try:
                taken = self.server.take()
            except BodyError as error:
                self.malformed(error, "to")
                continue
            if taken is None:
                return
            self._request, body = taken
            if not self.fits(len(body), info.buffer_size):
                self.server.fail(self._request, f"{len(body)} B do not fit the board's input buffer")
            elif not board.output.post(frame(info.topic_id, body, board.version)):
                self._unanswered("too much waits for the board's line")
            else:
                self._late = False
                line = int((len(body) + info.buffer_size) * board.output.byte_us) // 1000
                self.until = now + board.core.limits.answer + line
                board.wake(self.until)
                return

    def receive(self, body: bytes, now: int) -> bool:
        """An answer of the board."""
        waiting, late = self.until is not None, self._late
        self.until = None
        if waiting and not late and self.server is not None:
            try:
                self.server.answer(self._request, body)
            except BodyError as error:
                self.malformed(error, "from")
        else:
            self.board.report(
                "late-answer",
                subject=self.name,
                what=f"{{n}} answer{{s}} of {self.board.who} to calls of {self.name} dropped",
                why="they came too late, or were not asked for",
                remedy="Let the service callback on the board return sooner",
            )
        self._request = None
        self.turn(now)
        return True

    def restart(self) -> None:
        """The board does not know of the call any more."""
        if self.until is not None and not self._late:
            self._unanswered("the board started again")
        self.until = self._request = None

    def resume(self) -> None:
        """The calls that came while the board could not be called have their turn."""
        self.on_data()

    def close(self) -> None:
        """Takes it out of the world."""
        if self.server is not None:
            self.server.close()

    def _missed(self, now: int) -> None:
        self._unanswered(f"the board did not answer within {self.board.core.limits.answer} ms")
        self._request = None
        self._late = True
        self.until = now + self.board.core.limits.answer
        self.board.wake(self.until)

    def _unanswered(self, why: str) -> None:
        if self.server is not None:
            self.server.fail(self._request, why)
        self.board.report(
            "call-unanswered",
            subject=self.name,
            what=f"{{n}} call{{s}} of {self.name} on {self.board.who} not answered",
            why=why,
            remedy="Look whether the board's loop calls spinOnce() often enough; call again",
        )


class ServiceClient(Endpoint):
    """A service that the board calls."""

    kind = "service client"

    def __init__(self, board: Board, infos: tuple[TopicInfo, ...]) -> None:
        super().__init__(board, infos, NO_SHAPE)
        self.caller: Caller | None = None
        self._waiting: deque[int] = deque()
        self.called_at = 0
        self._calling = False
        self._early: list[tuple[int, bytes]] = []

    @property
    def waits(self) -> bool:
        """Whether the board has no answer yet."""
        return bool(self._waiting)

    def begin(self, caller: Caller) -> None:
        """Its counterpart is there."""
        self.caller = self.shape = caller

    def receive(self, body: bytes, now: int) -> bool:
        """A request of the board."""
        assert self.caller is not None
        if not self.caller.ready:
            self.board.report(
                "no-server",
                subject=self.name,
                what=f"Starting service client, waiting for service '{self.name}': {self.board.who} has called it",
                why=f"nobody serves {self.name} [{self.type_name}] now",
                remedy="Start the service; the board's loop stands still until then",
            )
        self._calling = True
        try:
            number = self.caller.call(body)
        except BodyError as error:
            self.malformed(error, "from")
            number = 0
        self._calling = False
        if number:
            self.called_at = now
            self._waiting.append(number)
            if len(self._waiting) > self.board.core.limits.max_requests:
                self._waiting.popleft()
        self.resume()
        return True

    def resume(self) -> None:
        """Answers that could not be passed on when they came have their turn."""
        early, self._early = self._early, []
        for answer in early:
            self.on_reply(*answer)

    def on_reply(self, number: int, body: bytes) -> None:
        """An answer for the board. Those to calls that it made before it started again are dropped."""
        # the call's number, or what the board has, is not known yet
        if self._calling or self.board.output.holds:
            self._early.append((number, body))
            return
        if number not in self._waiting:
            return
        while self._waiting.popleft() != number:
            pass
        board = self.board
        info = self.infos[1]
        if board.reachable and self.fits(len(body), info.buffer_size):
            board.output.post(frame(info.topic_id, body, board.version))
            board.pump(board.core.clock())

    def restart(self) -> None:
        """The board waits for nothing any more."""
        self._waiting.clear()
        self._early.clear()

    def close(self) -> None:
        """Takes it out of the world."""
        if self.caller is not None:
            self.caller.close()


class _NoShape:
    size: int | None = None
    least_size = 0
    drift = ""


NO_SHAPE = _NoShape()
"""The shape of what is not made yet."""
