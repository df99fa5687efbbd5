"""Components that tools are tried on: one gives numbers, one says which it has got, one is a state machine."""

from muros.rtc import Component, InPort, OutPort, Parameter, ReturnCode
from muros.rtc.fsm import State, StateMachine
from RTC import Time, TimedLong


class Giver(Component):
    """Gives numbers."""

    category = "test"
    rate = 50
    out = OutPort(TimedLong)
    step = Parameter(1, constraint="0<=x<=9", widget="spin")
    fails = Parameter(0)

    def on_activated(self, context: int) -> None:
        self.number = 0

    def on_execute(self, context: int) -> ReturnCode:
        self.number += self.step
        self.out.write(TimedLong(Time(0, 0), self.number))
        return ReturnCode.RTC_ERROR if self.fails else ReturnCode.RTC_OK

    def on_reset(self, context: int) -> None:
        print("reset", flush=True)


class Taker(Component):
    """Takes numbers."""

    category = "test"
    rate = 50
    inp = InPort(TimedLong)

    def on_execute(self, context: int) -> None:
        if self.inp.is_new():
            print("got", self.inp.read().data, flush=True)


class Whole(State):
    """A door."""

    def on_init(self) -> None:
        self.go(Closed)

    def turn(self) -> None:
        """An event."""


class Closed(State, within=Whole):
    """Where it begins."""


class Door(Component):
    """Opens and closes."""

    category = "test"
    machine = StateMachine(Whole)

    def on_execute(self, context: int) -> None:
        self.machine.run_events()
