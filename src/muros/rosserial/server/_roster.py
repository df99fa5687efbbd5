"""What a board has: its topics and services by name, and who gets what comes on which id.

A topic that is named again stays as it is, with the id that it has now; another type makes it another one. Boards may
have several endpoints of one name, and give ids as they like; the ids of the two directions are apart.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

from muros.rosserial.constants import (
    ID_PUBLISHER,
    ID_SERVICE_CLIENT,
    ID_SERVICE_SERVER,
    ID_SUBSCRIBER,
    OVERHEAD,
)
from muros.rosserial.messages import TopicInfo
from muros.rosserial.server._door import NamedService, RefusedError
from muros.rosserial.server._endpoints import (
    Endpoint,
    Publication,
    ServiceClient,
    ServiceServer,
    Subscription,
)
from muros.rosserial.server.events import BufferKnown, EndpointSetUp

if TYPE_CHECKING:
    from muros.rosserial.server._board import Board

__all__ = ["Key", "Roster"]

_BRANCHES = {
    ID_PUBLISHER: ID_PUBLISHER,
    ID_SUBSCRIBER: ID_SUBSCRIBER,
    ID_SERVICE_SERVER: ID_SERVICE_SERVER,
    ID_SERVICE_SERVER + 1: ID_SERVICE_SERVER,
    ID_SERVICE_CLIENT: ID_SERVICE_CLIENT,
    ID_SERVICE_CLIENT + 1: ID_SERVICE_CLIENT,
}
"""What is named by a frame on each id."""

Key: TypeAlias = tuple[int, str, int]
"""Which endpoint: what it is, its name, and a number that is 0 but for further ones of that name."""


class Roster:
    """The endpoints of one board. ``incoming`` has who gets the messages of the board, by their id."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.endpoints: dict[Key, Endpoint] = {}
        self.incoming: dict[int, Callable[[bytes, int], bool]] = {}
        self.input_buffer = 0
        """The board's buffer for what it is sent; 0 until it was announced."""
        self.output_buffer = 0
        self.in_doubt = False
        """Whether nothing is sent on any id until the board has said what it has: it stands still meanwhile."""
        self._halves: dict[tuple[int, str], tuple[int, dict[int, TopicInfo]]] = {}
        self._most = board.core.limits.max_endpoints

    def named(self, half: int, info: TopicInfo) -> None:
        """The board names a topic, or one half of a service; ``half`` is the id of that frame."""
        self._learn_buffer(half, info.buffer_size)
        branch = _BRANCHES[half]
        infos: tuple[TopicInfo, ...] = (info,)
        if branch in (ID_SERVICE_SERVER, ID_SERVICE_CLIENT):
            both = self._other_half(branch, half, info)
            if both is None:
                return
            infos = both
        if self.board.node is not None:
            self._set_up(self._key(branch, infos), infos)

    def renew(self) -> None:
        """The line is new, and perhaps the board."""
        self.input_buffer = self.output_buffer = 0
        self.restart()

    def missing(self) -> list[Endpoint]:
        """What was not named after the last topic request, or those made again because of damage."""
        return [each for each in self.endpoints.values() if each.round < self.board.first_round]

    def lacks(self, tell: bool) -> bool:
        """Whether the board has not named all of ``~require/publishers`` and ``~require/subscribers``; says which.

        A TopicInfo that got lost may be seen by nothing else.
        """
        board = self.board
        lacks = False
        for kind in (Publication, Subscription):
            wanted = None if board.node is None else board.node.parameter(f"~require/{kind.kind}s")
            there = {self._full(each.name) for each in self.endpoints.values() if isinstance(each, kind)}
            for name in wanted if isinstance(wanted, list | tuple) else ():
                if self._full(str(name)) in there:
                    continue
                lacks = True
                if tell:
                    board.report(
                        "required-topic-missing",
                        subject=f"{kind.kind} {name}",
                        what=f"Missing required topic: {board.who} has no {kind.kind} {name}",
                        why=f"it is in ~require/{kind.kind}s of the node, and the board has not named it",
                        remedy="Nothing if it comes, the board is asked again; else flash the firmware that has it",
                    )
        return lacks

    def halved(self) -> bool:
        """Whether only one half of some service was named."""
        first = self.board.first_round
        return any(len(found) < 2 for asked, found in self._halves.values() if asked >= first)

    def count(self, kind: type[Endpoint]) -> int:
        """How many there are of a kind."""
        return sum(isinstance(each, kind) for each in self.endpoints.values())

    def calls(self, since: int) -> bool:
        """Whether the board waits for the answer to a call that it has made since then."""
        return any(
            each.waits and each.called_at > since
            for each in self.endpoints.values()
            if isinstance(each, ServiceClient)
        )

    def tick(self, now: int) -> None:
        """Does what is due."""
        for endpoint in list(self.endpoints.values()):
            if isinstance(endpoint, ServiceServer) and endpoint.until is not None:
                endpoint.turn(now)

    def restart(self) -> None:
        """The board has started again: it waits for nothing any more."""
        self.doubt()
        for endpoint in self.endpoints.values():
            endpoint.restart()

    def doubt(self) -> None:
        """The board may have started again: nothing goes to an id until it has named it again."""
        for endpoint in self.endpoints.values():
            endpoint.confirmed = False
            self.in_doubt = self.board.output.holds = True

    def resume(self) -> None:
        """What has waited for the board may go."""
        for endpoint in self.endpoints.values():
            endpoint.resume()

    def forget(self) -> None:
        """Drops what has waited for the board's topics."""
        for endpoint in self.endpoints.values():
            if isinstance(endpoint, Subscription):
                endpoint.restart()

    def close(self) -> None:
        """Takes everything out of the world."""
        for endpoint in self.endpoints.values():
            endpoint.close()
        self.endpoints.clear()
        self.incoming.clear()
        self._halves.clear()

    def remove(self, endpoint: Endpoint) -> None:
        """Takes one out of the world."""
        for key, each in list(self.endpoints.items()):
            if each is endpoint:
                del self.endpoints[key]
                self._halves.pop(key[:2], None)
        for info in endpoint.infos:
            if getattr(self.incoming.get(info.topic_id), "__self__", None) is endpoint:
                del self.incoming[info.topic_id]
        endpoint.close()

    def _learn_buffer(self, half: int, size: int) -> None:
        board = self.board
        if half in (ID_SUBSCRIBER, ID_SERVICE_SERVER + 1, ID_SERVICE_CLIENT + 1):
            if not self.input_buffer:
                board.tell(BufferKnown(board.label, "subscribe", size))
            self.input_buffer = max(size, 0)
        else:
            if not self.output_buffer:
                board.tell(BufferKnown(board.label, "publish", size))
            self.output_buffer = max(self.output_buffer, size)
            board.decoder.limit = min(board.core.limits.max_payload, max(self.output_buffer, OVERHEAD))

    def _full(self, name: str) -> str:
        """A name as the board's node means it."""
        node = self.board.node_name
        if name.startswith("~"):
            return f"{node}/{name[1:].lstrip('/')}"
        return name if name.startswith("/") else f"{node.rpartition('/')[0]}/{name}"

    def _other_half(self, branch: int, half: int, info: TopicInfo) -> tuple[TopicInfo, TopicInfo] | None:
        """Both halves of a service, None until both were named."""
        name = (branch, info.topic_name)
        asked, halves = self._halves.get(name, (self.board.round, {}))
        if asked < self.board.first_round:
            halves = {}
        if name not in self._halves and len(self._halves) >= self._most:
            self._too_many()
            return None
        self._halves[name] = (self.board.round, halves)
        halves[half - branch] = info
        return (halves[0], halves[1]) if len(halves) == 2 else None

    def _key(self, branch: int, infos: tuple[TopicInfo, ...]) -> Key:
        """Which endpoint is meant: the one of that name, or a further one if that was named just now with other ids."""
        name, ids = infos[0].topic_name, [info.topic_id for info in infos]
        for number in range(self._most):
            known = self.endpoints.get((branch, name, number))
            if known is None or known.round != self.board.round or [i.topic_id for i in known.infos] == ids:
                return branch, name, number
        return branch, name, 0

    def _set_up(self, key: Key, infos: tuple[TopicInfo, ...]) -> None:
        says = (infos[0].message_type, *(info.md5sum for info in infos))
        known = self.endpoints.get(key)
        self._release(key, infos)
        if known is not None and known.says == says:
            if key[0] != ID_SUBSCRIBER:
                self.incoming.pop(known.infos[0].topic_id, None)
            known.infos = infos
        else:
            if known is not None:
                self.remove(known)
            elif len(self.endpoints) >= self._most:
                self._too_many()
                return
            try:
                known = self._make(key[0], infos)
            except RefusedError as error:
                self._refuse(key[0], infos, error)
                return
            self.endpoints[key] = known
            self._said(known)
            self._warn(known)
        known.round = self.board.round
        known.confirmed = True
        receive = getattr(known, "receive", None)
        if receive is not None:
            self.incoming[infos[0].topic_id] = receive
        known.resume()

    def _release(self, key: Key, infos: tuple[TopicInfo, ...]) -> None:
        """Whoever else had these ids has them no more: the board has begun anew with other numbers."""
        ids = {(_sends(key[0], i), info.topic_id) for i, info in enumerate(infos)}
        for other, endpoint in list(self.endpoints.items()):
            held = {(_sends(other[0], i), info.topic_id) for i, info in enumerate(endpoint.infos)}
            if other != key and ids & held:
                self.remove(endpoint)

    def _make(self, branch: int, infos: tuple[TopicInfo, ...]) -> Endpoint:
        assert self.board.node is not None
        info = infos[0]
        name, kind = info.topic_name, info.message_type
        if branch == ID_PUBLISHER:
            return Publication(self.board, infos, self.board.node.publisher(name, kind, info.md5sum))
        if branch == ID_SUBSCRIBER:
            subscription = Subscription(self.board, infos)
            subscription.begin(self.board.node.subscriber(name, kind, info.md5sum, subscription.on_data))
            return subscription
        if branch == ID_SERVICE_SERVER:
            server = ServiceServer(self.board, infos)
            service = NamedService(name, kind, infos[1].md5sum, info.md5sum)
            server.begin(self.board.node.server(service, server.on_data))
            return server
        client = ServiceClient(self.board, infos)
        service = NamedService(name, kind, info.md5sum, infos[1].md5sum)
        client.begin(self.board.node.caller(service, client.on_reply))
        return client

    def _said(self, endpoint: Endpoint) -> None:
        self.board.tell(
            EndpointSetUp(
                self.board.label,
                endpoint.kind,
                endpoint.name,
                endpoint.type_name,
                endpoint.infos[0].buffer_size,
            )
        )

    def _warn(self, endpoint: Endpoint) -> None:
        """What can be said at once: a definition that differs, messages that cannot fit, or are slow for the line."""
        shape = endpoint.shape
        if shape.drift:
            self.board.report(
                "old-definition",
                subject=endpoint.name,
                what=f"{endpoint.name} of {self.board.who} is converted: its {endpoint.type_name} is defined otherwise",
                why=shape.drift,
                remedy="Nothing; or generate the firmware's message headers anew",
            )
        out = isinstance(endpoint, Publication)
        info = endpoint.infos[0 if out or len(endpoint.infos) == 1 else 1]
        room = info.buffer_size - OVERHEAD if out else info.buffer_size
        if shape.least_size > room:
            buffer = "OUTPUT_SIZE" if out else "INPUT_SIZE"
            self.board.report(
                "buffer-too-small",
                subject=endpoint.name,
                what=f"no message on {endpoint.name} fits {self.board.who}",
                why=f"a {endpoint.type_name} has {shape.least_size} B at least, and {buffer} is {info.buffer_size} B",
                remedy=f"Enlarge {buffer} of the board's NodeHandle_",
            )
        elif not out:
            endpoint.warn_slow(shape.least_size)

    def _refuse(self, branch: int, infos: tuple[TopicInfo, ...], error: RefusedError) -> None:
        """Only that topic is refused; what comes on it is passed over, and no new request is made for its id."""
        info = infos[0]
        kind = {0: "publisher", 1: "subscriber", 2: "service server", 4: "service client"}[branch]
        self.board.report(
            "topic-refused",
            subject=f"{kind} {info.topic_name}",
            what=f"Creation of {kind} failed: {info.topic_name} [{info.message_type}] of {self.board.who}",
            why=error.why,
            remedy=error.remedy,
        )
        if branch != ID_SUBSCRIBER:
            self.incoming[info.topic_id] = _pass_over

    def _too_many(self) -> None:
        self.board.report(
            "too-many-topics",
            what=f"a topic of {self.board.who} is not set up",
            why=f"it has {self._most} already",
            remedy="Allow more with the limit max_endpoints",
        )


def _sends(branch: int, part: int) -> bool:
    """Whether a topic, or the first or second half of a service, is something that the board sends."""
    return branch == ID_PUBLISHER or (branch != ID_SUBSCRIBER and part == 0)


def _pass_over(body: bytes, now: int) -> bool:
    """What comes on a refused topic; the refusal was said."""
    return True
