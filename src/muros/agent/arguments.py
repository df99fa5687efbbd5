"""The command line of the agent: what it was told to do, as values.

`muros agent` takes what the reference agent takes, word for word, so that scripts keep working; the differences
are that wrong use is an error (one line, nothing started), and that one command may open several links: a
transport word begins a link and the options behind it belong to it, while the agent's own options stand anywhere.
A TOML file (`--config`) can say the same with the long names of the options.

The help text and the keys of the file come from the same tables as the parser, in `_options`.
"""

import ipaddress
import os
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final

from muros.agent._limits import Limits
from muros.agent._options import (
    BAUDRATE,
    BY_FLAG,
    BY_KEY,
    CONNECTIONS,
    DISCOVERY_PORT,
    IP_TRANSPORTS,
    MIDDLEWARE,
    MIDDLEWARES,
    NO_EFFECT,
    OPTIONS,
    ROSSERIAL_BAUDRATE,
    TRANSPORTS,
    VERBOSE,
    Option,
    Value,
    guess,
    integer,
)
from muros.links import LinkError, devices_from_file

DEFAULT_LIMITS: Final = Limits()

DOMAIN_OVERRIDE: Final = "XRCE_DOMAIN_ID_OVERRIDE"
"""Environment variable: the domain of clients that ask for domain 255."""


class UsageError(Exception):
    """The command line or configuration file is wrong. The message is one line: what, where, what to do."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkOptions:
    """One link to open. What a kind of link does not use keeps its default."""

    kind: str
    port: int = 0
    """UDP and TCP: the port to listen on; 0 is any free one."""
    bind: str | None = None
    """UDP and TCP: the address to listen on; None is every one."""
    discovery_port: int | None = None
    """UDP and TCP: answer clients that look for an agent on this port; None: do not."""
    connections: int = CONNECTIONS
    """TCP: connections that are held at the same time."""
    devices: tuple[str, ...] = ()
    """Serial ports, the CAN interface, or the symbolic link to the far end of a pseudoterminal."""
    baudrate: int = BAUDRATE
    can_id: int = 1

    @property
    def family(self) -> int:
        """The IP version of a UDP or TCP link, 4 or 6."""
        return 6 if self.kind.endswith("6") else 4


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentOptions:
    """Everything the agent was told."""

    links: tuple[LinkOptions, ...]
    middleware: str = MIDDLEWARE
    ros_distro: str | None = None
    """The ROS 2 distribution around us; None: seen from what comes."""
    refs: Path | None = None
    refs_optional: bool = False
    """Go on without profiles when the profiles file cannot be used."""
    verbose: int = VERBOSE
    """0 nothing, 1 critical, 2 errors, 3 warnings, 4 clients come and go, 5 each message's length, 6 its bytes."""
    color: bool | None = None
    """None: if the output is a terminal."""
    log_style: str = "muros"
    limits: Limits = DEFAULT_LIMITS
    """The limits of the agent, with what was said about them."""
    domain_override: int | None = None
    """The domain of clients that ask for domain 255; None: that of the space."""
    notes: tuple[str, ...] = ()
    """What was understood but does nothing in this version, one line each."""

    @property
    def space(self) -> str:
        """The space the middleware stands for, as a URL."""
        return MIDDLEWARES[self.middleware].space

    @property
    def discovery_port(self) -> int | None:
        """The first discovery port that a link asks for, if any."""
        return next((link.discovery_port for link in self.links if link.discovery_port), None)


def parse_arguments(argv: Sequence[str], environ: Mapping[str, str] = os.environ) -> AgentOptions | None:
    """Read the words behind `muros agent`; None: help was asked for.

    Reads the configuration file and device files that are named. Words from `--ros-args` on belong to ROS and are
    passed over. Raises UsageError.
    """
    words = list(argv)
    if "--ros-args" in words:
        del words[words.index("--ros-args") :]
    if any(word in BY_KEY["help"].flags for word in words):
        return None
    given = _Given()
    _read_words(words, given)
    if "config" in given.agent:
        _read_config(Path(str(given.agent.pop("config"))), given)
    return _options(given, environ)


def help_text() -> str:
    """What `muros agent --help` prints."""
    lines = [
        "usage: muros agent TRANSPORT [OPTIONS] [TRANSPORT [OPTIONS] ...]",
        "",
        "Connects DDS-XRCE clients, such as boards that speak micro-ROS, with each other and with this computer.",
        "",
        "  muros agent udp4 -p 8888",
        "  muros agent udp4 -p 8888 serial -D /dev/ttyUSB0 -b 921600",
        "",
        "transports:",
        *(f"  {word:<16}{transport.about}" for word, transport in TRANSPORTS.items()),
        "",
    ]
    groups = (
        ("options of udp and tcp, behind the transport:", _listens),
        (
            "options of serial and CAN, behind the transport:",
            lambda o: o.transports and not _listens(o),
        ),
        ("options of the agent, anywhere:", lambda o: not o.transports),
    )
    for title, belongs in groups:
        lines.append(title)
        for option in OPTIONS:
            if belongs(option):
                lines.append(f"  {', '.join(option.flags) + ' ' + option.value:<30}{option.about}".rstrip())
        lines.append("")
    lines.append(f"environment: {DOMAIN_OVERRIDE}=N takes clients that ask for domain 255 into domain N.")
    lines.append(
        "With -m dds those of ROS 2 hold: ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE, ROS_STATIC_PEERS."
    )
    return "\n".join(lines)


def _listens(option: Option) -> bool:
    return bool(option.transports & IP_TRANSPORTS)


@dataclass(slots=True)
class _Place:
    """Where options were given, for messages: the link they belong to, its values, and how to name a key."""

    kind: str
    values: dict[str, Value] = field(default_factory=dict)
    said: dict[str, str] = field(default_factory=dict)
    """By key, how the user wrote it: transport and flag, or file, line and key."""
    where: str = ""


@dataclass(slots=True)
class _Given:
    """What was given so far."""

    links: list[_Place] = field(default_factory=list)
    agent: dict[str, Value] = field(default_factory=dict)
    limits: Limits = DEFAULT_LIMITS


def _read_words(words: list[str], given: _Given) -> None:
    at = 0
    while at < len(words):
        word = words[at]
        at += 1
        if not word.startswith("-") or word == "-":
            if word not in TRANSPORTS:
                raise UsageError(_stray(word, given))
            given.links.append(_Place(word, where=f"{word}: "))
            continue
        flag, option, attached = _match(word)
        if option.transports:
            if not given.links:
                raise UsageError(f"{flag} belongs to a link: put it behind {_kinds(option)}")
            flag = f"{given.links[-1].where}{flag}"
        value: Value
        if not option.value:
            value = True
        elif attached is not None:
            value = _value(option, flag, attached)
        elif at < len(words) and _is_value(option, words[at]):
            value = _value(option, flag, words[at])
            at += 1
        elif option.bare is not None:
            value = option.bare
        else:
            raise UsageError(f"{flag} needs a value: {option.flags[0]} {option.value}")
        if not option.transports:
            given.agent[option.key] = value
        else:
            _set(given.links[-1], option, value, flag)


def _match(word: str) -> tuple[str, Option, str | None]:
    """The flag, its option, and the value written into the same word, if any."""
    if word in BY_FLAG:
        return word, BY_FLAG[word], None
    flag, equals, attached = word.partition("=")
    if not word.startswith("--"):
        flag, attached = word[:2], word[2:]
    option = BY_FLAG.get(flag)
    if option is None or (word.startswith("--") and not equals):
        raise UsageError(f"unknown option {word}{guess(word, list(BY_FLAG))}; see muros agent --help")
    if not option.value:
        raise UsageError(f"{flag} takes no value, but {word!r} gives it one")
    return flag, option, attached


def _is_value(option: Option, word: str) -> bool:
    """Whether the word behind an option is its value; one that need not have any leaves transports alone."""
    if word.startswith("-") and word != "-":
        return False
    return option.bare is None or word not in TRANSPORTS


def _value(option: Option, said: str, text: str) -> Value:
    try:
        return option.read(text)
    except ValueError as error:
        raise UsageError(f"{said} {text}: {error}") from None


def _set(place: _Place, option: Option, value: Value, said: str) -> None:
    if place.kind not in option.transports:
        raise UsageError(f"{said} has no meaning for {place.kind}: it belongs to {_kinds(option)}")
    place.values[option.key] = value
    place.said[option.key] = said


def _stray(word: str, given: _Given) -> str:
    if not given.links:
        return f"unknown transport {word!r}{guess(word, list(TRANSPORTS))}; there are {', '.join(TRANSPORTS)}"
    behind = given.links[-1].kind
    return f"{word!r} behind {behind} is neither an option nor a transport{guess(word, list(TRANSPORTS))}"


def _kinds(option: Option) -> str:
    return ", ".join(kind for kind in TRANSPORTS if kind in option.transports)


def _options(given: _Given, environ: Mapping[str, str]) -> AgentOptions:
    if not given.links:
        raise UsageError(f"no transport: say {', '.join(TRANSPORTS)}; for example: muros agent udp4 -p 8888")
    agent: dict[str, Any] = dict(given.agent)
    middleware = agent.get("middleware", MIDDLEWARE)
    distro = agent.get("ros-distro")
    if distro is not None and not MIDDLEWARES[middleware].space.startswith("dds"):
        raise UsageError(f"--ros-distro {distro} has no meaning for -m {middleware}: it belongs to dds")
    return AgentOptions(
        links=tuple(map(_link, given.links)),
        middleware=middleware,
        ros_distro=distro,
        refs=agent.get("refs"),
        refs_optional=agent.get("refs-optional", False),
        verbose=agent.get("verbose", VERBOSE),
        color=False if agent.get("no-color") else None,
        log_style=agent.get("log-style", "muros"),
        limits=_limits(given),
        domain_override=_domain_override(environ),
        notes=tuple(
            f"{place.said[key]} has no effect: {why}"
            for place in given.links
            for key, why in NO_EFFECT.items()
            if place.values.get(key)
        ),
    )


def _link(place: _Place) -> LinkOptions:
    values: dict[str, Any] = place.values
    for group in TRANSPORTS[place.kind].needs:
        found = [key for key in group if key in values]
        flags = [f"{BY_KEY[key].flags[0]} {BY_KEY[key].value}" for key in group]
        if not found:
            raise UsageError(f"{place.where}{' or '.join(flags)} is required")
        if len(found) > 1:
            raise UsageError(f"{place.said[found[1]]}: give either {' or '.join(flags)}")
    options = LinkOptions(
        kind=place.kind,
        port=values.get("port", 0),
        bind=values.get("bind"),
        discovery_port=values.get("discovery") or None,
        connections=values.get("connections", CONNECTIONS),
        devices=_devices(place),
        baudrate=values.get("baudrate", ROSSERIAL_BAUDRATE if place.kind == "rosserial" else BAUDRATE),
        can_id=values.get("id", 1),
    )
    if options.bind and ipaddress.ip_address(options.bind).version != options.family:
        raise UsageError(f"{place.said['bind']} {options.bind}: not an IPv{options.family} address")
    return options


def _devices(place: _Place) -> tuple[str, ...]:
    several = place.kind in ("multiserial", "rosserial")
    if "file" in place.values:
        try:
            return tuple(devices_from_file(str(place.values["file"]), several=several))
        except LinkError as error:
            raise UsageError(f"{place.said['file']} {error}") from None
    device = str(place.values.get("device", ""))
    devices = tuple(device.split()) if several else (device,) if device else ()
    if not devices and "device" in place.values:
        raise UsageError(f"{place.said['device']} names no device")
    return devices


def _domain_override(environ: Mapping[str, str]) -> int | None:
    text = environ.get(DOMAIN_OVERRIDE)
    if not text:
        return None
    try:
        return integer(0, 254)(text)
    except ValueError as error:
        raise UsageError(f"{DOMAIN_OVERRIDE}={text}: {error}") from None


def _read_config(path: Path, given: _Given) -> None:
    """Add what a configuration file says; the command line has the last word, its links come behind."""
    try:
        text = path.read_text(encoding="utf-8")
        document = tomllib.loads(text)
    except OSError as error:
        raise UsageError(f"{path}: {(error.strerror or str(error)).lower()}") from None
    except UnicodeDecodeError:
        raise UsageError(f"{path}: not UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{path}: not TOML: {error}") from None
    except RecursionError:
        raise UsageError(f"{path}: nested too deeply") from None
    given.limits = _read_limits(document.pop("limits", {}), path, text)
    links: list[_Place] = []
    tables = document.pop("link", [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise UsageError(f"{_said(path, text, -1, 'link')}: write each link as a [[link]] table")
    for number, table in enumerate(tables):
        kind = table.pop("kind", None)
        said = _said(path, text, number, "kind")
        if not isinstance(kind, str) or kind not in TRANSPORTS:
            what = "missing" if kind is None else f"{kind!r}{guess(str(kind), list(TRANSPORTS))}"
            raise UsageError(f"{said}: {what}; there are {', '.join(TRANSPORTS)}")
        place = _Place(kind, where=f"{path}: link {number + 1}, {kind}: ")
        for key, value in table.items():
            said = _said(path, text, number, key)
            option = _config_option(key, said, lambda option: bool(option.transports))
            if kind != "multiserial" and isinstance(value, list) and len(value) > 1:
                raise UsageError(f"{said}: a {kind} link has one device: use multiserial")
            _set(place, option, _config_value(option, value, said), said)
        links.append(place)
    given.links[:0] = links
    for key, value in document.items():
        said = _said(path, text, -1, key)
        option = _config_option(key, said, lambda option: not option.transports)
        if option.key not in given.agent:
            read = _config_value(option, value, said)
            given.agent[option.key] = path.parent / str(read) if option.key == "refs" else read


def _read_limits(table: object, path: Path, text: str) -> Limits:
    """The table [limits] of a configuration file: fields of `Limits` by name."""
    if not isinstance(table, dict):
        raise UsageError(f"{_said(path, text, -1, 'limits')}: write limits as a [limits] table")
    known = {each.name: each for each in fields(Limits)}
    read: dict[str, Any] = {}
    for key, value in table.items():
        name = key.replace("-", "_")
        said = f"{_where(path, text, 'limits', key)}: [limits] {key}"
        if name not in known:
            raise UsageError(f"{said}: unknown limit{guess(name, list(known))}; there are {', '.join(known)}")
        if not isinstance(value, bool if isinstance(known[name].default, bool) else int):
            raise UsageError(
                f"{said}: {'true or false' if isinstance(known[name].default, bool) else 'a number'} is needed"
            )
        read[name] = value
    try:
        return Limits(**read)
    except ValueError as error:
        name = str(error).partition(" ")[0]
        raise UsageError(f"{_where(path, text, 'limits', name)}: [limits] {error}") from None


def _limits(given: _Given) -> Limits:
    forget = given.agent.get("forget")
    if forget is None:
        return given.limits
    return replace(given.limits, forget_silent=round(float(str(forget)) * 1000))


def _config_option(key: str, said: str, belongs: Callable[[Option], bool]) -> Option:
    """The option a key names: the long name, with `_` as good as `-`; `devices` as good as `device`."""
    name = {"devices": "device", "dev": "device", "devs": "device"}.get(key, key.replace("_", "-"))
    known = [option.key for option in OPTIONS if belongs(option) and option.key not in ("config", "help")]
    if name not in known:
        raise UsageError(f"{said}: unknown key{guess(name, known)}; there are {', '.join(known)}")
    return BY_KEY[name]


def _config_value(option: Option, value: object, said: str) -> Value:
    """A value of the file, read as the command line would read it."""
    if isinstance(value, bool) and (not option.value or option.key == "discovery"):
        return DISCOVERY_PORT if value and option.value else value
    if isinstance(value, list) and option.key == "device" and all(isinstance(each, str) for each in value):
        return " ".join(value)
    if not option.value or isinstance(value, bool) or not isinstance(value, str | int | float):
        raise UsageError(f"{said}: {'a single value' if option.value else 'true or false'} is needed")
    text = f"{value:x}" if option.key == "id" and isinstance(value, int) else str(value)
    return _value(option, f"{said} =", text)


def _said(path: Path, text: str, link: int, key: str) -> str:
    """File, line and key of a setting; `link` counts the [[link]] tables from 0, -1 is before them."""
    return f"{_where(path, text, link, key)}: {key}"


def _where(path: Path, text: str, table: int | str, key: str) -> str:
    """File and line of a key, or of the head of its table; `table` as for `_said`, or "limits"."""
    here: int | str = -1
    links = header = 0
    for number, line in enumerate(text.splitlines(), 1):
        bare = "".join(line.split())
        if bare.startswith(("[[link]]", "[limits]")):
            here = "limits" if bare.startswith("[limits]") else links
            links += here == links
            header = number if table == here else header
        elif here == table and bare.partition("=")[0].strip("\"'").replace("-", "_") == key.replace("-", "_"):
            return f"{path}:{number}"
    return f"{path}:{header}" if header else f"{path}"
