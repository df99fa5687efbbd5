"""Numbers typed at the terminal go out by a port.

    muros rtc names &
    muros rtc run console_in.py

Then, at another terminal: `muros rtc run console_out.py`, `rtcon ConsoleIn0.rtc:out ConsoleOut0.rtc:in`, `rtact` both.
"""

import os
import select
import sys

from muros.rtc import Component, OutPort, run
from RTC import TimedLong

WAIT = 0.1
"""Seconds that one cycle waits for a line: the component stays open for being deactivated."""


class ConsoleIn(Component):
    """Console input component"""

    version = "1.0"
    category = "example"
    max_instance = 10

    out = OutPort(TimedLong)

    def on_activated(self, context: int) -> None:
        self.typed = b""
        print("number: ", end="", flush=True)

    def on_execute(self, context: int) -> None:
        if not select.select([sys.stdin], [], [], WAIT)[0]:
            return
        octets = os.read(sys.stdin.fileno(), 4096)
        if not octets:  # the terminal has been closed
            self.context_of(context).deactivate_component(self.participation)
            return
        *lines, self.typed = (self.typed + octets).split(b"\n")
        for line in lines:
            try:
                self.out.write(int(line))
            except ValueError:
                print(f"{line.decode(errors='replace')!r} is no whole number")
            print("number: ", end="", flush=True)


if __name__ == "__main__":
    run(ConsoleIn)
