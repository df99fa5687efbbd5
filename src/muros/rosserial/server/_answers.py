"""What boards ask the server itself, and what they are answered: the time, and parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from muros.rosserial.constants import ID_PARAMETER_REQUEST, ID_TIME
from muros.rosserial.messages import write_time
from muros.rosserial.packets import frame
from muros.rosserial.server._parameters import answer_of, plain_name

if TYPE_CHECKING:
    from muros.rosserial.server._board import Board

__all__ = ["parameter_answer", "time_answer"]

_REQUEST_BYTES = 16
"""A request for the time, as a frame."""


def time_answer(board: Board, now: int) -> Callable[[int], bytes]:
    """What answers a request for the time that came at ``now``, made when the line takes it.

    A board sets its clock to the answer and adds the whole round trip. So the answer is the time when it leaves, less
    all that has passed since the request left the board: on the line, here, and in the queue.
    """
    world = board.core.world
    came = world.time()
    board.meet()  # which takes a while for a new one
    here = world.time() - came
    place = board.node or world
    line = round(_REQUEST_BYTES * board.output.byte_us * 1000)

    def answer(when: int) -> bytes:
        stamp = max(0, place.time() - (when - now) * 1_000_000 - here - line)
        body = bytearray(8)
        write_time(body, 0, stamp // 1_000_000_000 & 0xFFFFFFFF, stamp % 1_000_000_000)
        return frame(ID_TIME, body, board.version)

    return answer


def parameter_answer(board: Board, name: str) -> bytes:
    """What answers a request for a parameter: something always, as a board stands still until it has an answer."""
    value = board.node.parameter(name) if board.node is not None else None
    if value is None:
        board.report(
            "no-such-parameter",
            subject=name,
            what=f"{board.who} asks for the parameter {name}",
            why="it is not set",
            remedy=f"Set it: muros param set {board.node_name} {plain_name(name, board.node_name)} VALUE",
        )
    room = board.roster.input_buffer or board.core.limits.input_buffer
    body, fits = answer_of(value, room)
    if not fits:
        board.report(
            "too-long-for-board",
            subject=name,
            what=f"the parameter {name} is not given to {board.who}",
            why=f"it does not fit the board's input buffer of {room} B, or is no value that a board can have",
            remedy="Use numbers, texts or lists of one of them, short enough for INPUT_SIZE",
        )
    return frame(ID_PARAMETER_REQUEST, body, board.version)
