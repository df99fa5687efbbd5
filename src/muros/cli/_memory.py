"""`muros interface memory`: what messages of a type may take under memory rules."""

from __future__ import annotations

import argparse

from muros.interfaces import InterfaceError, message
from muros.rclc import Rules
from muros.rclc.memory_plan import Walker, make

_HEAD = 8
"""Bytes before a sample on its way to a board."""


def show(arguments: argparse.Namespace) -> None:
    """Prints the capacities, the bytes that they make and the longest message. InterfaceError for wrong rules."""
    kind = message(arguments.type)
    try:
        rules = Rules(_rules(arguments.rules), arguments.strings, arguments.messages, arguments.numbers)
        make(rules, kind)
    except ValueError as error:
        raise InterfaceError(str(error)) from None
    capacities = rules.capacities(kind)
    width = max(map(len, capacities), default=0)
    texts = set(_texts(kind))
    for path, most in capacities.items():
        print(f"{path:<{width}}  {most:>7} {'B of text' if path in texts else 'elements'}")
    if capacities:
        bits = 8 * arguments.word
        print(f"all of them      {rules.size(kind, arguments.word):>7} B in C on {bits} bit")
        print(f"in one buffer    {rules.static_size(kind, arguments.word):>7} B")
    else:
        print(f"{kind.TYPE} has neither strings nor sequences.")
    longest = rules.longest(kind)
    print(f"longest message  {longest:>7} B; boards join its pieces with Session(largest={longest + _HEAD})")


def _texts(kind: type) -> list[str]:
    """The paths of strings."""
    walker = Walker(kind)
    return [walker.path for _ in walker if walker.path and walker.form[0] in "sw"]


def _rules(words: list[str]) -> dict[str, int]:
    rules = {}
    for word in words:
        path, _, size = word.partition("=")
        if not path or not size.isdecimal():
            raise ValueError(f"{word!r} is no rule such as name=8")
        rules[path] = int(size)
    return rules
