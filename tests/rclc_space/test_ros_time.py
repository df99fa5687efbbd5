"""Simulated time: timers go by /clock, and by nothing else."""

from typing import Any

from muros.interfaces import message
from muros.rclc import RosTime
from tests.rclc_space.ways import Stage

CLOCK: Any = message("rosgraph_msgs/msg/Clock")


class Simulator:
    """Publishes /clock, and a program that goes by it."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.publisher = stage.node("simulator").publisher(CLOCK, "/clock", "sensor_data")
        node = stage.node("program")
        self.time = RosTime(node)
        self.node = node
        stage.meet(self.publisher)

    def at(self, milliseconds: int) -> None:
        """It is that time, and the program has learned of it."""
        clock = CLOCK()
        clock.clock.sec, rest = divmod(milliseconds, 1000)
        clock.clock.nanosec = rest * 1_000_000
        wanted = (clock.clock.sec, clock.clock.nanosec)
        self.stage.until(
            lambda: self.time.known and self.time.now() == wanted, lambda: self.publisher.publish(clock)
        )
        for executor in self.stage.executors:
            executor.spin_some()


def test_timers_go_by_the_clock(stage: Stage) -> None:
    simulator = Simulator(stage)
    time = simulator.time
    calls: list[tuple[int, int]] = []
    timer = time.timer(0.1, lambda: calls.append(time.now()))
    assert (time.known, time.now()) == (False, (0, 0))
    for executor in stage.executors:
        assert not executor.spin_some(0.15), "steady time moves nothing"
    simulator.at(1_000_000)
    assert calls == []
    simulator.at(1_000_099)
    assert calls == []
    simulator.at(1_000_100)
    assert calls == [(1000, 100_000_000)]
    simulator.at(1_000_150)
    simulator.at(1_000_200)
    assert calls[1:] == [(1000, 200_000_000)]
    assert timer.since == 100
    simulator.at(1_000_555)  # what was missed is skipped, the phase is kept
    simulator.at(1_000_599)
    assert calls[2:] == [(1000, 555_000_000)]
    simulator.at(1_000_600)
    assert len(calls) == 4


def test_time_that_jumps_back(stage: Stage) -> None:
    simulator = Simulator(stage)
    time = simulator.time
    calls: list[tuple[int, int]] = []
    time.timer(0.1, lambda: calls.append(time.now()))
    simulator.at(50_000)
    simulator.at(50_050)
    simulator.at(20_000)
    assert (time.jumps, calls) == (1, [])
    simulator.at(20_099)
    assert calls == []
    simulator.at(20_100)
    assert calls == [(20, 100_000_000)]


def test_a_timer_that_is_stopped_and_started(stage: Stage) -> None:
    simulator = Simulator(stage)
    calls: list[int] = []
    timer = simulator.time.timer(0.1, lambda: calls.append(1), autostart=False)
    simulator.at(1000)
    simulator.at(1500)
    assert calls == []
    timer.reset()
    simulator.at(1599)
    assert calls == []
    simulator.at(1600)
    assert calls == [1]
    timer.cancel()
    simulator.at(2000)
    assert calls == [1]
    timer.reset()
    simulator.node.destroy()
    assert simulator.node.context.handles == []


def test_what_is_stamped_with_it(stage: Stage) -> None:
    simulator = Simulator(stage)
    shown: list[str] = []
    log = simulator.node.logger(time=simulator.time.now, show=shown.append)
    simulator.at(7_250)
    log.info("now")
    assert shown == ["[INFO] [7.250000000] [program]: now"]
