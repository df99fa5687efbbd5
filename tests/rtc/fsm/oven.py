"""A microwave oven, as state machines have been explained with for decades."""

from __future__ import annotations

from muros.rtc.fsm import State
from tests.rtc.data.kit import TimedLong

log: list[str] = []


class Oven(State):
    class Data:
        minutes = 0

    def on_init(self) -> None:
        self.go(Operational)

    def open(self) -> None: ...
    def close(self) -> None: ...
    def minute(self, time: TimedLong) -> None: ...
    def start(self) -> None: ...
    def stop(self) -> None: ...
    def tick(self) -> None: ...


class Disabled(State, within=Oven):
    def on_entry(self) -> None:
        log.append("opened")

    def onExit(self) -> None:  # noqa: N802 (both names of an action work)
        log.append("closed")

    def close(self) -> None:
        self.go(Operational)


class Operational(State, within=Oven, deep_history=True):
    def on_init(self) -> None:
        self.go(Idle)

    def open(self) -> None:
        self.go(Disabled)

    def stop(self) -> None:
        self.go(Idle)


class Idle(State, within=Operational):
    def on_entry(self) -> None:
        self.data(Oven).minutes = 0
        log.append("ready")

    def minute(self, time: TimedLong) -> None:
        self.go(Programmed)
        self.send(Oven.minute, time)


class Programmed(State, within=Operational):
    def minute(self, time: TimedLong) -> None:
        self.data(Oven).minutes += time.data

    def start(self) -> None:
        self.go(Cooking)


class Cooking(State, within=Programmed):
    def on_entry(self) -> None:
        log.append("heat on")

    def on_exit(self) -> None:
        log.append("heat off")

    def on_do(self) -> None:
        log.append("hum")

    def tick(self) -> None:
        box = self.data(Oven)
        box.minutes -= 1
        if box.minutes == 0:
            self.go(Idle)
