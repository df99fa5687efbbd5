"""Constraints of parameters: the texts that editors show, such as `0<=x<=10`, and the trees of a profile's XML.

| text | tree |
| --- | --- |
| `0<=x<=10` | propertyIsBetween |
| `x>0`, `x>=0`, `x<0`, `x<=0` | propertyIsGreaterThan, ...OrEqualTo, propertyIsLessThan, ...OrEqualTo |
| `0<x<=10` | And of two such |
| `(a,b,c)` | Or of propertyIsEqualTo |
| `a` | propertyIsEqualTo |

A tree that no such text says (one with Not, an Or of intervals) is no text.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from muros.rtc.profile_xml._model import RTC

__all__ = ["constraint_element", "constraint_text"]

_COMPARED: Final = {
    "<": "propertyIsLessThan",
    "<=": "propertyIsLessThanOrEqualTo",
    ">": "propertyIsGreaterThan",
    ">=": "propertyIsGreaterThanOrEqualTo",
}
_SIGNS: Final = {name: sign for sign, name in _COMPARED.items()}
_TURNED: Final = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}
_NUMBER: Final = r"[^<>=,(){}\s]+"
_INTERVAL: Final = re.compile(rf"({_NUMBER})\s*(<=?)\s*x\s*(<=?)\s*({_NUMBER})")
_BOUND: Final = re.compile(rf"x\s*([<>]=?)\s*({_NUMBER})|({_NUMBER})\s*([<>]=?)\s*x")
_DEPTH: Final = 16


def constraint_element(text: str) -> Element | None:
    """The element `Constraint` for a text; None for an empty one and for one that has no tree (`{a:b}`)."""
    unit = _unit(text.strip())
    if unit is None:
        return None
    root = Element(f"{{{RTC}}}Constraint")
    root.append(unit)
    return root


def constraint_text(element: Element) -> str:
    """The text for an element `Constraint`; "" for a tree that no text says."""
    children = list(element)
    return _text(children[0], _DEPTH) or "" if len(children) == 1 else ""


def _unit(text: str) -> Element | None:
    """The tree of a text, in an element `ConstraintUnitType`, or an `And`, `Or` of such."""
    if found := _INTERVAL.fullmatch(text):
        low, left, right, high = found.groups()
        if (left, right) == ("<=", "<="):
            unit, between = _wrapped("propertyIsBetween")
            for name, literal in (("LowerBoundary", low), ("UpperBoundary", high)):
                _literal(SubElement(between, f"{{{RTC}}}{name}"), literal)
            return unit
        return _joined("And", [_comparison(_TURNED[left], low), _comparison(right, high)])
    if found := _BOUND.fullmatch(text):
        if found[1] is not None:
            return _comparison(found[1], found[2])
        return _comparison(_TURNED[found[4]], found[3])
    if text.startswith("(") and text.endswith(")"):
        return _joined("Or", [_equal(word.strip()) for word in text[1:-1].split(",")])
    if text and re.fullmatch(_NUMBER, text):
        return _equal(text)
    return None


def _text(element: Element, depth: int) -> str | None:
    kind = element.tag.rpartition("}")[2]
    children = list(element)
    if depth == 0:
        return None
    if kind in ("ConstraintUnitType", "Constraint"):
        return _text(children[0], depth - 1) if len(children) == 1 else None
    if kind == "propertyIsBetween":
        low, high = (
            _literal_of(element.find(f"{{{RTC}}}{name}")) for name in ("LowerBoundary", "UpperBoundary")
        )
        return None if low is None or high is None else f"{low}<=x<={high}"
    if kind in _SIGNS:
        literal = _literal_of(element)
        return None if literal is None else f"x{_SIGNS[kind]}{literal}"
    if kind == "propertyIsEqualTo":
        return _literal_of(element)
    if kind in ("And", "Or"):
        parts = [_text(child, depth - 1) for child in children]
        if not parts or any(part is None for part in parts):
            return None
        known = [part for part in parts if part is not None]
        return _and_text(known) if kind == "And" else _or_text(known)
    return None


def _and_text(parts: Sequence[str]) -> str | None:
    """Two bounds, lower one first, as an interval."""
    if len(parts) != 2 or not all(part.startswith(("x<", "x>")) for part in parts):
        return None
    lower, upper = sorted(parts, key=lambda part: part[1] == "<")
    if lower[1] != ">" or upper[1] != "<":
        return None
    sign, bound = ("<=", lower[3:]) if lower[2] == "=" else ("<", lower[2:])
    return f"{bound}{sign}{upper}"


def _or_text(parts: Sequence[str]) -> str | None:
    """An enumeration, where each part is a plain value."""
    if any(re.search(r"[<>]|^\(", part) for part in parts):
        return None
    return f"({','.join(parts)})"


def _wrapped(kind: str) -> tuple[Element, Element]:
    unit = Element(f"{{{RTC}}}ConstraintUnitType")
    return unit, SubElement(unit, f"{{{RTC}}}{kind}")


def _comparison(sign: str, literal: str) -> Element:
    unit, element = _wrapped(_COMPARED[sign])
    _literal(element, literal)
    return unit


def _equal(literal: str) -> Element:
    unit, element = _wrapped("propertyIsEqualTo")
    _literal(element, literal)
    return unit


def _joined(kind: str, units: Sequence[Element]) -> Element:
    element = Element(f"{{{RTC}}}{kind}")
    for unit in units:
        holder = SubElement(element, f"{{{RTC}}}Constraint")
        holder.append(unit)
    return element


def _literal(element: Element, text: str) -> None:
    SubElement(element, f"{{{RTC}}}Literal").text = text


def _literal_of(element: Element | None) -> str | None:
    literal = None if element is None else element.find(f"{{{RTC}}}Literal")
    return None if literal is None else (literal.text or "").strip()
