"""What the agent prints: muros' own words, the reference's, levels and colours."""

import io
import time
from pathlib import Path

import pytest

from muros.agent.events import (
    ClientBack,
    ClientConnected,
    ClientGone,
    ClientLost,
    ClientReady,
    EntityCreated,
    EntityDeleted,
    Event,
    LinkDown,
    LinkUp,
)
from muros.cli._log import STYLES, Log, Message, printable
from muros.cli._tap import Tap
from muros.findings import Finding, Severity
from muros.links import Address, Link, LinkEvents

NOON = time.mktime((2026, 11, 5, 12, 0, 1, 0, 0, -1))
KEY = 0xBA5EBA11
PEER = "192.168.1.23:50210"
FINDING = Finding("a-code", "client 0x1A2B0007", "{n} sample{s} dropped", "too slow", "Read faster")


class Screen:
    """A log and what it printed."""

    def __init__(self, style: str = "muros", verbose: int = 4, color: bool | None = False) -> None:
        self.stream = io.StringIO()
        self.log = Log(self.stream, STYLES[style](), verbose=verbose, color=color, clock=lambda: NOON)

    def lines(self) -> list[str]:
        text = self.stream.getvalue()
        self.stream.seek(0)
        self.stream.truncate()
        return text.splitlines()


def test_events_in_our_words() -> None:
    screen = Screen()
    screen.log.started("muros agent 0.1.0 · udp4 0.0.0.0:8888", ["udp4 0.0.0.0:8888"])
    screen.log.event(ClientConnected(KEY, 0x81, PEER))
    screen.log.event(ClientReady(KEY, ("/greenhouse/thermometer",), 1, 1, 0, 0))
    screen.log.event(ClientLost(KEY, "cable pulled: /dev/ttyUSB0 is gone", 30.0))
    assert screen.lines() == [
        "muros agent 0.1.0 · udp4 0.0.0.0:8888",
        "[12:00:01] client 0xBA5EBA11 connected from 192.168.1.23:50210",
        "[12:00:01] client 0xBA5EBA11: node /greenhouse/thermometer: 1 writer, 1 reader",
        "[12:00:01] client 0xBA5EBA11 lost (cable pulled: /dev/ttyUSB0 is gone), kept for 30 s",
    ]


def test_a_finding_is_two_lines() -> None:
    screen = Screen()
    screen.log.finding(FINDING)
    first, second = screen.lines()
    assert first.startswith("[12:00:01] finding: client 0x1A2B0007: 1 sample dropped: too slow")
    assert second == " " * 11 + "Read faster."


EVENTS: list[tuple[int, Event]] = [
    (4, LinkUp("serial /dev/a at 9600", "/dev/a at 9600")),
    (3, LinkDown("serial /dev/a at 9600", "cable pulled: /dev/a is gone")),
    (4, ClientConnected(KEY, 0x81, PEER)),
    (4, ClientReady(KEY, (), 0, 0, 0, 0)),
    (4, ClientBack(KEY, 0x81, PEER, 1.8, False)),
    (3, ClientLost(KEY, "gone", None)),
    (4, ClientGone(KEY, 0x81, "said goodbye")),
    (5, EntityCreated(KEY, 1, 0x11, 0x11, "talker")),
    (5, EntityDeleted(KEY, 1, 0x11, "talker")),
]


@pytest.mark.parametrize(("level", "event"), EVENTS, ids=lambda value: type(value).__name__)
def test_levels_of_events(level: int, event: Event) -> None:
    for verbose in range(7):
        screen = Screen(verbose=verbose)
        screen.log.event(event)
        assert len(screen.lines()) == (verbose >= level)


@pytest.mark.parametrize(
    ("severity", "level"), [(Severity.ERROR, 2), (Severity.WARNING, 3), (Severity.INFO, 4)]
)
@pytest.mark.parametrize("style", STYLES)
def test_levels_of_findings(style: str, severity: Severity, level: int) -> None:
    finding = Finding("a-code", "somebody", "something happened", severity=severity)
    for verbose in range(7):
        screen = Screen(style, verbose)
        screen.log.finding(finding)
        assert len(screen.lines()) == (verbose >= level)


MESSAGE = Message("udp4 0.0.0.0:8888", PEER, True, bytes(range(34)))


def test_messages_in_our_words() -> None:
    for verbose, lines in ((4, 0), (5, 1), (6, 3)):
        screen = Screen(verbose=verbose)
        screen.log.message(MESSAGE)
        shown = screen.lines()
        assert len(shown) == lines
        if shown:
            assert shown[0] == "[12:00:01]    34 B <- from 192.168.1.23:50210 (udp4)"
        if verbose == 6:
            assert shown[1].startswith(" " * 11 + "0000: 00 01 02 03")
            assert shown[2] == " " * 11 + "0020: 20 21"
    screen.log.message(MESSAGE._replace(incoming=False))
    assert "-> to 192.168.1.23:50210" in screen.lines()[0]


def test_events_in_the_words_of_the_reference() -> None:
    screen = Screen("reference")
    screen.log.started("", ["udp4 0.0.0.0:8888", "serial /dev/a at 9600", "discovery 239.255.0.2:7400"])
    screen.log.event(LinkUp("serial /dev/a at 9600", "/dev/a at 9600"))
    screen.log.event(LinkUp("pseudoterminal /dev/pts/4", "pseudoterminal /dev/pts/4"))
    screen.log.event(ClientConnected(1, 0x81, PEER))
    screen.log.event(EntityCreated(1, 1, 0x0011, 0x0011, "talker"))
    screen.log.event(EntityCreated(1, 5, 0x0FF5, 0x0011, "rt/chatter"))
    screen.log.event(ClientBack(1, 0x81, PEER, 2.0, True))
    screen.log.event(ClientBack(1, 0x81, PEER, 2.0, False))
    screen.log.event(EntityDeleted(1, 5, 0x0FF5, "rt/chatter"))
    screen.log.event(ClientGone(1, 0x81, "said goodbye"))
    screen.log.event(LinkDown("serial /dev/a at 9600", "cable pulled: /dev/a is gone"))
    stamp = f"[{NOON:.6f}]"
    assert screen.lines() == [
        f"{stamp} info     | UDPv4AgentLinux.cpp | init                     | running...             | port: 8888",
        f"{stamp} info     | Root.cpp           | set_verbose_level        | logger setup           "
        "| verbose_level: 4",
        f"{stamp} info     | TermiosAgentLinux.cpp | init                     | running...             "
        "| device: /dev/a at 9600",
        f"{stamp} info     | PseudoTerminalAgentLinux.cpp | init                     | running...             "
        "| device: /dev/pts/4",
        f"{stamp} info     | Root.cpp           | create_client            | create                 "
        "| client_key: 0x00000001, session_id: 0x81",
        f"{stamp} info     | SessionManager.hpp | establish_session        | session established    "
        f"| client_key: 0x00000001, address: {PEER}",
        f"{stamp} info     | ProxyClient.cpp    | create_participant       | participant created    "
        "| client_key: 0x00000001, participant_id: 0x001(1)",
        f"{stamp} info     | ProxyClient.cpp    | create_datawriter        | datawriter created     "
        "| client_key: 0x00000001, datawriter_id: 0x0FF(5), participant_id: 0x001(1)",
        f"{stamp} info     | SessionManager.hpp | establish_session        | session re-established "
        f"| client_key: 0x00000001, address: {PEER}",
        f"{stamp} info     | ProxyClient.cpp    | delete_object            | object deleted         "
        "| client_key: 0x00000001, object_id: 0x0FF(5)",
        f"{stamp} info     | Root.cpp           | delete_client            | delete                 "
        "| client_key: 0x00000001",
        f"{stamp} info     | SessionManager.hpp | destroy_session          | session closed         "
        f"| client_key: 0x00000001, address: {PEER}",
        f"{stamp} info     | TermiosAgentLinux.cpp | init                     | Serial port not found. "
        "| cable pulled: /dev/a is gone, waiting for connection...",
    ]


def test_messages_in_the_words_of_the_reference() -> None:
    screen = Screen("reference", 6)
    screen.log.event(ClientConnected(1, 0x81, PEER))
    screen.lines()
    screen.log.message(Message("udp4 0.0.0.0:8888", PEER, True, b"\x81" * 33))
    first, second, third = screen.lines()
    assert first.endswith(
        "debug    | UDPv4AgentLinux.cpp | recv_message             | [==>> UDP <<==]        "
        "| client_key: 0x00000001, len: 33, data: "
    )
    assert second == "0000: " + " ".join(["81"] * 32)
    assert third == "0020: 81"
    screen.log.message(Message("serial /dev/a at 9600", "/dev/a#1", False, bytes.fromhex("01000000aabbccdd")))
    first, second = screen.lines()
    assert "| SerialAgentLinux.cpp | send_message             | [** <<SER>> **]        |" in first
    assert "client_key: 0xAABBCCDD, len: 8" in first
    assert second == "0000: 01 00 00 00 AA BB CC DD"


def test_findings_in_the_words_of_the_reference() -> None:
    screen = Screen("reference")
    screen.log.finding(FINDING)
    screen.log.finding(
        Finding("port-absent", "serial /dev/a at 9600", "/dev/a is not open", "there is no such device now")
    )
    screen.log.finding(
        Finding(
            "best-effort-too-big", "client 0x1", "dropped", "700 B do not fit its best-effort MTU of 508 B"
        )
    )
    own, absent, big = (line.partition("] ")[2] for line in screen.lines())
    assert own.startswith(
        "warning  | muros              | finding                  | a-code                 |"
    )
    assert own.endswith("client 0x1A2B0007: 1 sample dropped: too slow. Read faster.")
    assert absent == (
        "info     | TermiosAgentLinux.cpp | init                     | Serial port not found. "
        "| device: /dev/a, error 2, waiting for connection..."
    )
    assert big.endswith("| Trying to serialize 700 in 508 MTU stream")


def test_the_reference_style_remembers_only_clients_that_are_there() -> None:
    style = STYLES["reference"]()
    for key in range(1, 1000):
        list(style.event(NOON, ClientConnected(key, 0x81, f"host:{key}")))
        list(style.event(NOON, ClientGone(key, 0x81, "said goodbye")))
    assert [value for value in vars(style).values() if value] == []


def test_foreign_names_cannot_steer_the_terminal() -> None:
    assert printable("a\x1b[2Jb\nc\tdé") == r"a\x1b[2Jb\nc\tdé"
    for style in STYLES:
        screen = Screen(style, 6)
        screen.log.event(EntityCreated(1, 1, 0x11, 0x11, "evil\x1b]0;x\x07\r\nname"))
        (line,) = screen.lines()
        assert line.isprintable()


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("color", "environ", "colored"),
    [
        (None, {}, True),
        (None, {"NO_COLOR": "1"}, False),
        (None, {"TERM": "dumb"}, False),
        (False, {}, False),
        (True, {"NO_COLOR": "1"}, True),
    ],
)
def test_colors_on_a_terminal(
    color: bool | None, environ: dict[str, str], colored: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    for name, value in environ.items():
        monkeypatch.setenv(name, value)
    stream = Terminal()
    Log(stream, STYLES["muros"](), color=color).event(ClientConnected(KEY, 0x81, PEER))
    assert ("\x1b[32m" in stream.getvalue()) is colored


def test_no_colors_in_a_file() -> None:
    screen = Screen(color=None)
    screen.log.event(ClientConnected(KEY, 0x81, PEER))
    assert "\x1b" not in screen.lines()[0]


def test_the_agent_goes_on_when_nobody_reads(tmp_path: Path) -> None:
    with open(tmp_path / "log", "w", encoding="utf-8") as stream:
        log = Log(stream, STYLES["muros"]())
    log.event(ClientConnected(KEY, 0x81, PEER))  # the file is closed now
    log.event(ClientConnected(KEY, 0x81, PEER))
    assert (tmp_path / "log").read_text() == ""


class Recorder:
    """The owner of a link, writing down what it is told."""

    def __init__(self) -> None:
        self.told: list[tuple[object, ...]] = []

    def on_message(self, link: Link, data: bytes, address: Address) -> None:
        self.told.append((link, "message", data, address))

    def on_up(self, link: Link, detail: str) -> None:
        self.told.append((link, "up", detail))

    def on_down(self, link: Link, reason: str) -> None:
        self.told.append((link, "down", reason))

    def on_gone(self, link: Link, address: Address, reason: str) -> None:
        self.told.append((link, "gone", address, reason))

    def on_problem(self, link: Link, code: str, what: str, why: str, remedy: str, n: int) -> None:
        self.told.append((link, "problem", code, what, why, remedy, n))


class Loopback(Link):
    """A link that keeps what it is given."""

    devices = ("d",)

    def __init__(self) -> None:
        super().__init__()
        self.sent: list[tuple[bytes, Address]] = []

    @property
    def name(self) -> str:
        return "loopback"

    @property
    def events(self) -> LinkEvents:
        assert self._events is not None
        return self._events

    def send(self, message: bytes, address: Address) -> bool:
        self.sent.append((message, address))
        return True

    def _open(self) -> None: ...

    def _close(self) -> None: ...


def test_a_tap_shows_and_passes_on_everything() -> None:
    seen: list[tuple[object, ...]] = []
    inner, owner = Loopback(), Recorder()
    tap = Tap(inner, lambda *message: seen.append(message))
    tap.open(owner)
    assert (tap.is_open, tap.name, tap.describe("x"), tap.locators()) == (True, "loopback", "x", [])
    assert tap.devices == ("d",)
    inner.events.on_message(inner, b"in", "a")
    assert tap.send(b"out", "b")
    inner.events.on_up(inner, "up")
    inner.events.on_down(inner, "down")
    inner.events.on_gone(inner, "a", "gone")
    inner.events.on_problem(inner, "c", "w", "y", "r", 2)
    tap.close()
    assert seen == [(inner, True, b"in", "a"), (inner, False, b"out", "b")]
    assert inner.sent == [(b"out", "b")]
    assert not inner.is_open
    assert owner.told == [
        (tap, "message", b"in", "a"),
        (tap, "up", "up"),
        (tap, "down", "down"),
        (tap, "gone", "a", "gone"),
        (tap, "problem", "c", "w", "y", "r", 2),
    ]
