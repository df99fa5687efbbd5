"""The command `muros`: finds the sub-command, imports it, turns errors into exit statuses.

Exit status: 0 done, 1 it did not work, 2 wrong use, 130 interrupted. Sub-commands are imported only when they are
called, so that `muros --version` and the help stay quick.
"""

import os
import sys
from collections.abc import Sequence
from importlib import import_module

WRONG_USE = 2
INTERRUPTED = 130

COMMANDS = {
    "agent": ("muros.cli.agent", "connect DDS-XRCE clients, such as boards that speak micro-ROS"),
    "rosserial": (
        "muros.cli.rosserial",
        "connect boards with rosserial firmware, such as Arduino and OpenCR",
    ),
    "board": ("muros.cli.board", "write the files that a MicroPython board needs"),
    "interface": ("muros.cli.interface", "show, list and generate message, service and action types"),
    "topic": ("muros.cli.topic", "list, show, publish and measure topics of the ROS 2 graph"),
    "param": ("muros.cli.param", "list, show and set parameters of nodes"),
    "node": ("muros.cli.node", "list and show nodes of the ROS 2 graph"),
    "doctor": ("muros.cli.doctor", "say what is wrong with this host and with the graph"),
    "graph": ("muros.cli.graph", "show who talks to whom, as text or as a picture"),
    "action": ("muros.cli.action", "list actions of the ROS 2 graph and send goals to them"),
    "service": ("muros.cli.service", "list and call services of the ROS 2 graph"),
    "diagnostics": ("muros.cli.diagnostics", "show what boards say about their health to tools of ROS 2"),
    "rtc": ("muros.cli.rtc", "run RT components, make new ones, start their name service"),
    "rtcd": ("muros.cli.rtcd", "run a manager of RT components that others load and start"),
    "lifecycle": ("muros.cli.lifecycle", "show and move managed nodes of the ROS 2 graph"),
}
"""Sub-commands: the module, which has `run(argv) -> int` or `register(subparsers)` for argparse, and its help."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run `muros` with the words behind its name; returns the exit status."""
    words = list(sys.argv[1:] if argv is None else argv)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a terminal that cannot show a character must not stop us
            stream.reconfigure(errors="backslashreplace")
    try:
        status = _main(words)
        sys.stdout.flush()
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:
        # Whoever read our output has left (`muros ... | head`). Nothing more can be said, not even at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return status


def _main(words: list[str]) -> int:
    first = words[0] if words else ""
    if first in ("-V", "--version"):
        from muros import __version__

        print(f"muros {__version__}")
        return 0
    if first in ("-h", "--help", "help") and not words[1:]:
        print(_help())
        return 0
    if first == "help":
        return _main([words[1], "--help"])
    if first in COMMANDS:
        return _run(first, words[1:])
    if not first:
        print(_help(), file=sys.stderr)
        return WRONG_USE
    from difflib import get_close_matches

    close = get_close_matches(first, COMMANDS, 1)
    hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(COMMANDS)}; see muros --help"
    print(f"muros: unknown {'option' if first[0] == '-' else 'command'} {first!r}: {hint}", file=sys.stderr)
    return WRONG_USE


def _run(command: str, words: list[str]) -> int:
    module = import_module(COMMANDS[command][0])
    try:
        if hasattr(module, "run"):
            return int(module.run(words))
        from argparse import ArgumentParser

        parser = ArgumentParser(prog="muros")
        module.register(parser.add_subparsers(required=True))
        arguments = parser.parse_args([command, *words])
        return int(arguments.run(arguments) or 0)
    except SystemExit as exit_:  # argparse ends so, after its message
        return exit_.code if isinstance(exit_.code, int) else int(exit_.code is not None)


def _help() -> str:
    lines = [
        "usage: muros COMMAND ...",
        "",
        "Robot middleware from a microcontroller to a fleet.",
        "",
        "commands:",
    ]
    lines += [f"  {name:<12}{about}" for name, (_, about) in COMMANDS.items()]
    lines += ["", "muros COMMAND --help says more; muros --version says which muros this is."]
    return "\n".join(lines)
