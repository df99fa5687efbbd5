"""The examples that have to do with the agent itself print what they say."""

import re
from datetime import UTC, datetime

from muros.links import DiscoveryLink
from tests.examples.stage import Stage, interrupt


def test_ping(stage: Stage, on: str) -> None:
    program = stage.start("ping_agent", stage.agent(), on=on)
    stage.until(lambda: "the agent answers" in program.lines)
    assert program.lines.index("state CONNECTED") < program.lines.index("the agent answers")
    assert stage.running is not None
    stage.running.stop()
    stage.until(lambda: "the agent does not answer" in program.lines)
    stage.until(lambda: "state LOST" in program.lines)


def test_epoch(stage: Stage, on: str) -> None:
    today = datetime.now(UTC).date()
    program = stage.start("epoch_sync", stage.agent(), on=on)
    stage.until(lambda: program.lines)
    match = re.fullmatch(r"(\d+-\d\d-\d\d), within (\d+) us", program.lines[0])
    assert match, program.lines
    assert today <= datetime.fromisoformat(match[1]).date() <= datetime.now(UTC).date()
    assert int(match[2]) < 1_000_000


def test_a_transport_of_one_s_own(stage: Stage, on: str) -> None:
    stage.agent()
    program = stage.start("custom_transport", "127.0.0.1", stage.link.port, on=on)
    stage.until(lambda: program.lines[:3] == ["Sent: 0", "Sent: 1", "Sent: 2"])


def test_an_agent_that_is_found(stage: Stage, on: str) -> None:
    door = DiscoveryLink(0)
    stage.agent(door)
    program = stage.start("autodiscover", "127.0.0.1", door.port, on=on)
    stage.until(lambda: len(program.lines) >= 3)
    assert program.lines[:3] == [f"found an agent at 127.0.0.1:{stage.link.port}", "Sent: 0", "Sent: 1"]
    if on == "python":
        interrupt(program)
