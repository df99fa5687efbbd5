"""What a space reports, as the problems of a context: a number that programs may test for, and one line of text.

Numbers below 18 are told of sessions with agents, and by rclc itself.
"""

from __future__ import annotations

from typing import Final

from muros.findings import Finding

__all__ = ["ENCODING", "NETWORK", "NOT_SCHEDULED", "NOT_SPUN", "OTHER", "PROBLEMS", "code_of", "line_of"]

NOT_SPUN: Final = 18
"""A context is published in, but nobody spins it."""

ENCODING: Final = 19
"""A sample came that nobody here can read."""

OTHER: Final = 20
"""The space reports something that has no number of its own."""

NOT_SCHEDULED: Final = "thread-not-scheduled"
"""The finding that a thread is not scheduled as it should be. rclc has told its context of it already."""

NETWORK: Final = 40
"""The network, or somebody on it, is not as it should be; these findings have codes that begin with ``dds-``."""

PROBLEMS: Final = {
    "qos-mismatch": 21,
    "type-mismatch": 22,
    "no-server": 23,
    "server-too-slow": 24,
    "request-overwritten": 25,
    "reply-unmatched": 26,
    "several-servers": 27,
    "reader-too-slow": 28,
    "reader-full": 29,
    "sample-expired": 30,
    "history-full": 31,
    "depth-limited": 32,
    "durability-lowered": 33,
    "reader-deadline-missed": 34,
    "writer-deadline-missed": 35,
    "samples-lost": 36,
    "reader-stalled": 37,
    "sample-unreadable": 38,
    "liveliness-lost": 39,
    "writer-silent": 41,
    "mixed-distros": 42,
    "request-unanswered": 43,
}
"""The numbers of what is about nodes, topics and services, by the code of the finding; see docs/space.md."""


def code_of(finding: Finding) -> int:
    """The number that `on_problem` is given."""
    if finding.code.startswith("dds-"):
        return NETWORK
    return PROBLEMS.get(finding.code, OTHER)


def line_of(finding: Finding) -> str:
    """The finding in one line."""
    return " ".join(finding.format().removeprefix("finding: ").split())
