"""The states of a board at the server, and what makes one the other."""

__all__ = [
    "ANSWER",
    "ASKING",
    "AWAY",
    "LINE_DOWN",
    "LINE_UP",
    "SILENCE",
    "SILENT",
    "SYNCED",
    "TRANSITIONS",
]

AWAY = "away"
"""There is no line to the board."""
ASKING = "asking"
"""The line is there; the board has not answered yet."""
SYNCED = "synced"
"""Topics flow."""
SILENT = "silent"
"""The board has not been heard for longer than it should be."""

LINE_UP, LINE_DOWN, ANSWER, SILENCE = "line up", "line down", "answer", "silence"

TRANSITIONS = {
    (AWAY, LINE_UP): ASKING,
    (ASKING, LINE_UP): ASKING,
    (SYNCED, LINE_UP): ASKING,
    (SILENT, LINE_UP): ASKING,
    (ASKING, ANSWER): SYNCED,
    (SYNCED, SILENCE): SILENT,
    (SILENT, ANSWER): SYNCED,
    (ASKING, LINE_DOWN): AWAY,
    (SYNCED, LINE_DOWN): AWAY,
    (SILENT, LINE_DOWN): AWAY,
}
"""What becomes of a board; what is not here changes nothing. An answer is any frame while silent, else one that
belongs to negotiation."""
