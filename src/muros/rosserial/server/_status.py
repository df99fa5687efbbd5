"""How a board is, for /diagnostics: a sentence, a level, and figures of its line."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from muros.rosserial.server._board import Board

__all__ = ["status_of"]

OK, WARN, ERROR = 0, 1, 2
_TEXTS = {
    "away": (ERROR, "Not connected"),
    "asking": (WARN, "Requesting topics"),
    "synced": (OK, "Connected"),
    "silent": (WARN, "Lost sync: the board is silent"),
}


def status_of(board: Board, now: int) -> tuple[int, str, dict[str, str]]:
    """Level (0 good to 2 bad), a sentence, and figures by name."""
    decoder, output = board.decoder, board.output
    level, text = _TEXTS[board.state]
    values = {
        "last sync": _ago(board.last_time, now),
        "last sync lost": _ago(board.lost_last, now),
        "protocol": {0xFE: "hydro", 0xFF: "groovy"}.get(board.version, "unknown"),
        "frames received": str(decoder.frames),
        "bytes received": str(board.received_bytes),
        "frames sent": str(output.frames),
        "bytes sent": str(output.bytes),
        "frames not sent": str(output.dropped),
        "checksum errors": str(decoder.bad_checksum),
        "length errors": str(decoder.bad_length + decoder.too_long),
        "resyncs": str(decoder.cut),
        "bytes outside frames": str(decoder.garbage),
        "unknown topic ids": str(board.unknown),
        "topic requests": str(board.asks),
        "resets": str(board.resets),
        "round trip": "unknown" if board.round_trip is None else f"{board.round_trip} ms",
        "publish buffer": f"{board.roster.output_buffer} bytes",
        "subscribe buffer": f"{board.roster.input_buffer} bytes",
    }
    return level, text, values


def _ago(at: int | None, now: int) -> str:
    return "never" if at is None else f"{(now - at) / 1000:.1f} s ago"
