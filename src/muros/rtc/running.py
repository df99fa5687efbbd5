"""`run`: a component's file as a program.

if __name__ == "__main__":
    run(Controller)
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import NoReturn

from muros.rtc.component import Component

__all__ = ["run"]


def run(*components: type[Component], argv: Sequence[str] | None = None) -> NoReturn:
    """Make one instance of each of `components` in a manager, and serve until it ends; then leave the process.

    `argv` are the manager's options (`-o key:value`, `-f rtc.conf`, ...; see docs/rtc.md), by default those of the
    command line. The exit status is 0 after a clean end, 1 where a component could not be made, 2 for wrong use.
    """
    from muros.rtc.manager import serve

    sys.exit(serve(components, sys.argv[1:] if argv is None else argv))
