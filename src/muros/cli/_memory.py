"""`muros interface memory`: what messages of a type may take under memory rules.

Of a service both messages are shown, of an action those that are bounded: goals, results and feedback.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from muros.interfaces import InterfaceError, action, message, service
from muros.rclc import Rules
from muros.rclc.memory_plan import Walker, divide

_HEAD = 8
"""Bytes before a sample on its way to a board, ..."""
_IDENTITY = {"_Request": 24, "_Response": 4}
"""... and before that of a service, whose it is."""


def show(arguments: argparse.Namespace) -> None:
    """Prints the capacities, the bytes that they make and the longest message. InterfaceError for wrong rules."""
    kinds = _kinds(arguments.type)
    try:
        rules = Rules(_rules(arguments.rules), arguments.strings, arguments.messages, arguments.numbers)
        each = divide(rules, arguments.type, kinds)
    except ValueError as error:
        raise InterfaceError(str(error)) from None
    for number, (kind, its) in enumerate(zip(kinds, each, strict=True)):
        if len(kinds) > 1:
            print(f"{'' if number == 0 else chr(10)}{kind.TYPE}:")
        _show(kind, its, arguments)


def _kinds(name: str) -> Sequence[Any]:
    """The messages that make up a type."""
    if "/srv/" in name and not name.endswith(("_Request", "_Response")):
        found = service(name)
        return found.Request, found.Response
    if "/action/" in name and name.count("_", name.rindex("/")) == 0:
        made = action(name)
        return made.SendGoal.Request, made.GetResult.Response, made.FeedbackMessage
    return (message(name),)


def _show(kind: Any, rules: Rules, arguments: argparse.Namespace) -> None:
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
    largest = longest + _HEAD + next((n for end, n in _IDENTITY.items() if kind.TYPE.endswith(end)), 0)
    print(f"longest message  {longest:>7} B; boards join its pieces with Session(largest={largest})")


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
