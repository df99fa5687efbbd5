"""The command ``muros interface``: shows, lists and generates types."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

from muros.cli.board import add_program, constants_of, report_constants

EPILOG = """\
Types of your own are found in the folders of $MUROS_INTERFACES or of --path: package/msg/MyType.msg.
Standard types are those of the newest ROS 2 distribution, or of $MUROS_DISTRO.
"""


def register(subparsers: Any) -> None:
    """Adds ``interface`` with its own sub-commands to an argparse sub-command table."""
    parser = subparsers.add_parser(
        "interface",
        help="show, list and generate message, service and action types",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    actions = parser.add_subparsers(required=True, metavar="show | list | proto | generate | memory")
    show = _command(actions, "show", _show, "print the definition of types")
    show.add_argument("types", nargs="+", metavar="TYPE", help="std_msgs/msg/Int32, or short std_msgs/Int32")
    show.add_argument("--full", action="store_true", help="with the definitions of nested types behind it")
    show.add_argument(
        "--hash", action="store_true", help="print type hashes instead: RIHS01 of ROS 2, md5 of ROS 1"
    )
    show.add_argument("--code", action="store_true", help="print the generated Python class instead")
    listing = _command(actions, "list", _list, "list the names of all types")
    listing.add_argument("packages", nargs="*", metavar="PACKAGE", help="only those of these packages")
    listing.add_argument("--packages", dest="names_only", action="store_true", help="list packages instead")
    kinds = listing.add_mutually_exclusive_group()
    for flag, name, kind in (("-m", "msgs", "msg"), ("-s", "srvs", "srv"), ("-a", "actions", "action")):
        kinds.add_argument(
            flag, f"--only-{name}", dest="kind", action="store_const", const=kind, help=f"only {name}"
        )
    proto = _command(actions, "proto", _proto, "print the values of a message as YAML, to be filled in")
    proto.add_argument("type", metavar="TYPE", help="of a service the request, of an action the goal")
    proto.add_argument("--no-quotes", action="store_true", help="without quotes around it")
    generate = _command(
        actions, "generate", _generate, "write Python packages of the types and of all they need"
    )
    generate.add_argument("types", nargs="+", metavar="TYPE")
    generate.add_argument("-o", "--output", required=True, metavar="DIR", help="folder for the packages")
    generate.add_argument("--board", action="store_true", help="small classes for MicroPython")
    generate.add_argument(
        "--ros1", action="store_true", help="classes of ROS 1 for a program that plays a rosserial board"
    )
    add_program(generate)
    generate.add_argument(
        "--action-services", action="store_true", help="boards: also what carries an action"
    )
    generate.add_argument("--rules", action="store_true", help="boards: classes that memory rules can bound")
    memory = _command(actions, "memory", _memory, "show what messages of a type may take under memory rules")
    memory.add_argument("type", metavar="TYPE")
    memory.add_argument(
        "rules", nargs="*", metavar="PATH=SIZE", help="elements or bytes of text, as name=8 name.data=16"
    )
    for words, about in (("strings", "bytes of text"), ("messages", "elements"), ("numbers", "elements")):
        memory.add_argument(
            f"--{words}", type=int, default=0, metavar="N", help=f"{about} of {words} without a rule"
        )
    memory.add_argument(
        "--word", type=int, choices=(4, 8), default=8, help="bytes of a pointer in C (default: 8)"
    )


def _memory(arguments: argparse.Namespace) -> None:
    from muros.cli import _memory

    _memory.show(arguments)


def _command(
    actions: Any, name: str, run: Callable[[argparse.Namespace], None], text: str
) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = actions.add_parser(name, help=text, description=text.capitalize() + ".")
    parser.add_argument(
        "--path", action="append", default=[], metavar="DIR", help="folder of your definitions"
    )
    parser.set_defaults(run=_guarded(run))
    return parser


def _guarded(run: Callable[[argparse.Namespace], None]) -> Callable[[argparse.Namespace], int]:
    """Runs a sub-command with the user's folders added; errors of theirs are one line, exit status 1."""

    def guarded(arguments: argparse.Namespace) -> int:
        from muros import interfaces

        try:
            for folder in arguments.path:
                interfaces.add_path(folder)
            run(arguments)
        except interfaces.InterfaceError as error:
            print(f"muros: {error}", file=sys.stderr)
            return 1
        except OSError as error:
            print(f"muros: {error.filename or arguments.output}: {error.strerror}", file=sys.stderr)
            return 1
        return 0

    return guarded


def _show(arguments: argparse.Namespace) -> None:
    from muros import interfaces

    for at, asked in enumerate(arguments.types):
        name = interfaces.full_name(asked)
        if arguments.hash:
            print(f"{name}\n  {interfaces.rihs01(name)}\n  md5 {_md5(name)}")
            continue
        if arguments.code:
            for message in interfaces.definition(name).messages():
                print(interfaces.source(message.name))
            continue
        if len(arguments.types) > 1:
            print(("\n" if at else "") + f"# {name}")
        print(interfaces.text(name) if arguments.full else interfaces.definition_text(name), end="")


def _md5(name: str) -> str:
    from muros import interfaces

    try:
        return interfaces.md5(name)
    except interfaces.InterfaceError as error:
        return f"none: {error}"


def _list(arguments: argparse.Namespace) -> None:
    from muros import interfaces

    names = interfaces.names()
    found = {name.partition("/")[0] for name in names}
    for package in arguments.packages:
        if package not in found:
            raise interfaces.InterfaceError(
                f"unknown package {package!r}; see muros interface list --packages"
            )
    if arguments.kind:
        names = [name for name in names if name.split("/")[1] == arguments.kind]
        found = {name.partition("/")[0] for name in names}
    chosen = set(arguments.packages) or found
    lines = sorted(chosen) if arguments.names_only else [n for n in names if n.partition("/")[0] in chosen]
    if lines:
        print("\n".join(lines))


def _proto(arguments: argparse.Namespace) -> None:
    from muros import interfaces
    from muros.cli._values import Look, to_yaml

    made = interfaces.load(arguments.type)
    if issubclass(made, interfaces.ServiceType):
        made = made.Request
    elif issubclass(made, interfaces.ActionType):
        made = made.Goal
    quote = "" if arguments.no_quotes else '"'
    print(f"{quote}{to_yaml(made(), Look())}{quote}")


def _generate(arguments: argparse.Namespace) -> None:
    if arguments.ros1:
        from muros.rosserial import types

        ends = ((name.partition("/")[0], name.rpartition("/")[2]) for name in arguments.types)
        files = types.write(map("/".join, ends), arguments.output)
    elif arguments.board:
        from muros.interfaces import board

        constants = constants_of(arguments.program)
        shapes = arguments.rules or (constants is not None and "Rules" in constants)
        files = board.generate(
            arguments.types, arguments.output, arguments.action_services, constants=constants, shapes=shapes
        )
        if constants is None:
            report_constants(arguments.types, sys.stderr)
    else:
        from muros.interfaces import host

        files = host.generate(arguments.types, arguments.output)
    for file in files:
        print(file)
