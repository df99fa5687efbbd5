"""Formats: how names of components, managers and files are written in `rtc.conf`, such as `%h.host_cxt/%n.rtc`.

| letter | stands for |
| --- | --- |
| `%n` | instance name |
| `%t`, `%m` | type name |
| `%v`, `%V` | version, vendor |
| `%c` | category |
| `%h` | host name |
| `%M` | manager's name |
| `%p` | process id |
| `%%` | `%` |
| `${NAME}` | environment variable, nothing where it is not set |

Everything else, another letter behind `%` too, stands for itself.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

__all__ = ["Fields", "expand"]


@dataclass(frozen=True, slots=True)
class Fields:
    """What the letters of a format stand for."""

    instance: str = ""
    type_name: str = ""
    version: str = ""
    vendor: str = ""
    category: str = ""
    host: str = ""
    manager: str = ""
    pid: str = ""


def expand(form: str, fields: Fields, environment: Mapping[str, str]) -> str:
    """The text that a format gives. What is filled in is not looked at again."""

    def text_of(found: re.Match[str]) -> str:
        if found["variable"] is not None:
            return environment.get(found["variable"], "")
        letter = found["letter"]
        return "%" if letter == "%" else str(getattr(fields, _LETTERS[letter]))

    return _PART.sub(text_of, form)


_LETTERS: Final = {
    "n": "instance",
    "t": "type_name",
    "m": "type_name",
    "v": "version",
    "V": "vendor",
    "c": "category",
    "h": "host",
    "M": "manager",
    "p": "pid",
}
_PART: Final = re.compile(rf"%(?P<letter>[{''.join(_LETTERS)}%])|\$\{{(?P<variable>[^}}]*)\}}")
