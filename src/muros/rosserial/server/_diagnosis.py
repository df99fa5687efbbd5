"""What is wrong with a line, judged by what arrives: nothing, text, another rate, damage.

Users of other servers see one text for all of it, "Unable to sync with device". Here the bytes are looked at.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from muros.rosserial.server._board import Board

__all__ = ["Suspicions", "judge"]

_SAMPLE = 80
"""Bytes kept of what is no frame."""
_PATIENCE = 3_000
"""Silence after the first topic request until it is said that the board does not answer, in ms."""
_AGAIN = 10_000
_TEXT_SHARE = 0.85
_TEXT = frozenset(range(32, 127)) | {9, 10, 13}


def judge(received: int, sample: bytes, bad: int, frames: int, baud: int) -> tuple[str, str]:
    """Why a board does not answer, and what to do. ``sample`` is of what came outside frames, ``bad`` damaged frames.

    ``baud`` 0 means that the line has no rate.
    """
    if not received:
        return (
            "nothing arrives",
            "Check that it runs rosserial firmware and calls nh.initNode() and nh.spinOnce(), then port and cable",
        )
    if frames:
        return (
            "it sends good frames but names no topics",
            "Check that setup() calls nh.initNode(), and that no callback blocks the loop",
        )
    if sample and sum(byte in _TEXT for byte in sample) >= _TEXT_SHARE * len(sample):
        shown = sample.decode("ascii", "replace").strip()
        return (
            f"something prints text on this port: {shown[:60]!r}",
            "Remove Serial.print from the firmware, or print on another port; is it rosserial firmware?",
        )
    rate = f" at {baud} baud" if baud else ""
    if bad:
        return (
            f"frames arrive{rate}, but damaged: {bad} of them",
            "Check cable, ground and level, and that nothing else writes to this port",
        )
    return (
        f"{received} B arrived{rate} that are no frames",
        "Check the baud rate: it must be that of the firmware (rosserial's default is 57600)",
    )


class Suspicions:
    """What is found out about the line of one board. ``damage`` counts what was damaged on it."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._sample = b""
        self._said_at = 0
        self._seen = (0, 0, 0, 0, 0)
        self._garbage = 0
        self._received = 0
        self._frames = 0

    @property
    def damage(self) -> int:
        """Damaged frames so far, as far as they could be told."""
        decoder = self._board.decoder
        return decoder.bad_checksum + decoder.bad_length + decoder.cut

    @property
    def sample(self) -> bytes:
        """The last bytes that came without a frame."""
        return self._sample

    def begin(self, now: int) -> None:
        """The line is new."""
        self._sample = b""
        self._said_at = now + _PATIENCE - _AGAIN
        self._received = self._board.received_bytes
        self._frames = self._board.decoder.frames

    def noise(self, data: bytes) -> None:
        """Bytes came that completed no frame."""
        self._sample = (self._sample + data)[-_SAMPLE:]

    def look(self, now: int) -> None:
        """Says what damage is new."""
        decoder = self._board.decoder
        seen = (
            decoder.bad_checksum,
            decoder.bad_length,
            decoder.too_long,
            decoder.cut,
            decoder.garbage,
        )
        if seen == self._seen:
            return
        news = [new - old for new, old in zip(seen, self._seen, strict=True)]
        self._seen = seen
        bad = sum(news[:4])
        board = self._board
        if not bad or not board.version:
            return  # what comes before the first frame is judged as a whole
        words = (
            "wrong checksum for topic id and msg",
            "Wrong checksum for msg length",
            "longer than the board's buffer",
            "cut short",
        )
        kinds = ", ".join(f"{n} {word}" for n, word in zip(news, words, strict=False) if n)
        board.report(
            "line-damage",
            what=f"{{n}} damaged frame{{s}} of {board.who} passed over",
            why=f"{kinds}: line noise, or something else that writes to this port",
            remedy="Check cable and ground, lower the rate, and print nothing on this port",
            n=bad,
        )

    def unanswered(self, now: int) -> None:
        """Says, now and then, why a board does not answer as far as one can tell."""
        if now < self._said_at + _AGAIN:
            return
        self._said_at = now
        board = self._board
        why, remedy = judge(
            board.received_bytes - self._received,
            self._sample,
            self.damage,
            board.decoder.frames - self._frames,
            board.baud,
        )
        board.report(
            "no-sync",
            what="Unable to sync with device; possible link problem or link software version mismatch: "
            f"{board.who} does not answer",
            why=why,
            remedy=remedy,
        )

    def no_topics(self) -> None:
        """The board answers and has nothing."""
        board = self._board
        board.report(
            "no-topics",
            what=f"{board.who} is in sync and has no topics",
            why="it named none",
            remedy="Advertise and subscribe in setup(), before or after nh.initNode()",
        )
