"""Numbers that come in by a port are printed, with the time that they were stamped with."""

from muros.rtc import Component, InPort, run
from RTC import TimedLong


class ConsoleOut(Component):
    """Console output component"""

    version = "1.0"
    category = "example"
    max_instance = 10
    rate = 100

    values = InPort(TimedLong, name="in")

    def on_execute(self, context: int) -> None:
        while self.values.is_new():
            value = self.values.read()
            print(f"{value.tm.sec}.{value.tm.nsec:09d}: {value.data}", flush=True)


if __name__ == "__main__":
    run(ConsoleOut)
