"""The command `muros diagnostics`: what boards say about their health, in words."""

from __future__ import annotations

import argparse
from typing import Any, Final

from muros.cli._tool import CommandError, Tool
from muros.cli.topic import command

__all__ = ["bridge", "register"]

NODE: Final = "micro_ros_diagnostic_bridge"
LEVELS: Final = ("OK", "WARN", "ERROR", "STALE")

ABOUT: Final = """\
Turn diagnostics of boards, which are numbers, into those that ROS 2's tools show, with the words of a table:

  hardware_ids:
    ros__parameters:
      7: left arm
  updaters:
    ros__parameters:
      1:
        name: battery
        description: the accumulator of the arm
        keys:
          0: {name: voltage}
          1: {name: mode, values: {0: charging, 1: in use}}

Ctrl-C ends it.
"""


def register(subparsers: Any) -> None:
    """Adds `diagnostics` with its own sub-commands to an argparse sub-command table."""
    parser = subparsers.add_parser("diagnostics", help="what boards say about their health")
    words = parser.add_subparsers(required=True, metavar="bridge")
    bridging = command(words, "bridge", bridge, "show diagnostics of boards to ROS 2's tools")
    bridging.description, bridging.formatter_class = ABOUT, argparse.RawDescriptionHelpFormatter
    bridging.add_argument("table", metavar="TABLE", help="the YAML file with the words")
    bridging.add_argument("-q", "--quiet", action="store_true", help="do not print what is published")
    bridging.add_argument("-n", "--namespace", default="", help="that of the node and of both topics")
    bridging.add_argument(
        "--source",
        default="diagnostics_uros",
        metavar="TOPIC",
        help="what boards publish (default: %(default)s)",
    )
    bridging.add_argument(
        "--target", default="diagnostics", metavar="TOPIC", help="what is published (default: %(default)s)"
    )


async def bridge(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros diagnostics bridge`."""
    from muros.diagnostics import Bridge, TableError, read_table
    from muros.rclc import Context, Executor, InvalidNameError

    try:
        table = read_table(arguments.table)
    except TableError as error:
        raise CommandError(str(error)) from None
    context = Context(space=tool.space, domain_id=tool.domain)
    try:
        Bridge(
            context.node(NODE, arguments.namespace),
            table,
            arguments.source,
            arguments.target,
            on_missing=lambda what: tool.say(f"{what} is not in {arguments.table}"),
            on_status=None if arguments.quiet else lambda status: tool.print(line(status)),
        )
        await Executor(context).spin_async()
    except InvalidNameError as error:
        raise CommandError(str(error)) from None
    finally:
        context.close()


def line(status: Any) -> str:
    """A status as a line of text."""
    values = ", ".join(f"{pair.key}: {pair.value}" for pair in status.values)
    return f"{LEVELS[status.level]:<5} {status.name} ({status.hardware_id}): {values or status.message}"
