"""The clock of a node on hosts: the system's time, or simulated time while the parameter use_sim_time is true.

    parameters = node.parameters()
    node.clock.timer(0.1, lambda: print(node.clock.now()))

A node that has a clock and parameters has the parameter use_sim_time, which may be set at any time. Without parameters
the value that is given for it counts: ``-p use_sim_time:=true``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from muros.rclc.host.handles import take_away
from muros.rclc.host.logger import system_time
from muros.rclc.ros_time import RosTime, RosTimer, clock_class
from muros.rclc.timer import Timer

if TYPE_CHECKING:
    from muros.rclc.host.context import Node
    from muros.rclc.host.parameters import Parameters

__all__ = ["USE_SIM_TIME", "Clock", "ClockTimer"]

USE_SIM_TIME = "use_sim_time"


class Clock(RosTime):
    """Made by ``Node.clock``. ``simulated`` tells whose time it goes by; see ``RosTime`` for simulated time."""

    def __init__(self, node: Node) -> None:
        self.node = self._home = node
        self.simulated = False
        self.known = True
        self.jumps = 0
        self.timers = []
        self._seconds = self._nanoseconds = self._origin = 0
        self._parameters: Parameters | None = None

    def now(self) -> tuple[int, int]:
        """Seconds and nanoseconds: of the system since 1970, or simulated, which is (0, 0) until ``known``."""
        return super().now() if self.simulated else system_time()

    def ticks(self) -> int:
        """Milliseconds that timers go by."""
        return super().ticks() if self.simulated else self.node.context.clock()

    def timer(self, period: float, callback: Callable[[], object], autostart: bool = True) -> ClockTimer:
        """A timer that goes by this clock: by the steady one while time is not simulated."""
        made = ClockTimer(self, period, callback, autostart)
        self.timers.append(made)
        made.home = self.node.entities
        self.node.context.handles.append(made)
        self.node.entities.append(made)
        return made

    def simulate(self, simulated: bool) -> None:
        """Goes by /clock from now on, or no more; timers begin a new period."""
        if simulated == self.simulated:
            return
        self.simulated = simulated
        self.known = not simulated
        self._seconds = self._nanoseconds = self._origin = 0
        if simulated:
            self.subscription = self.node.subscription(clock_class(), "/clock", self._on_clock, "sensor_data")
        else:
            self.subscription.destroy()
        for timer in self.timers:
            timer.begin_anew()

    def follow(self, parameters: Parameters | None) -> None:
        """Has use_sim_time decide: the parameter, or without parameters the value given for it."""
        if parameters is None:
            self.simulate(self._home.overrides.get(USE_SIM_TIME) is True)
            return
        self._parameters = parameters
        if USE_SIM_TIME not in parameters.known:
            parameters.declare(USE_SIM_TIME, False, description="whether time is what /clock says")
        parameters.on_applied = self._look
        self._look()

    def _look(self) -> None:
        found = self._parameters and self._parameters.known.get(USE_SIM_TIME)
        self.simulate(bool(found and found.value is True))


class ClockTimer(RosTimer):
    """Made by ``Clock.timer``; see ``Timer``. With simulated time it is still until that is known."""

    _time: Clock
    home: Any = ()

    def destroy(self) -> None:
        """Takes it away."""
        if self in self._time.timers:
            self._time.timers.remove(self)
        take_away(self)

    def left(self, now: int) -> int:
        """Milliseconds until its time comes; with simulated time what brings it is a message."""
        return super().left(now) if self._time.simulated else Timer.left(self, now)
