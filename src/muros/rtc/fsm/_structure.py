"""What a machine looks like from outside: its structure as State Chart XML, its events and their data types.

Transitions are found in the source of the states' methods: whatever is gone to by name there (`self.go(Closed)`, or as
old components write it, `set_state(State(Closed))`). Where the source is not at hand they are left out.
W3C SCXML 1.0; OMG FSM4RTC 1.0, 7.2.4.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final
from xml.etree import ElementTree

from muros.rtc.fsm._machine import FsmAction, State, is_event, states_of

__all__ = ["FsmEventProfile", "FsmStructure", "events_of", "scxml"]

NAMESPACE: Final = "http://www.w3.org/2005/07/scxml"

_GOING: Final = ("go", "set_state", "setState", "setStateHistory")


@dataclass(frozen=True, slots=True)
class FsmEventProfile:
    """An event of a machine. FSM4RTC 1.0, 7.2.4.1."""

    name: str
    data_type: str = ""
    """The repository id of what comes with it; empty where nothing does."""


@dataclass(frozen=True, slots=True)
class FsmStructure:
    """What ExtendedFsmService tells of a machine. FSM4RTC 1.0, 7.2.4.1."""

    name: str
    structure: str = ""
    """The machine as SCXML."""
    event_profiles: tuple[FsmEventProfile, ...] = ()
    properties: Mapping[str, str] = field(default_factory=lambda: {"fsm_structure.format": "scxml"})


def events_of(top: type[State]) -> list[str]:
    """The events of a machine's states, in the order of writing."""
    return list(dict.fromkeys(event for state in states_of(top) for event in _events(state)))


def scxml(top: type[State]) -> str:
    """The machine whose outermost state is `top`, as SCXML."""
    known = {state.__name__: state for state in states_of(top)}
    root = ElementTree.Element(
        "scxml", {"xmlns": NAMESPACE, "version": "1.0", "name": top.__name__, "initial": top.__name__}
    )
    _describe(top, root, known)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _describe(state: type[State], parent: ElementTree.Element, known: Mapping[str, type[State]]) -> None:
    """Add `state` with all that lies within it to `parent`."""
    element = ElementTree.SubElement(parent, "state", {"id": state.__name__})
    inside = [other for other in known.values() if other.within is state]
    first = [target for target in _targets(state, FsmAction.INIT.value, known) if target != state.__name__]
    if inside and first:
        initial = ElementTree.SubElement(element, "initial")
        ElementTree.SubElement(initial, "transition", {"target": first[0]})
    if state.deep_history:
        history = ElementTree.SubElement(
            element, "history", {"id": f"{state.__name__}.history", "type": "deep"}
        )
        if first:
            ElementTree.SubElement(history, "transition", {"target": first[0]})
    for event in _events(state):
        for target in _targets(state, event, known) or [""]:
            id_ = f"{target}.history" if target and known[target].deep_history else target
            ElementTree.SubElement(
                element, "transition", {"event": event, **({"target": id_} if id_ else {})}
            )
    for other in inside:
        _describe(other, element, known)


def _events(state: type[State]) -> list[str]:
    return [name for name in vars(state) if is_event(state, name)]


def _targets(state: type[State], method: str, known: Mapping[str, type[State]]) -> list[str]:
    """The names of states that a method goes to."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(vars(state)[method])))
    except (KeyError, OSError, TypeError, SyntaxError):
        return []
    found: dict[str, None] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in _GOING:
            for part in (inner for argument in node.args for inner in ast.walk(argument)):
                name = part.id if isinstance(part, ast.Name) else getattr(part, "attr", "")
                if name in known:
                    found[name] = None
    return list(found)
