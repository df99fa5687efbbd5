"""A motor with its encoder and its controller, as three components. The motor is simulated.

    muros rtc run servo.py -f servo.conf

servo.conf connects and activates them; `rtconf Controller0.rtc set target 90` turns the motor.
"""

import math

from muros.rtc import Component, InPort, OutPort, Parameter, run
from RTC import TimedDouble, TimedLong

RATE = 500.0
"""Cycles of each component a second."""


class _Part(Component):
    """What the three have in common."""

    category = "example"
    rate = RATE


class Motor(_Part):
    """DC motor: turns after the voltage that it is given"""

    voltage = InPort(TimedDouble)
    angle = OutPort(TimedDouble)

    speed_per_volt = Parameter(6.0, constraint="x>0")
    inertia_time = Parameter(0.05, constraint="x>0")

    def on_activated(self, context: int) -> None:
        self._angle = self._speed = self._voltage = 0.0

    def on_execute(self, context: int) -> None:
        if self.voltage.is_new():
            self._voltage = max(-12.0, min(12.0, self.voltage.read().data))
        step = 1 / RATE
        wanted = self._voltage * self.speed_per_volt
        self._speed += (wanted - self._speed) * (1 - math.exp(-step / self.inertia_time))
        self._angle += self._speed * step
        self.angle.write(self._angle)


class Encoder(_Part):
    """Encoder: counts the steps of a turning shaft"""

    angle = InPort(TimedDouble)
    count = OutPort(TimedLong)

    resolution = Parameter(4096, constraint="x>0")

    def on_execute(self, context: int) -> None:
        if self.angle.is_new():
            turns = self.angle.read().data / (2 * math.pi)
            self.count.write(round(turns * self.resolution))


class Controller(_Part):
    """PD controller: brings the shaft to the target, in degrees"""

    count = InPort(TimedLong)
    voltage = OutPort(TimedDouble)

    target = Parameter(45.0, constraint="-180<=x<=180", widget="slider.1")
    gain = Parameter(4.0, constraint="0<=x<=50", widget="slider.0.1")
    damping = Parameter(0.05, constraint="0<=x<=5", widget="slider.0.01")
    resolution = Parameter(4096, constraint="x>0")

    def on_activated(self, context: int) -> None:
        self._before = 0.0
        self.voltage.write(0.0)

    def on_deactivated(self, context: int) -> None:
        self.voltage.write(0.0)

    def on_execute(self, context: int) -> None:
        if self.count.is_new():
            angle = 2 * math.pi * self.count.read().data / self.resolution
            speed, self._before = (angle - self._before) * RATE, angle
            self.voltage.write(self.gain * (math.radians(self.target) - angle) - self.damping * speed)


if __name__ == "__main__":
    run(Motor, Encoder, Controller)
