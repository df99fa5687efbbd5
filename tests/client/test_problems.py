"""What a session says when something is wrong: once for each cause, with what to do."""

import errno
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from muros.client import LOST, Custom, Serial, Session, Tcp, Udp, reasons
from muros.client import problems as problem
from muros.client._types import Transport
from muros.client.raw import Raw
from tests.client.test_session import Device
from tests.client.world import STRING, World


def texts(device: Device) -> list[str]:
    """What was told."""
    return [text for _, text in device.problems]


def test_a_sample_larger_than_largest_is_counted_and_told() -> None:
    world = World()
    device = Device(world, largest=1000).connect()
    for _ in range(3):
        device.host_writer.write(bytes(9000))
        device.host_writer.write(b"small")
        world.run(1000)
    assert device.got == [b"small"] * 3
    assert list(device.session.drops) == [0, 0, 0, 0, 3]
    assert [code for code, _ in device.problems] == [reasons.LARGEST] * 2, "the first, the second, the fourth"
    first, second = texts(device)
    assert "9008 B dropped: larger than largest=1000" in first
    assert "9008 B dropped (2 samples by now): larger than largest=1000" in second


def test_why_a_sample_cannot_go_out() -> None:
    world = World()
    world.stop_agent()
    world.start_agent(max_objects=7)
    device = Device(world)
    assert not device.writer.write_bytes(b"early")
    device.connect()
    refused = device.session.writer(device.participant, "rt/refused", STRING)
    assert not refused.write_bytes(b"at once")
    world.run(100)
    session = device.session
    session.drops[0] = 3  # the next is told again
    assert not session.defer(refused, Raw(b"later"), 5)
    early, at_once, status, later = texts(device)
    assert "5 B of rt/out dropped: no agent is connected. Session(queue=N)" in early
    assert (
        "7 B of rt/refused dropped (2 samples by now): the agent has not created it yet. Session(queue=N)"
        in at_once
    )
    assert "the agent refuses rt/refused: no resources" in status
    assert (
        "5 B of rt/refused dropped (4 samples by now): the agent refused to create it: no resources" in later
    )


def test_a_full_window_and_a_full_queue_are_told_apart() -> None:
    world = World()
    device = Device(world).connect()
    world.network.partition(["client"])
    while device.writer.write_bytes(bytes(400)):
        pass
    assert "history=4 messages are on their way" in texts(device)[0]
    world = World()
    device = Device(world, queue=3)
    while device.writer.write_bytes(bytes(400)):
        pass
    assert texts(device) == [
        "400 B of rt/out dropped: the queue is full, queue=3. Publish less often or raise it."
    ]


def test_a_large_sample_on_its_way_is_told_of() -> None:
    world = World()
    device = Device(world).connect()
    assert device.writer.write_bytes(bytes(9000))
    assert not device.writer.write_bytes(bytes(9000))
    assert "a sample larger than a message is still on its way" in texts(device)[0]


def test_silence_is_told_once_and_again_after_a_connection() -> None:
    world = World()
    world.stop_agent()
    device = Device(world)
    world.run(2900)
    assert not device.problems
    world.run(20_000)
    assert device.problems == [(reasons.SILENT, "no agent has answered for 3 s. Trying again.")]
    world.start_agent()
    device.connect()
    world.stop_agent()
    world.until(lambda: device.session.state == LOST)
    world.run(20_000)
    assert [code for code, _ in device.problems] == [reasons.SILENT] * 2


def test_each_cause_is_told_when_it_changes() -> None:
    world = World()
    world.stop_agent()
    device = Device(world)

    def fail(number: int) -> None:
        device.transport.fault = OSError(number, "")
        world.run(1500)

    world.run(100)
    for number in (errno.EHOSTUNREACH, errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EHOSTUNREACH):
        fail(number)
    assert [text.split(": ")[1] for text in texts(device)] == [
        "no route to host. Trying again.",
        "network is unreachable. Trying again.",
        "no route to host. Trying again.",
    ]


def test_an_agent_that_refuses_is_told_once() -> None:
    world = World()
    world.stop_agent()
    world.start_agent(max_clients=1)
    Device(world, address="other", client_key=1).connect()
    device = Device(world)
    world.run(60_000)
    assert [code for code, _ in device.problems] == [problem.SESSION]


def test_a_closed_session_has_no_problem() -> None:
    world = World()
    device = Device(world).connect()
    device.session.close()
    world.run(10_000)
    assert not device.problems


def nobody(make: Callable[[str, int], Transport]) -> Transport:
    """A transport to a port of ours where nobody listens."""
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        return make("127.0.0.1", held.getsockname()[1])


@pytest.mark.parametrize(
    ("transport", "said"),
    [
        (lambda: Udp("no-such-host.invalid"), "no host is called 'no-such-host.invalid'"),
        (lambda: nobody(Udp), "nobody listens at 127.0.0.1:"),
        (lambda: nobody(Tcp), "nobody listens at 127.0.0.1:"),
        (lambda: Serial("/nowhere/ttyBoard"), "/nowhere/ttyBoard is not there"),
    ],
    ids=["name", "udp", "tcp", "device"],
)
def test_what_is_unreachable_is_told_once_on_standard_error(
    transport: Callable[[], Transport], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    way = transport()
    session = Session(way, retry=10)
    for _ in range(30):
        session.spin_once()
        session.wait(5)
    session.close()
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"muros: {said}")
    assert err.count("\n") == 1


def test_a_way_of_the_users_own_that_fails(capsys: pytest.CaptureFixture[str]) -> None:
    def broken() -> bool:
        raise OSError("the modem sleeps")

    session = Session(Custom(broken, lambda: None, lambda buf, off, n: None, lambda buf: 0))
    session.spin_once()
    assert capsys.readouterr().err == "muros: cannot reach an agent: the modem sleeps. Trying again.\n"


def test_a_device_that_is_not_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    serial = Serial(str(tmp_path / "ttyBoard"))
    told: list[str] = []

    def denied() -> bool:
        raise PermissionError(errno.EACCES, "denied")

    monkeypatch.setattr(serial, "open", denied)
    session = Session(serial)
    session.on_problem = lambda code, text: told.append(text)
    session.spin_once()
    assert told == [f"{serial.device}: permission denied. Is your user in its group (dialout)? Trying again."]


def test_without_a_standard_error_nothing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr", None)
    session = Session(Serial("/nowhere/ttyBoard"))
    session.spin_once()
    assert session.trouble is not None


def test_boards_have_few_words() -> None:
    writer: Any = type("Writer", (), {"name": "rt/out"})
    said = [problem.text(code, 5, writer) for code in (problem.TOO_LARGE, problem.OFFLINE, problem.FULL)]
    assert len({text.removeprefix("5 B of rt/out dropped: ") for text in said}) == 3
    assert problem.text(reasons.UNREACHABLE, 0, OSError("gone")) == "no way to the agent: gone"
    assert "5 B" in problem.text(reasons.LARGEST, 5, "")
