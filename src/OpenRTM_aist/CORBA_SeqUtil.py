"""Sequences of CORBA, which are lists in Python, under their old names: `OpenRTM_aist.CORBA_SeqUtil.push_back(...)`."""
# ruff: noqa: N999 (the names are those that programs know)

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

__all__ = [
    "back",
    "clear",
    "erase",
    "erase_if",
    "find",
    "for_each",
    "front",
    "insert",
    "push_back",
    "push_back_list",
]

F = TypeVar("F", bound="Callable[[Any], Any]")


def push_back(seq: list[Any], elem: Any) -> None:
    seq.append(elem)


def push_back_list(seq1: list[Any], seq2: Iterable[Any]) -> None:
    seq1.extend(seq2)


def insert(seq: list[Any], elem: Any, index: int) -> None:
    """Put `elem` before the place `index`, or at the end."""
    seq.insert(index, elem)


def front(seq: Sequence[Any]) -> Any:
    return seq[0]


def back(seq: Sequence[Any]) -> Any:
    return seq[-1]


def for_each(seq: Iterable[Any], f: F) -> F:
    """Call `f` with each; `f`, which may have kept something."""
    for elem in seq:
        f(elem)
    return f


def find(seq: Sequence[Any], f: Callable[[Any], Any]) -> int:
    """The place of the first for which `f` is true, -1 if there is none."""
    return next((place for place, elem in enumerate(seq) if f(elem)), -1)


def erase(seq: list[Any], index: int) -> None:
    if 0 <= index < len(seq):
        del seq[index]


def erase_if(seq: list[Any], f: Callable[[Any], Any]) -> None:
    """Take the first out for which `f` is true."""
    erase(seq, find(seq, f))


def clear(seq: list[Any]) -> None:
    del seq[:]
