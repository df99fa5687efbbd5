"""What the command line gives: values of parameters, levels of loggers; simulated time when a parameter says so."""

from collections.abc import Iterator
from typing import Any

import pytest

from muros.interfaces import message, service
from muros.rclc import Context, Node, ParameterRejectedError, ParameterTypeError, RosArguments
from tests.rclc_space.ways import Stage

CLOCK: Any = message("rosgraph_msgs/msg/Clock")


@pytest.fixture
def context() -> Iterator[Context]:
    """A context that nobody spins; its arguments may be replaced."""
    made = Context("local:", args=[])
    yield made
    made.close()


def arm(context: Context, *given: str, **options: Any) -> Node:
    """A node whose program was given parameters."""
    words = [word for value in given for word in ("-p", value)]
    context.arguments = RosArguments.parse(["--ros-args", *words])
    return context.node("arm", "lab", **options)


def test_what_is_declared_takes_the_value_that_is_given(context: Context) -> None:
    node = arm(context, "gain:=2", "arm:speed:=5", "/lab/arm:names:=[a]", "leg:speed:=6", "image:=[1, 255]")
    parameters = node.parameters()
    assert parameters.declare("gain", 1.0) == 2.0
    assert isinstance(parameters.get("gain"), float), "people write 2 for 2.0"
    assert parameters.declare("speed", 1) == 1, "arm is the node /arm, and this is /lab/arm"
    assert parameters.declare("names", [], type=9) == ["a"]
    assert parameters.declare("image", b"") == b"\1\xff"
    assert parameters.declare("other", True) is True
    assert parameters.describe("gain").type == 3


def test_what_a_program_gives_goes_before_the_command_line(context: Context) -> None:
    parameters = arm(context, "gain:=2.0", "speed:=3", parameters={"gain": 4.0}).parameters()
    assert parameters.declare("gain", 1.0) == 4.0
    assert parameters.declare("speed", 1, ignore_given=True) == 1
    assert context.node("leg", parameters={"speed": 7}, use_arguments=False).overrides == {"speed": 7}


def test_what_does_not_fit_is_refused(context: Context) -> None:
    parameters = arm(context, "gain:=much", "speed:=11", "mixed:=[1, a]").parameters()
    with pytest.raises(ParameterTypeError, match=r"is declared as double, and 'much' is given for it"):
        parameters.declare("gain", 1.0)
    with pytest.raises(ParameterTypeError, match=r"integer array, and \[1, 'a'\]"):
        parameters.declare("mixed", [1])
    with pytest.raises(ParameterRejectedError, match="that is not in its range"):
        parameters.declare("speed", 1, range=(0, 10))
    assert parameters.list() == []


def test_all_that_is_given_may_be_declared(context: Context) -> None:
    parameters = arm(context, "gain:=2.5", "motor.current:=3", "gain:=3.5").parameters()
    parameters.declare("gain", 1.0)
    assert parameters.declare_given() == ["motor.current"]
    assert {name: parameters.get(name) for name in parameters.list()} == {"gain": 3.5, "motor.current": 3}


def test_levels_on_the_command_line(context: Context) -> None:
    shown: list[str] = []
    line = ["--ros-args", "--log-level", "error", "--log-level", "lab.arm:=debug", "--disable-rosout-logs"]
    context.arguments = RosArguments.parse(line)
    log = context.node("arm", "lab").logger(show=shown.append)
    assert log.debug("hello")
    assert shown[0].endswith("[lab.arm]: hello")
    leg = context.node("leg")
    assert (leg.log.level, leg.logger(level="info").level) == (40, 20)
    assert leg.entities == [], "nothing is published on /rosout"


class Levels:
    """Somebody who asks for levels."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.node = stage.node("arm", "lab")
        self.log = self.node.logger(show=None, services=True)
        asker = stage.node("asker")
        self.kinds = [
            service(f"rcl_interfaces/srv/{name}") for name in ("GetLoggerLevels", "SetLoggerLevels")
        ]
        names = ("/lab/arm/get_logger_levels", "/lab/arm/set_logger_levels")
        self.clients = [asker.client(kind, name) for kind, name in zip(self.kinds, names, strict=True)]
        stage.meet(*self.clients)

    def ask(self, which: int, **request: Any) -> Any:
        """The answer to a request."""
        answers: list[Any] = []
        asked = self.kinds[which].Request(**request)
        self.stage.until(lambda: self.clients[which].send(asked, answers.append))
        self.stage.until(lambda: answers)
        assert answers[0] is not None
        return answers[0]


def test_others_ask_for_the_level_and_set_it(stage: Stage) -> None:
    levels = Levels(stage)
    found = levels.ask(0, names=["lab.arm", "nobody"]).levels
    assert [(one.name, one.level) for one in found] == [("lab.arm", 20), ("nobody", 0)]
    kind = message("rcl_interfaces/msg/LoggerLevel")
    wanted = [
        kind(name=name, level=level) for name, level in (("lab.arm", 40), ("nobody", 10), ("lab.arm", 999))
    ]
    results = levels.ask(1, levels=wanted).results
    assert [result.successful for result in results] == [True, False, False]
    assert results[1].reason == "no logger 'nobody' here, only lab.arm"
    assert results[2].reason == "there is no level 999"
    assert (levels.log.level, levels.log.info("quiet")) == (40, False)
    assert levels.ask(1, levels=[kind(name="lab.arm", level=0)]).results[0].successful
    assert levels.log.level == 20, "0 unsets it"


class Simulator:
    """Publishes /clock."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.publisher = stage.node("simulator").publisher(CLOCK, "/clock", "sensor_data")

    def at(self, milliseconds: int, node: Node) -> None:
        """It is that time, and the node has learned of it."""
        clock = CLOCK()
        clock.clock.sec, rest = divmod(milliseconds, 1000)
        clock.clock.nanosec = rest * 1_000_000
        wanted = (clock.clock.sec, clock.clock.nanosec)
        self.stage.until(lambda: node.clock.now() == wanted, lambda: self.publisher.publish(clock))
        for executor in self.stage.executors:
            executor.spin_some()


def test_a_clock_follows_the_parameter(stage: Stage) -> None:
    simulator = Simulator(stage)
    node = stage.node("program")
    calls: list[tuple[int, int]] = []
    clock = node.clock
    timer = clock.timer(0.1, lambda: calls.append(clock.now()))
    parameters = node.parameters()
    assert parameters.get("use_sim_time") is False
    assert (clock.simulated, clock.known, clock.now() > (1_700_000_000, 0)) == (False, True, True)
    stage.until(lambda: calls)
    parameters.set("use_sim_time", True)
    assert (clock.simulated, clock.known, clock.now()) == (True, False, (0, 0))
    calls.clear()
    simulator.at(50_000, node)
    assert not calls, "a new period has begun"
    simulator.at(50_100, node)
    assert calls == [(50, 100_000_000)]
    assert timer.since == 100
    parameters.set("use_sim_time", False)
    calls.clear()
    stage.until(lambda: calls)
    assert calls[0] > (1_700_000_000, 0)
    assert not [entity for entity in node.entities if getattr(entity, "topic", "") == "/clock"]


def test_simulated_time_from_the_command_line(stage: Stage) -> None:
    simulator = Simulator(stage)
    node = stage.node("program")
    given = RosArguments.parse(["--ros-args", "-p", "use_sim_time:=true"])
    node.context.arguments = given
    other = node.context.node("other")
    assert other.clock.simulated, "without parameters too"
    simulator.at(2_000, other)
    parameters = other.parameters()
    assert parameters.get("use_sim_time") is True
    assert other.clock.now() == (2, 0)
    parameters.update({"use_sim_time": False})
    assert not other.clock.simulated
    assert not node.clock.simulated, "it was made before"
