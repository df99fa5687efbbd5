"""The command `muros doctor`: looks at this host and at the graph, and says what is wrong and what to do about it."""

from __future__ import annotations

import argparse
import asyncio
import os
from collections.abc import Iterable
from typing import Any

from muros.cli._diagnosis import Level, Result, report
from muros.cli._tool import WRONG_USE, CommandError, Tool, add_space_options, fail, run_command, space_url

__all__ = ["examine", "register"]

XRCE_PORT = 8888


def register(subparsers: Any) -> None:
    """Adds `doctor` to an argparse sub-command table."""
    about = "say what is wrong with this host and with the graph, and what to do"
    parser = subparsers.add_parser("doctor", help=about, description=f"{about.capitalize()}.")
    add_space_options(parser)
    parser.add_argument(
        "--agent",
        metavar="HOST[:PORT]",
        type=_address,
        default=("127.0.0.1", XRCE_PORT),
        help=f"where a DDS-XRCE agent should answer over UDP (default: 127.0.0.1:{XRCE_PORT})",
    )
    parser.add_argument(
        "--rosserial",
        metavar="DEVICE",
        help="look at the board with rosserial firmware on this port instead, such as /dev/ttyACM0",
    )
    parser.add_argument(
        "-b",
        "--baud",
        type=int,
        help="the board's rate; without it the usual ones are tried",
    )
    parser.add_argument("-q", "--quiet", action="store_true", help="leave out what is fine")
    parser.set_defaults(run=_run, command=examine)


def _run(arguments: argparse.Namespace) -> int:
    """The host first, so that it is told of even if the space cannot be opened."""
    from muros.cli._host_checks import host_checks

    if arguments.rosserial:
        return _look_at_board(arguments)
    if arguments.baud is not None:
        return fail("-b goes with --rosserial DEVICE", WRONG_USE)
    try:
        rest = space_url(arguments.space, arguments.domain).partition(":")[2]
    except CommandError as error:
        return fail(error, error.status)
    domain = int(rest) if rest.isdecimal() else arguments.domain
    told = _Told(arguments.quiet)
    told.tell(host_checks(os.environ, domain))
    arguments.told = told
    status = run_command(arguments, examine)
    if told.tool is None:  # the space could not be opened, which was told
        told.counts[Level.WRONG] += 1
    return max(status, told.end())


def _look_at_board(arguments: argparse.Namespace) -> int:
    from muros.cli._rosserial_checks import board_checks

    told = _Told(arguments.quiet)
    told.tell(board_checks(arguments.rosserial, arguments.baud))
    return told.end()


class _Told:
    """Results as they are printed, and how many there were."""

    def __init__(self, quiet: bool = False, tool: Tool | None = None) -> None:
        self.counts = dict.fromkeys(Level, 0)
        self._quiet = quiet
        self.tool = tool

    def tell(self, results: Iterable[Result]) -> None:
        """Print each when it is there: some take a while."""
        for result in results:
            self.counts[result.level] += 1
            if not (self._quiet and result.level is Level.FINE):
                self._print(report([result]))

    def end(self) -> int:
        """The last line; returns the exit status."""
        bad, notes = self.counts[Level.WRONG], self.counts[Level.NOTE]
        words = [f"{bad} thing{' is' if bad == 1 else 's are'} wrong" if bad else "nothing is wrong"]
        if notes:
            words.append(f"{notes} note{'' if notes == 1 else 's'}")
        self._print(f"\n{', '.join(words)}")
        return 1 if bad else 0

    def _print(self, text: str) -> None:
        if self.tool is not None:
            self.tool.print(text)
        else:
            print(text, flush=True)


async def examine(tool: Tool, arguments: argparse.Namespace) -> int:
    """Look at the graph and ask for agents; returns 1 if something is wrong there."""
    from muros.cli._diagnosis import fine
    from muros.cli._graph_checks import clients_of, graph_checks
    from muros.cli._host_checks import agent_check

    told: _Told = getattr(arguments, "told", None) or _Told(arguments.quiet)
    told.tool = tool
    (agent, holder), _ = await asyncio.gather(
        asyncio.to_thread(agent_check, *arguments.agent), tool.discover()
    )
    told.tell([agent])
    if holder:
        clients = clients_of(tool, holder)
        told.tell([fine(f"its clients' nodes: {', '.join(clients)}")] if clients else [])
    told.tell(graph_checks(tool))
    return 1 if told.counts[Level.WRONG] else 0


def _address(text: str) -> tuple[str, int]:
    host, colon, port = text.rpartition(":")
    if not colon:
        host, port = text, str(XRCE_PORT)
    if not port.isdecimal() or not 0 < int(port) < 65536 or not host:
        raise argparse.ArgumentTypeError(f"{text!r} is no HOST:PORT")
    return host, int(port)
