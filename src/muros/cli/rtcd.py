"""The command `muros rtcd`: a manager of RT components without components of its own, as OpenRTM-aist's `rtcd` is."""

from __future__ import annotations

from collections.abc import Sequence

from muros.cli._rtc import MISSING, has_extra

HELP = """\
usage: muros rtcd [-h] [-a] [-d] [-f FILE] [-i] [-o KEY:VALUE] [-p PORT]

Run a manager of RT components: it loads, makes and ends components as rtc.conf lists them and as tools ask.

options:
"""


def run(argv: Sequence[str]) -> int:
    """Serve until SIGINT, SIGTERM or the end that rtc.conf asks for; returns the exit status."""
    if not has_extra():
        return MISSING
    from muros.rtc.manager import OPTIONS_HELP, serve_manager

    if "-h" in argv or "--help" in argv:
        print(HELP + OPTIONS_HELP)
        return 0
    return serve_manager(argv)
