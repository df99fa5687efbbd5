"""What a space reports, as the problems of a context: a number that programs may test for, and one line of text."""

from __future__ import annotations

from typing import Final

from muros.findings import Finding

__all__ = ["OTHER", "PROBLEMS", "code_of", "line_of"]

OTHER: Final = 20
"""The code of findings that are none of `PROBLEMS`."""

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
    "mixed-distros": 39,
    "discovery-info-unreadable": 40,
    "dds-no-interface": 41,
    "dds-no-multicast": 42,
    "dds-interface-missing": 43,
    "dds-peer-unknown": 44,
    "dds-receive-buffer-small": 45,
    "dds-receive-buffer-full": 46,
    "dds-send-queue-full": 47,
}
"""Codes of `Context.on_problem` by the code of the finding. Those below 20 are told of sessions and by rclc itself."""


def code_of(finding: Finding) -> int:
    """The code that `on_problem` is given."""
    return PROBLEMS.get(finding.code, OTHER)


def line_of(finding: Finding) -> str:
    """The finding in one line."""
    return " ".join(finding.format().removeprefix("finding: ").split())
