"""The command line of the agent: the reference's, ours, and everything that can be said wrongly."""

import shlex
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.agent import Limits
from muros.agent._options import OPTIONS, TRANSPORTS
from muros.agent.arguments import AgentOptions, LinkOptions, UsageError, help_text, parse_arguments


def parse(line: str, **environ: str) -> AgentOptions:
    options = parse_arguments(shlex.split(line), environ)
    assert options is not None
    return options


def link(line: str) -> LinkOptions:
    (only,) = parse(line).links
    return only


def wrong(line: str, **environ: str) -> str:
    with pytest.raises(UsageError) as caught:
        parse(line, **environ)
    message = str(caught.value)
    assert "\n" not in message
    return message


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("udp4 -p 8888", LinkOptions(kind="udp4", port=8888)),
        ("udp4 --port 8888 -v6", LinkOptions(kind="udp4", port=8888)),
        ("udp6 -p8888", LinkOptions(kind="udp6", port=8888)),
        ("tcp4 --port=8888 -d", LinkOptions(kind="tcp4", port=8888, discovery_port=7400)),
        ("tcp6 -p 1 -d 7500", LinkOptions(kind="tcp6", port=1, discovery_port=7500)),
        ("udp4 -d7500 -p 1", LinkOptions(kind="udp4", port=1, discovery_port=7500)),
        ("udp4 -d -p 1", LinkOptions(kind="udp4", port=1, discovery_port=7400)),
        ("udp4 -p 0 --bind 127.0.0.1", LinkOptions(kind="udp4", bind="127.0.0.1")),
        ("udp6 -p 1 --bind ::1", LinkOptions(kind="udp6", port=1, bind="::1")),
        ("tcp4 -p 1 --connections 250", LinkOptions(kind="tcp4", port=1, connections=250)),
        ("serial --dev /dev/ttyUSB0", LinkOptions(kind="serial", devices=("/dev/ttyUSB0",))),
        (
            "serial --dev /dev/serial/by-id/usb-FTDI-if00-port0 -v6 -b 921600",
            LinkOptions(kind="serial", devices=("/dev/serial/by-id/usb-FTDI-if00-port0",), baudrate=921600),
        ),
        (
            "serial -D /dev/a -fc -b 4000000",
            LinkOptions(kind="serial", devices=("/dev/a",), baudrate=4000000),
        ),
        (
            "multiserial -D '/dev/a /dev/b' -b 57600",
            LinkOptions(kind="multiserial", devices=("/dev/a", "/dev/b"), baudrate=57600),
        ),
        ("multiserial --devs '/dev/a'", LinkOptions(kind="multiserial", devices=("/dev/a",))),
        ("pseudoterminal", LinkOptions(kind="pseudoterminal")),
        ("pseudoterminal -b 115200", LinkOptions(kind="pseudoterminal")),
        ("pseudoterminal -D /tmp/board", LinkOptions(kind="pseudoterminal", devices=("/tmp/board",))),
        ("canfd -D can0 -I 0x1F", LinkOptions(kind="canfd", devices=("can0",), can_id=0x1F)),
        ("canfd --dev can0 --id 00000012", LinkOptions(kind="canfd", devices=("can0",), can_id=0x12)),
        ("udp4 -p 1 -p 2", LinkOptions(kind="udp4", port=2)),
    ],
)
def test_links(line: str, expected: LinkOptions) -> None:
    assert link(line) == expected


@pytest.mark.parametrize(
    ("line", "field", "value"),
    [
        ("udp4 -p 1", "verbose", 4),
        ("udp4 -p 1 -v 0", "verbose", 0),
        ("udp4 -p 1 -v6", "verbose", 6),
        ("udp4 -v -p 1", "verbose", 4),
        ("udp4 -p 1 -v", "verbose", 4),
        ("-v 5 udp4 -p 1", "verbose", 5),
        ("udp4 -v serial -D /dev/a -p 1", "verbose", None),
        ("udp4 -p 1", "middleware", "dds"),
        ("udp4 -p 1 -m ced", "middleware", "ced"),
        ("--middleware local udp4 -p 1", "middleware", "local"),
        ("udp4 -p 1", "ros_distro", None),
        ("udp4 -p 1 --ros-distro humble", "ros_distro", "humble"),
        ("udp4 -p 1 -r some.refs", "refs", Path("some.refs")),
        ("udp4 -p 1 -r a --refs-optional", "refs_optional", True),
        ("udp4 -p 1 --no-color", "color", False),
        ("udp4 -p 1", "color", None),
        ("udp4 -p 1 --log-style reference", "log_style", "reference"),
        ("udp4 -p 1 --forget 30", "limits", Limits(forget_silent=30_000)),
        ("udp4 -p 1", "limits", Limits()),
        ("udp4 -p 1", "domain_override", None),
        ("udp4 -p 1 -d", "discovery_port", 7400),
        ("udp4 -p 1", "discovery_port", None),
        ("udp4 -p 1 --ros-args -r __node:=agent -p x:=1", "refs", None),
    ],
)
def test_options_of_the_agent(line: str, field: str, value: object) -> None:
    if value is None and field == "verbose":
        # A bare -v leaves the transport behind it alone; -p then belongs to serial and is refused.
        assert wrong(line).startswith("serial: -p has no meaning for serial")
        return
    assert getattr(parse(line), field) == value


def test_the_space_of_a_middleware() -> None:
    assert parse("udp4 -p 1 -m ced").space == "local:"
    assert parse("udp4 -p 1 -m rtps").space == "dds:"
    assert parse("udp4 -p 1").space == "dds:"


def test_several_links_in_one_command() -> None:
    options = parse("-m ced udp4 -p 8888 serial -D /dev/ttyUSB0 -b 921600 -v 5 udp4 -p 9999 -d")
    assert options.links == (
        LinkOptions(kind="udp4", port=8888),
        LinkOptions(kind="serial", devices=("/dev/ttyUSB0",), baudrate=921600),
        LinkOptions(kind="udp4", port=9999, discovery_port=7400),
    )
    assert (options.middleware, options.verbose, options.discovery_port) == ("ced", 5, 7400)


def test_devices_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "devices"
    path.write_text("/dev/ttyUSB0\n/dev/ttyUSB1\n")
    assert link(f"serial -f {path}").devices == ("/dev/ttyUSB0",)
    assert link(f"multiserial --file {path} -b 57600").devices == ("/dev/ttyUSB0", "/dev/ttyUSB1")


def test_what_has_no_effect_is_noted() -> None:
    options = parse("udp4 -p 1 -P 7401 serial -D /dev/a -fc")
    assert options.notes == (
        "udp4: -P has no effect: agents do not look for each other in this version",
        "serial: -fc has no effect: serial ports are used without flow control in this version",
    )
    assert parse("udp4 -p 1").notes == ()


def test_the_domain_override() -> None:
    assert parse("udp4 -p 1", XRCE_DOMAIN_ID_OVERRIDE="42").domain_override == 42
    assert parse("udp4 -p 1", XRCE_DOMAIN_ID_OVERRIDE="").domain_override is None
    assert wrong("udp4 -p 1", XRCE_DOMAIN_ID_OVERRIDE="x") == "XRCE_DOMAIN_ID_OVERRIDE=x: not a number"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "",
            "no transport: say udp4, udp6, tcp4, tcp6, serial, multiserial, pseudoterminal, canfd, rosserial; for",
        ),
        ("-v 5", "no transport: say"),
        ("rosserial", "rosserial: -D DEV or -f FILE or -p PORT is required"),
        ("rosserial -p 11411 -D /dev/ttyACM0", "rosserial: -p: give either -D DEV or -f FILE or -p PORT"),
        ("upd4 -p 8888", "unknown transport 'upd4' (did you mean udp4?); there are udp4, udp6,"),
        ("warp -p 8888", "unknown transport 'warp'; there are udp4,"),
        ("udp4", "udp4: -p PORT is required"),
        ("udp4 -p", "udp4: -p needs a value: -p PORT"),
        ("udp4 -p -v 6", "udp4: -p needs a value: -p PORT"),
        ("udp4 -p 99999", "udp4: -p 99999: out of range: it must be from 0 to 65535"),
        ("udp4 -p80x", "udp4: -p 80x: not a number"),
        ("udp4 --port=", "udp4: --port : not a number"),
        ("udp4 -p ٣", "udp4: -p ٣: not a number"),
        ("udp4 -p 1 -d 0", "udp4: -d 0: out of range: it must be from 1 to 65535"),
        ("udp4 -p 1 -d here", "udp4: -d here: not a number"),
        ("udp4 -p 1 --prot 2", "unknown option --prot (did you mean --port?); see muros agent --help"),
        ("udp4 -p 1 -x", "unknown option -x; see muros agent --help"),
        ("udp4 -p 1 --no-color=1", "--no-color takes no value, but '--no-color=1' gives it one"),
        (
            "udp4 -p 1 tpc4 -p 2",
            "'tpc4' behind udp4 is neither an option nor a transport (did you mean tcp4?)",
        ),
        ("udp4 8888", "'8888' behind udp4 is neither an option nor a transport"),
        ("-p 8888 udp4", "-p belongs to a link: put it behind udp4, udp6, tcp4, tcp6"),
        (
            "udp4 -p 1 -b 9600",
            "udp4: -b has no meaning for udp4: it belongs to serial, multiserial, pseudoterminal",
        ),
        ("udp4 -p 1 --bind ::1", "udp4: --bind ::1: not an IPv4 address"),
        ("udp4 -p 1 --bind nowhere", "udp4: --bind nowhere: not an IP address"),
        ("serial", "serial: -D DEV or -f FILE is required"),
        ("serial -D /dev/a -f x", "serial: -f: give either -D DEV or -f FILE"),
        ("serial -f /nowhere/x", "serial: -f /nowhere/x: No such file or directory"),
        ("serial -D ''", "serial: -D names no device"),
        ("multiserial -D ' '", "multiserial: -D names no device"),
        (
            "serial -D /dev/a -b 115000",
            "serial: -b 115000: not a baud rate of serial ports (nearest: 57600 and 115200)",
        ),
        ("serial -D /dev/a -b fast", "serial: -b fast: not a number"),
        ("canfd -I 1", "canfd: -D DEV is required"),
        ("canfd -D can0 -I 20000000", "canfd: -I 20000000: out of range: it must be from 0 to 0x1FFFFFFF"),
        ("canfd -D can0 -I xyz", "canfd: -I xyz: not a hexadecimal number"),
        ("udp4 -p 1 -v 7", "-v 7: out of range: it must be from 0 to 6"),
        (
            "udp4 -p 1 --ros-distro jazz",
            "--ros-distro jazz: no ROS 2 distribution (did you mean jazzy?); there are humble, iron, jazzy, kilted, "
            "lyrical, rolling",
        ),
        (
            "udp4 -p 1 -m local --ros-distro jazzy",
            "--ros-distro jazzy has no meaning for -m local: it belongs to dds",
        ),
        (
            "udp4 -p 1 -m dbs",
            "-m dbs: no middleware (did you mean dds?); there are dds, rtps, cyclonedds, local, ced",
        ),
        ("udp4 -p 1 -r", "-r needs a value: -r FILE"),
        ("udp4 -p 1 --forget 0", "--forget 0: out of range: it must be more than 0 seconds"),
        ("udp4 -p 1 --forget nan", "--forget nan: out of range: it must be more than 0 seconds"),
        ("udp4 -p 1 --forget soon", "--forget soon: not a number of seconds"),
        (
            "udp4 -p 1 --log-style murs",
            "--log-style murs: no log style (did you mean muros?); there are muros,",
        ),
        ("--config /nowhere.toml", "/nowhere.toml: no such file or directory"),
    ],
)
def test_wrong_use_is_one_clear_line(line: str, message: str) -> None:
    assert wrong(line).startswith(message)


@pytest.mark.parametrize("line", ["-h", "--help", "udp4 -h", "udp4 -x --help", "-p 99999 -h"])
def test_help_is_asked_for(line: str) -> None:
    assert parse_arguments(shlex.split(line), {}) is None


def test_the_help_names_everything_and_fits_the_terminal() -> None:
    text = help_text()
    for option in OPTIONS:
        for flag in option.flags:
            assert f"{flag}," in text or f"{flag} " in text
    for word in TRANSPORTS:
        assert f"  {word} " in text
    assert max(map(len, text.splitlines())) <= 108


MANUAL = Path(__file__).parents[2] / "docs/agent-command-line.md"


def test_the_manual_names_everything() -> None:
    text = MANUAL.read_text()
    for option in OPTIONS:
        for flag in option.flags:
            assert f"`{flag}`" in text or f"`{flag} " in text
    for word in TRANSPORTS:
        assert f"`{word}`" in text


def test_the_example_of_the_manual_works(tmp_path: Path) -> None:
    example = MANUAL.read_text().partition("```toml\n")[2].partition("```")[0]
    options = parse(f"--config {config(tmp_path, example)}")
    assert [link.kind for link in options.links] == ["udp4", "multiserial"]
    assert options.links[1].devices == ("/dev/ttyUSB0", "/dev/ttyACM0")
    assert options.refs == tmp_path / "profiles.refs"


CONFIG = """\
verbose = 5
middleware = "ced"
refs = "profiles/agent.refs"
forget = 30
no-color = true

[[link]]
kind = "udp4"
port = 8888
bind = "127.0.0.1"
discovery = true

[[link]]
kind = "multiserial"
devices = ["/dev/a", "/dev/b"]
baudrate = 921600

[[link]]
kind = "canfd"
device = "can0"
id = 0x10

[limits]
max_clients = 20
stop-at-failure = true
"""


def config(folder: Path, text: str) -> Path:
    path = folder / "agent.toml"
    path.write_text(text)
    return path


def test_a_configuration_file(tmp_path: Path) -> None:
    options = parse(f"--config {config(tmp_path, CONFIG)}")
    assert options == AgentOptions(
        links=(
            LinkOptions(kind="udp4", port=8888, bind="127.0.0.1", discovery_port=7400),
            LinkOptions(kind="multiserial", devices=("/dev/a", "/dev/b"), baudrate=921600),
            LinkOptions(kind="canfd", devices=("can0",), can_id=0x10),
        ),
        middleware="ced",
        refs=tmp_path / "profiles/agent.refs",
        verbose=5,
        color=False,
        limits=Limits(forget_silent=30_000, max_clients=20, stop_at_failure=True),
    )


def test_the_command_line_has_the_last_word(tmp_path: Path) -> None:
    path = config(tmp_path, 'verbose = 5\nrefs = "/a"\n[[link]]\nkind = "udp4"\nport = 1\ndiscovery = false')
    options = parse(f"tcp4 -p 2 -v 6 --config {path}")
    assert options.links == (LinkOptions(kind="udp4", port=1), LinkOptions(kind="tcp4", port=2))
    assert (options.verbose, options.refs) == (6, Path("/a"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("verbose = ", ": not TOML: Invalid value (at "),
        ("verbos = 5", ":1: verbos: unknown key (did you mean verbose?); there are middleware,"),
        ("\nverbose = 9", ":2: verbose = 9: out of range: it must be from 0 to 6"),
        ("verbose = true", ":1: verbose: a single value is needed"),
        ("verbose = [1]", ":1: verbose: a single value is needed"),
        ("no-color = 1", ":1: no-color: true or false is needed"),
        ("port = 8888", ":1: port: unknown key"),
        ("config = 'x'", ":1: config: unknown key"),
        ("link = 3", ":1: link: write each link as a [[link]] table"),
        ("[[link]]\nport = 1", ":1: kind: missing; there are udp4,"),
        ("[[link]]\nport = 1\nkind = 'upd4'", ":3: kind: 'upd4' (did you mean udp4?); there are udp4,"),
        ("[[link]]\nkind = 'udp4'\nprot = 1", ":3: prot: unknown key (did you mean port?); there are port,"),
        (
            "[[link]]\nkind = 'udp4'\nport = 1\n[[ link ]]\nkind='udp6'\nport='x'",
            ":6: port = x: not a number",
        ),
        ("[[link]]\nkind = 'udp4'\nport = 1\nbaudrate = 9600", ":4: baudrate has no meaning for udp4"),
        ("[[link]]\nkind = 'udp4'", ": link 1, udp4: -p PORT is required"),
        (
            "[[link]]\nkind = 'serial'\ndevices = ['a', 'b']",
            ":3: devices: a serial link has one device: use multiserial",
        ),
        ("[[link]]\nkind = 'udp4'\nport = 1\nbind = '::1'", ":4: bind ::1: not an IPv4 address"),
        (
            "[[link]]\nkind = 'tcp4'\nport = 1\nconnections = 0",
            ":4: connections = 0: out of range: it must be",
        ),
        ("limits = 3", ":1: limits: write limits as a [limits] table"),
        (
            "[[link]]\nkind = 'udp4'\nport = 1\n[limits]\nwindow = 4\nmax_cliens = 1",
            ":6: [limits] max_cliens: unknown limit (did you mean max_clients?); there are window,",
        ),
        ("[limits]\nmax-clients = 'a'", ":2: [limits] max-clients: a number is needed"),
        ("[limits]\nwindow = 4\nmax-clients = 0", ":3: [limits] max_clients is 0: it must be at least 1"),
        ("limits.window = 3", ": [limits] window is 3: it must be 1, 2, 4, 8 or 16 messages"),
    ],
)
def test_a_wrong_configuration_file_is_one_line_with_its_place(
    tmp_path: Path, text: str, message: str
) -> None:
    path = config(tmp_path, text)
    assert wrong(f"--config {path}").startswith(f"{path}{message}")


def test_a_configuration_file_that_is_not_text(tmp_path: Path) -> None:
    path = tmp_path / "agent.toml"
    path.write_bytes(b"\xff\xfe")
    assert wrong(f"--config {path}") == f"{path}: not UTF-8"


words = st.sampled_from(
    [*TRANSPORTS, *(flag for option in OPTIONS for flag in option.flags), "8888", "/dev/x"]
)


@given(st.lists(words | st.text(max_size=8), max_size=8))
def test_any_words_are_options_help_or_one_clear_line(line: list[str]) -> None:
    try:
        options = parse_arguments(line, {})
    except UsageError as error:
        assert str(error)  # noqa: PT017
        return
    assert options is None or options.links
