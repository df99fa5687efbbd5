"""Goals of action servers, and what may follow what in their lives, as a table.

The states are those of action_msgs/msg/GoalStatus: 1 accepted, 2 executing, 3 canceling, 4 succeeded, 5 canceled,
6 aborted. The last three are ends.
"""

from muros.compat import borrow, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.rclc.action_server import ActionServer

_EXECUTE = const(0)
_SUCCEED = const(2)
_ABORT = const(3)
_CANCELED = const(4)
_CANCELING = const(3)
_SUCCEEDED = const(4)

# AFTER[event * 7 + state] is the state after an event: execute, cancel, succeed, abort, canceled; 0 is none.
AFTER = b"\0\2\0\0\0\0\0\0\3\3\0\0\0\0\0\0\4\4\0\0\0\0\0\6\6\0\0\0\0\0\0\5\0\0\0"


class Goal:
    """A goal that a server has accepted. ``request`` is the message of the client, ``id`` its 16 bytes.

    ``execute``, ``succeed``, ``abort`` and ``canceled`` raise GoalError where the goal's state does not allow them.
    """

    def __init__(self, server: "ActionServer", identity: bytes, request: "Any", entry: "Any") -> None:
        self.server = server
        self.id = identity
        self.request = request
        self.entry = entry  # its GoalStatus among those that are published
        self.result: "Any" = None
        self.expires = 0  # the tick, once it has ended
        self.askers: "list[bytes]" = []  # who waits for the result

    @property
    def status(self) -> int:
        """Its state, a STATUS of action_msgs/msg/GoalStatus."""
        state: int = self.entry.status
        return state

    @property
    def active(self) -> bool:
        """Whether it has not ended."""
        return self.status < _SUCCEEDED

    @property
    def canceling(self) -> bool:
        """Whether its client wants it to end, and the server has agreed: call ``canceled`` soon."""
        return self.status == _CANCELING

    def execute(self) -> None:
        """Begins; for goals that ``on_accepted`` has put off."""
        self.update(_EXECUTE)
        self.server.start(self)

    def feedback(self, message: "Any") -> bool:
        """Tells the client how it goes; whether that was taken. Raises GoalError when the goal has ended."""
        if not self.active:
            borrow("muros.rclc.actions").ended(self)
        return self.server.send_feedback(self, message)

    def succeed(self, result: "Any" = None) -> None:
        """Ends well, with a message of the action's ``Result``; an empty one if it is None."""
        self.finish(_SUCCEED, result)

    def abort(self, result: "Any" = None) -> None:
        """Ends badly."""
        self.finish(_ABORT, result)

    def canceled(self, result: "Any" = None) -> None:
        """Ends because the client wanted it; only for goals that are ``canceling``."""
        self.finish(_CANCELED, result)

    def update(self, event: int) -> None:
        """Takes an event of the table."""
        after = AFTER[event * 7 + self.status]
        if not after:
            borrow("muros.rclc.actions").refuse(self, event)
        self.entry.status = after
        self.server.changed()

    def finish(self, event: int, result: "Any") -> None:
        """Ends with a result."""
        if AFTER[event * 7 + self.status]:
            self.result = result
            self.server.ended(self)
        self.update(event)
