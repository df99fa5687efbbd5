"""The words of `muros rosserial`: what it was told to do, as values; those of the ROS 1 servers are understood, too."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from muros.cli._log import INFO
from muros.rclc.host import parameter_files
from muros.rosserial.server import BAUD, NODE_NAME, TCP_PORT, flat

__all__ = ["Options", "WrongUseError", "parameters_of", "parse", "take_settings"]

DEVICE: Final = "/dev/ttyUSB0"
"""The port of the ROS 1 servers when nothing else is said."""

EPILOG: Final = """\
examples:
  muros rosserial -D /dev/ttyACM0 -b 57600        one board
  muros rosserial -D '/dev/ttyACM*' -b auto       whatever is plugged in, at any rate
  muros rosserial --tcp                           boards that dial in, on port 11411
  muros rosserial /dev/ttyUSB0 _baud:=115200      as with rosserial_python
"""

_REMAP: Final = re.compile(r"([^:=]+):=(.*)")
_NOTHING: Final = "name a port, such as -D /dev/ttyACM0, or --tcp"


class WrongUseError(Exception):
    """The command line is wrong: one line that says what to write."""


@dataclass(slots=True)
class Options:
    """What the command was told."""

    devices: list[str] = field(default_factory=list)
    baud: int | None = BAUD
    """None: to be found out."""
    baud_given: bool = False
    tcp: list[int] = field(default_factory=list)
    tcp_open: bool = False
    """The first of ``tcp`` was not said, only that it shall be TCP."""
    host: str | None = None
    name: str | None = None
    namespace: str = ""
    space: str = "dds:"
    domain: int | None = None
    remap: dict[str, str] = field(default_factory=dict)
    parameter_files: list[str] = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)
    types: list[str] = field(default_factory=list)
    ros1: str | None = None
    """Address of a ROS 1 master, empty for `$ROS_MASTER_URI`; None: no ROS 1."""
    verbose: int = INFO


def parse(argv: Sequence[str]) -> Options:
    """The options in the words of a command line. Raises WrongUseError; `--help` and wrong options raise SystemExit."""
    parser = argparse.ArgumentParser(
        prog="muros rosserial",
        description="Connect boards with rosserial firmware to the ROS 2 graph.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("words", nargs="*", metavar="PORT | tcp | NAME:=VALUE", help="as the ROS 1 servers are called")
    add(
        "-D",
        "--dev",
        action="append",
        default=[],
        metavar="DEV",
        help="a serial port or pattern; may be repeated",
    )
    add("-b", "--baud", default=None, metavar="N", help=f"bits per second, or 'auto' (default: {BAUD})")
    add(
        "--tcp",
        action="append",
        nargs="?",
        type=int,
        const=TCP_PORT,
        default=[],
        metavar="PORT",
        help=f"boards dial in here (default: {TCP_PORT})",
    )
    add("--bind", metavar="HOST", help="address of this host for --tcp (default: every one)")
    add(
        "--name",
        metavar="NAME",
        help=f"the board's node (default: {NODE_NAME[1:]}, with several boards and its line)",
    )
    add("--namespace", default="", metavar="NS", help="namespace of the nodes")
    add(
        "--remap", action="append", default=[], metavar="OLD:=NEW", help="another name for a topic or service"
    )
    add("--params-file", action="append", default=[], metavar="FILE", help="parameters of the boards, YAML")
    add(
        "--types",
        action="append",
        default=[],
        metavar="FOLDER",
        help="packages with .msg and .srv of your own",
    )
    add(
        "--ros1",
        nargs="?",
        const="",
        metavar="URI",
        help="join a ROS 1 graph, too, by its master (default: $ROS_MASTER_URI)",
    )
    add(
        "--space",
        default="dds:",
        metavar="URL",
        help="the data space: dds: (default), dds:42, cyclonedds:, none",
    )
    add("-d", "--domain", type=int, metavar="N", help="DDS domain (default: $ROS_DOMAIN_ID or 0)")
    add(
        "-v",
        "--verbose",
        type=int,
        default=INFO,
        metavar="0-6",
        help="4 info (default), 5 also each read and write",
    )
    parsed = parser.parse_args(list(argv))
    options = Options(
        devices=list(parsed.dev),
        baud=_baud(parsed.baud or str(BAUD)),
        baud_given=parsed.baud is not None,
        tcp=list(parsed.tcp),
        host=parsed.bind,
        name=parsed.name,
        namespace=parsed.namespace,
        space=parsed.space,
        domain=parsed.domain,
        parameter_files=list(parsed.params_file),
        types=list(parsed.types),
        ros1=parsed.ros1,
        verbose=parsed.verbose,
    )
    for word in parsed.remap:
        match = _REMAP.fullmatch(word)
        if match is None:
            raise WrongUseError(f"--remap {word}: write OLD:=NEW")
        options.remap[match[1]] = match[2]
    words = list(parsed.words)
    if options.ros1 and "://" not in options.ros1:  # it was the next word, and no address
        words.insert(0, options.ros1)
        options.ros1 = ""
    _classic(words, options)
    if not options.devices and not options.tcp and options.ros1 is None:
        raise WrongUseError(_NOTHING)
    if options.space == "none" and options.ros1 is None:
        raise WrongUseError("--space none leaves the boards nowhere to be: add --ros1")
    for port in options.tcp:
        if not 0 <= port <= 65535:
            raise WrongUseError(f"--tcp {port}: a port is from 0 to 65535")
    return options


def parameters_of(options: Options) -> Callable[[str], Mapping[str, Any]]:
    """The first parameters of each board's node: from files of ROS 2, or of ROS 1, which name no node."""
    import yaml

    trees: list[tuple[str, str, Any]] = []
    for file in options.parameter_files:
        try:
            with open(file, encoding="utf-8") as stream:
                text = stream.read()
            trees.append((file, text, yaml.safe_load(text)))
        except (OSError, UnicodeDecodeError) as error:
            raise WrongUseError(f"{file}: {getattr(error, 'strerror', None) or error}") from None
        except yaml.YAMLError as error:
            raise WrongUseError(f"{file} is no YAML: {' '.join(str(error).split())}") from None
        if not isinstance(trees[-1][2], dict):
            raise WrongUseError(f"{file} is no file of parameters: it names none")

    def of(node: str) -> Mapping[str, Any]:
        found: dict[str, Any] = {}
        for file, text, tree in trees:
            if "ros__parameters" in text:
                for key, values in parameter_files.by_node(text, file):
                    if parameter_files.matches(key, node):
                        found.update(values)
            else:
                own = tree.get(node.strip("/"), tree)
                found.update(flat(own if isinstance(own, dict) else tree))
        return {**found, **options.parameters}

    of(NODE_NAME)  # says now what is wrong with a file
    return of


def take_settings(options: Options, setting: Callable[[str], Any]) -> None:
    """What the command line leaves open is in the parameters of the node at a ROS 1 master: port, baud, tcp_port.

    ``setting`` knows the node's own, and those of the graph by names with a slash in front.
    """
    baud = setting("baud")
    if baud is not None and not options.baud_given:
        options.baud = _baud(str(baud))
    if not options.devices and not options.tcp:
        port = str(setting("port") or DEVICE)
        if port != "tcp":
            options.devices.append(port)
            return
        options.tcp.append(TCP_PORT)
        options.tcp_open = True
    if options.tcp_open:
        for name in ("tcp_port", "/rosserial_embeddedlinux/tcp_port"):
            if (tcp_port := setting(name)) is not None:
                options.tcp[0] = _port(str(tcp_port))
                break


def _classic(words: Sequence[str], options: Options) -> None:
    """The words of the ROS 1 servers: a port, or `tcp` and its port; `_parameter:=`, `__name:=` and `old:=new`."""
    plain = []
    tcp_port: int | None = None
    for word in words:
        match = _REMAP.fullmatch(word)
        if match is None:
            plain.append(word)
            continue
        key, value = match[1], match[2]
        if key == "__name":
            options.name = value
        elif key == "__ns":
            options.namespace = value
        elif key == "_port":
            plain.insert(0, value)
        elif key == "_baud":
            options.baud, options.baud_given = _baud(value), True
        elif key == "_tcp_port":
            tcp_port = _port(value)
        elif key.startswith("__"):
            continue  # for the launcher of ROS 1
        elif key.startswith("_"):
            import yaml

            options.parameters[key[1:].replace("/", ".")] = yaml.safe_load(value)
        else:
            options.remap[key] = value
    if plain and plain[0] == "tcp":
        said = _port(plain[1]) if len(plain) > 1 else tcp_port
        options.tcp.insert(0, TCP_PORT if said is None else said)
        options.tcp_open = said is None
        plain = plain[2:]
    elif plain and os.path.sep in plain[0]:
        options.devices.append(plain.pop(0))
    if plain:
        raise WrongUseError(f"{plain[0]!r} is no port: {_NOTHING}")


def _baud(word: str) -> int | None:
    if word == "auto":
        return None
    if word.isascii() and word.isdigit() and int(word):
        return int(word)
    raise WrongUseError(f"{word!r} is no rate: write a number such as {BAUD}, or auto")


def _port(word: str) -> int:
    if word.isascii() and word.isdigit() and int(word) <= 65535:
        return int(word)
    raise WrongUseError(f"{word!r} is no TCP port: write a number such as {TCP_PORT}")
