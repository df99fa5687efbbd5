"""The rosserial server without I/O: lines on one side, a world on the other.

A link hands bytes to its `Port`; frames leave through the link's ``send``. ``tick`` does what has become due and
returns when it wants to be called next. All times are milliseconds of one monotonic clock, handed in; what the world
announces in between is given the time by ``clock``.
"""

from collections.abc import Callable, Hashable
from typing import NamedTuple

from muros.findings import Finding, Findings
from muros.links.voice import Voice
from muros.rosserial.server._board import Board
from muros.rosserial.server._door import World
from muros.rosserial.server._limits import Limits
from muros.rosserial.server._output import Link
from muros.rosserial.server._status import status_of
from muros.rosserial.server.events import BoardGone, Event, LineUp

__all__ = ["Identity", "Port", "ServerCore"]


_WARNING = 2


class Identity(NamedTuple):
    """Who is at an address. A board is known again by its key; a second one at the same time gets a number."""

    key: Hashable
    label: str
    """For people: ``/dev/ttyACM0``, ``192.168.1.7``."""
    node_name: str
    """Full name of its node."""
    baud: int
    """The rate of its line in bits per second; 0 if that is not known or no matter."""


class Port:
    """A link at the server, with the boards that were found by its addresses."""

    __slots__ = ("boards", "core", "identify", "link")

    def __init__(self, core: "ServerCore", link: Link, identify: Callable[[Hashable], Identity]) -> None:
        self.core = core
        self.link = link
        self.identify = identify
        self.boards: dict[Hashable, Board] = {}

    def up(self, address: Hashable, now: int) -> None:
        """There is somebody at ``address``, or may be: it is asked."""
        self.core.line_up(self, address, now)

    def receive(self, data: bytes, address: Hashable, now: int) -> None:
        """Bytes came from ``address``."""
        board = self.boards.get(address)
        if board is not None:
            board.receive(data, now)

    def room(self, address: Hashable, now: int) -> None:
        """The link has room again for ``address``."""
        board = self.boards.get(address)
        if board is not None:
            board.pump(now)

    def down(self, address: Hashable, reason: str, now: int) -> None:
        """Nobody can be reached at ``address`` any more."""
        board = self.boards.pop(address, None)
        if board is not None and not self.core.moves(board, now):
            board.line_down(reason, now)


class ServerCore(Voice[Event]):
    """Boards, time and findings of a server.

    ``wall`` gives the wall clock in ns, for findings; ``clock`` the monotonic one in ms. ``on_unanswered(board)`` may
    change the rate of the line of a board that has not been heard yet; it says whether it did.
    """

    def __init__(
        self,
        world: World,
        findings: Findings,
        *,
        limits: Limits,
        wall: Callable[[], int],
        clock: Callable[[], int],
    ) -> None:
        super().__init__(findings, wall)
        self.world = world
        self.limits = limits
        self.clock = clock
        self.on_unanswered: Callable[[Board], bool] | None = None
        self.boards: list[Board] = []
        self._diagnosed_at: int | None = None
        self._ports: list[Port] = []
        self._unwatch = findings.on_finding(self._log)

    def attach(self, link: Link, identify: Callable[[Hashable], Identity]) -> Port:
        """A port for ``link``; ``identify(address)`` says who is there."""
        port = Port(self, link, identify)
        self._ports.append(port)
        return port

    def detach(self, port: Port, now: int) -> None:
        """The link is closed; its boards count as lost."""
        self._ports.remove(port)
        for address in list(port.boards):
            port.down(address, "its link was removed", now)

    def line_up(self, port: Port, address: Hashable, now: int) -> None:
        """A line is there: of a known board that was away, or of a new one."""
        who = port.identify(address)
        board = self._known(who, now)
        if board is None:
            if len(self.boards) >= self.limits.max_boards:
                self.report(
                    "too-many-boards",
                    who=who.label,
                    what=f"board {who.label} is not served",
                    why=f"{self.limits.max_boards} boards are known already",
                    remedy="Allow more with the limit max_boards",
                )
                return
            board = self._new(port, address, who)
            for other in self.boards:
                if other.key == who.key and other is not board:
                    other.ask(now)  # if it is there no more, that shows
        self._connect(board, port, address)
        self.tell(LineUp(board.label))
        board.line_up(port.link, address, who.baud, now)
        if self.limits.diagnostics and self._diagnosed_at is None:
            self._diagnosed_at = now + self.limits.diagnostics
            self.wake(self._diagnosed_at)

    def close(self, reason: str) -> None:
        """Forgets all boards, for good."""
        for board in list(self.boards):
            self.remove(board, reason)
        self._unwatch()

    def moves(self, board: Board, now: int) -> bool:
        """Whether a board that is gone is there already on another line, as one that was switched off and on dials in
        before its old connection has ended: it goes on there.

        What has come from the same place since the board was heard last is taken for it.
        """
        for port in self._ports:
            for address, other in port.boards.items():
                if other is not board and other.key == board.key and other.came_at > board.heard_at:
                    self.remove(other, f"it is {board.label}, which has dialled in again")
                    self._connect(board, port, address)
                    board.line_up(port.link, address, other.baud, now)
                    return True
        return False

    def tick(self, now: int) -> int | None:
        """Does what has become due; returns when to call again, None: when something happens."""
        for board in list(self.boards):
            if board.due is not None and board.due <= now:
                board.tick(now)
        if self._diagnosed_at is not None and self._diagnosed_at <= now:
            self._diagnosed_at = now + self.limits.diagnostics
            self._diagnose(now)
        waits = [board.due for board in self.boards if board.due is not None]
        if self._diagnosed_at is not None:
            waits.append(self._diagnosed_at)
        return min(waits) if waits else None

    def remove(self, board: Board, reason: str) -> None:
        """Forgets a board; everything of it leaves the world."""
        self.boards.remove(board)
        board.close()
        self.findings.forget(board.who)
        self.tell(BoardGone(board.label, reason))
        if not self.boards:
            self._diagnosed_at = None

    def stop(self) -> None:
        """Tells every board that nobody listens any more."""
        for board in self.boards:
            board.stop()

    def wake(self, when: int) -> None:
        """`tick` is to be called at ``when`` at the latest."""
        if self.on_wake is not None:
            self.on_wake(when)

    def _log(self, finding: Finding) -> None:
        """A board's node says what is wrong with the board."""
        for board in self.boards:
            if board.who == finding.who and board.node is not None:
                board.node.log(_WARNING, finding.format())

    def _wake_in(self, ms: int) -> None:
        self.wake(self.clock() + ms)

    def _connect(self, board: Board, port: Port, address: Hashable) -> None:
        for key in [key for key, each in port.boards.items() if each is board]:
            del port.boards[key]
        port.boards[address] = board

    def _known(self, who: Identity, now: int) -> Board | None:
        """The board that comes back: one that is away, or has dialled in again before its old line ended."""
        found = [board for board in self.boards if board.key == who.key]
        for board in found:
            if not board.reachable:
                return board
        for board in found:
            if board.last_time is not None and now - board.heard_at >= self.limits.silent:
                return board
        return None

    def _new(self, port: Port, address: Hashable, who: Identity) -> Board:
        names = {board.node_name for board in self.boards}
        name, label, number = who.node_name, who.label, 1
        while name in names:
            number += 1
            name, label = f"{who.node_name}_{number}", f"{who.label} ({number})"
        board = Board(self, who.key, label, name, port.link, address)
        self.boards.append(board)
        return board

    def _diagnose(self, now: int) -> None:
        for board in self.boards:
            if board.node is not None:
                level, text, values = status_of(board, now)
                board.node.diagnose(text, level, values)
