"""What `list`, `find` and `type` of services, actions and nodes have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TypeVar

from muros.cli._tool import CommandError, Tool

__all__ = ["add_count", "find_named", "print_found", "print_lines"]


class Named(Protocol):
    """Something of the graph."""

    @property
    def name(self) -> str:
        """Its full name."""

    @property
    def types(self) -> tuple[str, ...]:
        """The types that it has."""


Found = TypeVar("Found", bound=Named)


def add_count(parser: Any, option: str) -> None:
    """Adds the option that has a list counted in place of printed; ``arguments.count`` says whether it was given."""
    parser.add_argument("-c", option, dest="count", action="store_true", help="only how many there are")


def print_found(tool: Tool, found: Sequence[Named], *, count: bool, types: bool) -> None:
    """Prints the names, with the types if that is wanted; or only how many there are."""
    print_lines(
        tool, [each.name + (f" [{', '.join(each.types)}]" if types else "") for each in found], count=count
    )


def print_lines(tool: Tool, lines: Sequence[str], *, count: bool) -> None:
    """Prints lines, or only how many there are."""
    for line in [len(lines)] if count else lines:
        tool.print(line)


def find_named(tool: Tool, what: str, name: str, found: Sequence[Found]) -> Found:
    """The one of that name. CommandError, with what may have been meant, if it is not among them."""
    from muros.cli.topic import unknown

    for each in found:
        if each.name == name:
            return each
    raise CommandError(unknown(what, name, [each.name for each in found], tool.domain))
