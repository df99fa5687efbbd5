"""The command `muros graph`: who talks to whom, as text, as Graphviz DOT, or as a picture in SVG."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from muros.cli._names import is_hidden
from muros.cli._tool import CommandError, Tool
from muros.cli.topic import command

__all__ = ["register", "show"]

EPILOG = """\
muros graph --svg -o graph.svg      a picture for any browser
muros graph --dot | dot -Tpdf       through Graphviz, for other formats
"""


def register(subparsers: Any) -> None:
    """Adds `graph` to an argparse sub-command table."""
    parser = command(subparsers, "graph", show, "show who talks to whom")
    parser.epilog = EPILOG
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--dot", action="store_true", help="in the language of Graphviz")
    form.add_argument("--svg", action="store_true", help="as a picture")
    parser.add_argument(
        "-o", "--output", metavar="FILE", help="write to FILE; .svg and .dot say the form too"
    )
    parser.add_argument(
        "-a", "--all", action="store_true", help="hidden names, parameters, logs and topics of DDS too"
    )


async def show(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros graph`."""
    from muros.cli import _picture

    await tool.discover()
    seen = _picture.look(tool, None if arguments.all else is_noise)
    ending = Path(arguments.output or "").suffix
    if arguments.svg or (ending == ".svg" and not arguments.dot):
        text = _picture.to_svg(seen)
    elif arguments.dot or ending == ".dot":
        text = _picture.to_dot(seen)
    else:
        text = _picture.to_text(seen)
    if arguments.output is None:
        tool.print(text, end="")
        return
    try:
        Path(arguments.output).write_text(text)
    except OSError as error:
        raise CommandError(f"{arguments.output}: {error.strerror}") from None


NOISE = ("/rosout", "/parameter_events")

PARAMETERS = frozenset(
    "describe_parameters get_parameters get_parameter_types list_parameters set_parameters "
    "set_parameters_atomically get_type_description".split()
)
"""Services that every node of ROS 2 has."""


def is_noise(name: str) -> bool:
    """Whether a topic, service or node would be in every picture and tells nothing."""
    return name in NOISE or is_hidden(name) or name.rpartition("/")[2] in PARAMETERS
