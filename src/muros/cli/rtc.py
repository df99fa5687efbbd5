"""The command `muros rtc`: run RT components, start their name service, begin a new component."""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from muros.cli._rtc import MISSING, fail, has_extra

if TYPE_CHECKING:
    from muros.cli._rtc_new import Wishes

FAILED: Final = 1
WRONG_USE: Final = 2

HELP: Final = """\
usage: muros rtc COMMAND ...

RT components, compatible with OpenRTM-aist.

commands:
  run FILE...   make a component of each kind in the files and run them
  new NAME      write a new component, its RTC.xml and a test
  profile FILE  print the RTC.xml of a component
  names         start a name service on this machine

muros rtc COMMAND --help says more.
"""

RUN_HELP: Final = """\
usage: muros rtc run FILE... [-h] [-a] [-d] [-f FILE] [-i] [-o KEY:VALUE] [-p PORT]

Make one component of each kind that the files hold and run them until Ctrl-C, or until the last has ended.

options:
"""


def run(argv: Sequence[str]) -> int:
    """The command with the words behind its name; returns the exit status."""
    word, rest = (argv[0], argv[1:]) if argv else ("", [])
    commands = {"run": _run, "new": _new, "profile": _profile, "names": _names}
    if word in ("-h", "--help"):
        print(HELP, end="")
        return 0
    if word not in commands:
        there = ", ".join(commands)
        fail(f"unknown command {word!r}: there are {there}" if word else f"muros rtc what? There are {there}")
        return WRONG_USE
    if not has_extra():
        return MISSING
    return commands[word](rest)


def _run(argv: Sequence[str]) -> int:
    from muros.rtc.manager import OPTIONS_HELP, serve_files

    if "-h" in argv or "--help" in argv:
        print(RUN_HELP + OPTIONS_HELP)
        return 0
    return serve_files(argv)


def _names(argv: Sequence[str]) -> int:
    parser = argparse.ArgumentParser("muros rtc names", description="Start a name service for RT components.")
    parser.add_argument("-p", "--port", type=_port, default=2809, help="TCP port (default: 2809)")
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on (default: 127.0.0.1)")
    parser.add_argument("--folder", help="where it keeps its names (default: the user's state folder)")
    arguments = parser.parse_args(argv)
    from muros.rtc.codes import RtcError
    from muros.rtc.corba._name_server import start_name_server

    address = f"{arguments.host}:{arguments.port}"
    if _answers(address):
        print(f"a name service runs at {address} already")
        return 0
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    try:
        with start_name_server(arguments.port, host=arguments.host, folder=arguments.folder) as server:
            print(f"name service at {server.address}, pid {server.pid}; Ctrl-C ends it", flush=True)
            with contextlib.suppress(KeyboardInterrupt):
                status = server.process.wait()
                fail(f"the name service has ended by itself (status {status}); its words are in {server.log}")
                return FAILED
    except RtcError as error:
        fail(error)
        return FAILED
    except KeyboardInterrupt:
        pass
    return 0


def _answers(address: str) -> bool:
    """Whether a name service is there already."""
    from muros.rtc.codes import RtcError
    from muros.rtc.corba import start_orb
    from muros.rtc.corba._naming import NameServer

    try:
        orb = start_orb("127.0.0.1:", connect_timeout=1.0, call_timeout=2.0)
        try:
            return NameServer(orb, address).is_there()
        finally:
            orb.shutdown()
    except RtcError:
        return False


def _new(argv: Sequence[str]) -> int:
    from muros.cli._rtc_new import wishes_of, write_component
    from muros.rtc.codes import RtcError

    arguments = _new_parser().parse_args(argv)
    try:
        wishes: Wishes = wishes_of(arguments)
        files = write_component(wishes, Path(arguments.folder or wishes.profile.name), force=arguments.force)
    except RtcError as error:
        fail(error)
        return WRONG_USE
    except OSError as error:
        fail(f"{error.filename}: {error.strerror}")
        return FAILED
    for file in files:
        print(file)
    print(f"run it with: muros rtc run {files[0]}", file=sys.stderr)
    return 0


def _profile(argv: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        "muros rtc profile",
        description="Print the RTC.xml of a component, in the style of muros or of OpenRTM-aist. It is made for that, "
        "where nobody sees it, and ended.",
    )
    parser.add_argument("file", metavar="FILE", help="the component's file")
    parser.add_argument("--kind", metavar="NAME", help="which one, where there are several in the file")
    arguments = parser.parse_args(argv)
    from muros.rtc.codes import RtcError
    from muros.rtc.manager.testing import running_manager
    from muros.rtc.profile_xml import profile_of, write_profile

    try:
        with running_manager() as manager:
            module = manager.load_file(Path(arguments.file))
            kinds = [factory.name for factory in manager.factories_of(module)]
            kind = arguments.kind or kinds[0]
            if kind not in kinds or (len(kinds) > 1 and not arguments.kind):
                raise RtcError(f"{arguments.file} has {', '.join(kinds)}; choose one with --kind")
            text = write_profile(profile_of(manager.create_component(kind)))
    except RtcError as error:
        fail(error)
        return FAILED
    print(text, end="")
    return 0


def _new_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "muros rtc new",
        description="Write a new component, its profile RTC.xml and a test into a folder of its name.",
        epilog="Data types are those of RTC (TimedLong, TimedDoubleSeq, ...) or of an IDL file (My::Type, with --idl).",
    )
    add = parser.add_argument
    add("name", nargs="?", metavar="NAME", help="the component's name, which is its class's")
    add("--profile", metavar="RTC.xml", help="take everything from a profile that an editor has written")
    add("--inport", action="append", default=[], metavar="NAME:TYPE", help="a port that values come in by")
    add("--outport", action="append", default=[], metavar="NAME:TYPE", help="a port that values go out by")
    add(
        "--config",
        action="append",
        default=[],
        metavar="NAME:TYPE:DEFAULT[:CONSTRAINT[:WIDGET]]",
        help="a parameter: int, double, string, bool, vector<double>, ...; such as gain:double:1.0:0<=x<=10:slider.0.1",
    )
    for what, verb in (("service", "provided"), ("consumer", "required")):
        add(
            f"--{what}",
            action="append",
            default=[],
            metavar="PORT:INSTANCE:TYPE",
            help=f"an interface that is {verb}",
        )
        add(
            f"--{what}-idl",
            action="append",
            default=[],
            metavar="FILE",
            help=f"the IDL file of the --{what} of the same place (one for all: give it once)",
        )
    add("--idl", action="append", default=[], metavar="FILE", help="an IDL file of data types")
    add("--description", default="", help="one line about it")
    add("--version", default="1.0.0", help="its version (default: 1.0.0)")
    add("--vendor", default="", help="who makes it")
    add("--category", default="Category", help="its category (default: Category)")
    add(
        "--max-instances",
        type=_count,
        default=0,
        metavar="N",
        help="how many there may be (default: 0, any number)",
    )
    add(
        "--rate",
        type=float,
        default=1000.0,
        metavar="HZ",
        help="rate of its execution context (default: 1000)",
    )
    add("--folder", help="where to write it (default: a folder of its name)")
    add("--force", action="store_true", help="write over files that are there")
    return parser


def _port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and 0 < int(text) < 65536):
        raise argparse.ArgumentTypeError(f"{text!r} is no port; a port is a number from 1 to 65535")
    return int(text)


def _count(text: str) -> Any:
    if not (text.isascii() and text.isdigit()):
        raise argparse.ArgumentTypeError(f"{text!r} is no number from 0 on")
    return int(text)
