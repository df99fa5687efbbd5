"""Properties: texts by dotted names, and the files they are written in (`rtc.conf` and those of components).

A `Properties` is a mapping of whole names; `node("logger")` is the part of it below `logger.`, alive: what is set
in the one is seen in the other. Values looked for in vain are taken from the defaults, which are never iterated.

The files' form is the one of Java's properties, as OpenRTM-aist reads it: `key: value` or `key = value` or `key value`,
comments behind `#` or `!` at the line's start, a backslash at the line's end goes on in the next one, later lines win.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, MutableMapping
from pathlib import Path
from typing import Final

from muros.rtc.codes import RtcError

__all__ = [
    "ConfError",
    "Properties",
    "flag_of",
    "is_yes",
    "number_of",
    "read_conf_file",
    "read_conf_untrusted",
    "seconds_of",
    "split_address",
    "split_list",
    "write_conf",
]

FILE_SIZE: Final = 4 << 20
"""Octets that a file of properties may have."""


class ConfError(RtcError):
    """A file of properties, or a value in it, cannot be used; the text says file, line and what to do."""


class Properties(MutableMapping[str, str]):
    """Texts by dotted names, in the order in which they were first set.

    `texts`: what it begins with. `defaults`: what names have that were not set; `in`, `len` and iteration do not see
    them, `[...]` and `get` do.
    """

    def __init__(
        self,
        texts: Mapping[str, str] | Iterable[tuple[str, str]] = (),
        *,
        defaults: Mapping[str, str] | None = None,
    ) -> None:
        self._texts: dict[str, str] = {}
        self._defaults: Mapping[str, str] = {} if defaults is None else defaults
        self._prefix = ""
        self.update(texts)

    def node(self, name: str) -> Properties:
        """The part below `name.`, alive. Its own value, that of `name` itself, has the name ""."""
        part = Properties()
        part._texts, part._defaults = self._texts, self._defaults
        part._prefix = self._full(name) + "." if self._full(name) else ""
        return part

    def copy(self) -> Properties:
        """The same texts and defaults, from now on apart."""
        defaults = dict(self._below(self._defaults))
        return Properties(dict(self.items()), defaults=defaults)

    def branches(self, name: str = "") -> tuple[str, ...]:
        """The first parts of the names below `name`: of `conf.a.x` and `conf.b.y` below `conf` that is `a`, `b`."""
        return tuple(dict.fromkeys(key.split(".", 1)[0] for key in self.node(name) if key))

    def flag(self, name: str, default: bool = False) -> bool:
        """Whether the value is YES (or true, on, 1 in any case); an empty one gives `default`."""
        return flag_of(self, name, default)

    def number(self, name: str, default: float) -> float:
        """The value as a number; `default` where there is none. ConfError for a text that is none."""
        text = self.get(name, "").strip()
        if not text:
            return default
        number = number_of(text)
        if not math.isfinite(number):
            raise ConfError(f"{self._full(name)}: {text!r} is not a number; write one such as {default:g}")
        return number

    def words(self, name: str) -> tuple[str, ...]:
        """The value as a list: parts between commas, without blanks around them and without empty ones."""
        return split_list(self.get(name, ""))

    def merged(self, more: Mapping[str, str]) -> Properties:
        """A copy in which `more` wins."""
        both = self.copy()
        both.update(more)
        return both

    def __getitem__(self, name: str) -> str:
        full = self._full(name)
        try:
            return self._texts[full]
        except KeyError:
            if full in self._defaults:
                return self._defaults[full]
        raise KeyError(name)

    def __setitem__(self, name: str, text: str) -> None:
        self._texts[self._full(name)] = text

    def __delitem__(self, name: str) -> None:
        del self._texts[self._full(name)]

    def __iter__(self) -> Iterator[str]:
        return (name for name, _ in self._below(self._texts))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and self._full(name) in self._texts

    def __repr__(self) -> str:
        return f"Properties({dict(self.items())!r})"

    def _full(self, name: str) -> str:
        return self._prefix + name if name else self._prefix[:-1]

    def _below(self, texts: Mapping[str, str]) -> Iterator[tuple[str, str]]:
        prefix, own = self._prefix, self._prefix[:-1]
        for name, text in list(texts.items()):
            if name.startswith(prefix):
                yield name[len(prefix) :], text
            elif own and name == own:
                yield "", text


def read_conf_file(path: Path) -> Properties:
    """The properties of a file. ConfError if it cannot be read or is not of the form."""
    try:
        with path.open("rb") as file:
            octets = file.read(FILE_SIZE + 1)
    except OSError as error:
        raise ConfError(f"{path}: cannot be read: {error.strerror}") from error
    return read_conf_untrusted(octets, str(path))


def read_conf_untrusted(octets: bytes, source: str) -> Properties:
    """The properties written in `octets`; `source` is what errors call it. Raises ConfError, nothing else.

    Comments may be of any encoding; keys and values are UTF-8.
    """
    if len(octets) > FILE_SIZE:
        raise ConfError(f"{source}: more than {FILE_SIZE >> 20} MiB; this is no file of properties")
    properties = Properties()
    for number, line in _logical_lines(octets.decode("utf-8", "surrogateescape")):
        found = _KEY.match(line)
        assert found is not None  # every text matches
        key, text = _unescape(found[1]), _unescape(line[found.end() :])
        _check(key + text, source, number)
        if not key:
            raise ConfError(
                f"{source}:{number}: no key before {line[:20]!r}; lines have the form 'key: value'"
            )
        properties[key] = text
    return properties


def write_conf(properties: Mapping[str, str]) -> str:
    """The text of a file that reads back as `properties`."""
    return "".join(f"{_escape(key, _KEY_ESCAPES)}: {_escape(text, {})}\n" for key, text in properties.items())


def split_list(text: str) -> tuple[str, ...]:
    """The parts of a text between commas, without blanks around them and without empty ones."""
    return tuple(part for word in text.split(",") if (part := word.strip()))


def split_address(text: str, port: str = "") -> tuple[str, str]:
    """The host and the port of HOST, HOST:PORT or [IPV6]:PORT; `port` where there is none."""
    host, colon, given = text.rpartition(":")
    return (host, given) if colon and not text.endswith("]") else (text, port)


def is_yes(text: str) -> bool:
    """Whether a text of a configuration means yes."""
    return text.strip().lower() in ("yes", "true", "on", "1")


def number_of(text: str) -> float:
    """The number that a text writes; not-a-number for one that writes none."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def flag_of(texts: Mapping[str, str], key: str, default: bool) -> bool:
    """Whether the text of `key` means yes; `default` where there is none."""
    text = texts.get(key, "").strip()
    return is_yes(text) if text else default


def seconds_of(texts: Mapping[str, str], key: str, default: float) -> float:
    """The time that the text of `key` writes; `default` where there is none. RtcError for one that is no time."""
    text = texts.get(key, "").strip()
    seconds = number_of(text) if text else default
    if not (math.isfinite(seconds) and seconds >= 0):
        raise RtcError(f"{key}: {text!r} is no time; write seconds, such as 0.5")
    return seconds


_KEY: Final = re.compile(r"((?:[^\\:= \t\f]|\\.)*)[ \t\f]*[:=]?[ \t\f]*", re.DOTALL)
"""A key up to the first `:`, `=` or blank that no backslash stands before, and what divides it from its value."""

_ESCAPES: Final = str.maketrans({"\\": "\\\\", "\n": "\\n", "\r": "\\r", "\t": "\\t", "\f": "\\f"})
_KEY_ESCAPES: Final = str.maketrans({c: "\\" + c for c in ":= #!"})
_MEANINGS: Final = {"n": "\n", "r": "\r", "t": "\t", "f": "\f"}
_BLANK: Final = " \t\f\r"


def _logical_lines(text: str) -> Iterator[tuple[int, str]]:
    """Lines with their numbers, those that go on joined, comments and empty ones left out."""
    joined, start = "", 0
    for number, raw in enumerate(text.split("\n"), 1):
        line = raw.strip(_BLANK)
        if not joined and (not line or line[0] in "#!"):
            continue
        start = start if joined else number
        goes_on = (len(line) - len(line.rstrip("\\"))) % 2 == 1
        if goes_on:
            line = line[:-1]
        joined += line
        if goes_on:
            joined = joined or " "
            continue
        yield start, joined.lstrip(_BLANK)
        joined = ""
    if joined.strip(_BLANK):
        yield start, joined.lstrip(_BLANK)


def _escape(text: str, more: Mapping[int, str]) -> str:
    """So that it reads back: what ends a line or a key, and blanks at the ends, which reading takes off."""
    inner = text.strip(_BLANK)
    before, behind = (
        text[: len(text) - len(text.lstrip(_BLANK))],
        text[len(text.rstrip(_BLANK)) :] if inner else "",
    )
    return _as_codes(before) + inner.translate(_ESCAPES).translate(more) + _as_codes(behind)


def _as_codes(blanks: str) -> str:
    return "".join(f"\\u{ord(blank):04x}" for blank in blanks)


def _unescape(text: str) -> str:
    return re.sub(r"\\(u[0-9a-fA-F]{4}|.)", _meaning, text, flags=re.DOTALL)


def _meaning(found: re.Match[str]) -> str:
    code = found[1]
    return chr(int(code[1:], 16)) if len(code) > 1 else _MEANINGS.get(code, code)


def _check(text: str, source: str, number: int) -> None:
    if any("\ud800" <= c <= "\udfff" for c in text):
        raise ConfError(f"{source}:{number}: not UTF-8; save the file in that encoding")
    if "\0" in text:
        raise ConfError(f"{source}:{number}: a NUL character; this is no file of properties")
