"""Simulated time on every runtime: timers go by /clock, for as long as a simulation may last."""

from muros.compat import const
from muros.rclc import RosTime
from muros.rclc.ros_time import clock_class
from tests.board.broker import Broker

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

_DAY = const(86400)


class Simulator:
    """Publishes /clock, and a program that goes by it; ``calls`` of its timer of 100 ms."""

    def __init__(self) -> None:
        self.kind: "Any" = clock_class()
        self.broker = Broker()
        self.publisher = self.broker.context().node("simulator").publisher(self.kind, "/clock", "sensor_data")
        self.time = RosTime(self.broker.context().node("program"))
        self.calls: "list[tuple[int, int]]" = []
        self.timer = self.time.timer(0.1, lambda: self.calls.append(self.time.now()))
        self.broker.settle()

    def at(self, seconds: int, milliseconds: int = 0) -> "list[tuple[int, int]]":
        """It is that time; the calls that this has brought."""
        clock = self.kind()
        clock.clock.sec = seconds
        clock.clock.nanosec = milliseconds * 1000000
        self.calls.clear()
        assert self.publisher.publish(clock)
        self.broker.until(lambda: self.time.now() == (seconds, milliseconds * 1000000))
        self.broker.run(5)
        return self.calls


def test_timers_go_by_the_clock() -> None:
    simulator = Simulator()
    simulator.broker.run(300)
    assert (simulator.time.known, simulator.time.now(), simulator.calls) == (False, (0, 0), [])
    assert simulator.at(1000) == []
    assert simulator.at(1000, 99) == []
    assert simulator.at(1000, 100) == [(1000, 100000000)]
    assert simulator.at(1000, 250) == [(1000, 250000000)], "the phase is kept"
    assert simulator.at(1000, 299) == []
    assert len(simulator.at(1000, 300)) == 1
    simulator.timer.cancel()
    assert simulator.at(1001) == []


def test_time_jumps_back_and_timers_begin_anew() -> None:
    simulator = Simulator()
    simulator.at(1000)
    assert simulator.at(5) == []
    assert simulator.time.jumps == 1
    assert simulator.at(5, 99) == []
    assert len(simulator.at(5, 100)) == 1


def test_time_goes_on_for_weeks_and_jumps_ahead() -> None:
    simulator = Simulator()
    simulator.at(1000)
    for day in range(1, 30):
        assert len(simulator.at(1000 + day * _DAY)) == 1
        assert simulator.at(1000 + day * _DAY, 99) == []
        assert len(simulator.at(1000 + day * _DAY, 100)) == 1
    assert simulator.time.jumps == 0
    assert simulator.at(1700000000) == [], "the simulator had begun at 0, and has the time now"
    assert simulator.time.jumps == 1
    assert len(simulator.at(1700000000, 100)) == 1
