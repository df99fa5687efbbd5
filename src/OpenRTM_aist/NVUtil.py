"""Lists of names and values (`SDOPackage.NameValue`) under their old names: `OpenRTM_aist.NVUtil.newNV(...)`."""
# ruff: noqa: N802, N999 (the names are those that programs know)

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from OpenRTM_aist._properties import Properties

__all__ = [
    "append",
    "appendStringValue",
    "copyFromProperties",
    "copyToProperties",
    "dump",
    "find",
    "find_index",
    "isString",
    "isStringValue",
    "newNV",
    "toProperties",
    "toString",
]


def newNV(name: str, value: Any) -> Any:
    """A name with a value, which may be whatever goes into a CORBA any."""
    from omniORB import any as any_

    import SDOPackage

    return SDOPackage.NameValue(name, any_.to_any(str(value) if isinstance(value, str) else value))


def copyFromProperties(nv: list[Any], prop: Properties) -> None:
    """Make `nv` hold what `prop` holds, and nothing else."""
    nv[:] = [newNV(name, text) for name, text in prop.as_dict().items()]


def copyToProperties(prop: Properties, nvlist: Iterable[Any]) -> None:
    """Add what `nvlist` holds to `prop`, as texts."""
    for one in nvlist:
        prop.setProperty(one.name, _text(one.value))


def toProperties(nv: Iterable[Any]) -> Properties:
    prop = Properties()
    copyToProperties(prop, nv)
    return prop


def find(nv: Iterable[Any], name: str) -> Any:
    """The value of a name, a CORBA any. KeyError where there is none."""
    for one in nv:
        if one.name == name:
            return one.value
    raise KeyError(name)


def find_index(nv: Sequence[Any], name: str) -> int:
    """The place of a name, -1 where there is none."""
    return next((place for place, one in enumerate(nv) if one.name == name), -1)


def isString(nv: Iterable[Any], name: str) -> bool:
    return any(one.name == name and isinstance(_value(one.value), str) for one in nv)


def isStringValue(nv: Sequence[Any], name: str, value: str) -> bool:
    """Whether the name has this text."""
    return isString(nv, name) and toString(nv, name) == value


def toString(nv: Iterable[Any], name: str | None = None) -> str:
    """The text of a name, empty where there is none; without a name all of them, a line each."""
    if name is None:
        return "".join(f"{one.name}: {_text(one.value)}\n" for one in nv)
    return next((_text(one.value) for one in nv if one.name == name), "")


def dump(nv: Iterable[Any]) -> None:
    """Print all of them."""
    print(toString(nv), end="")


def appendStringValue(nv: list[Any], name: str, value: str) -> bool:
    """Add a value to the list with commas that the name has."""
    place = find_index(nv, name)
    if place < 0:
        nv.append(newNV(name, value))
    else:
        parts = [part.strip() for part in _text(nv[place].value).split(",")]
        if value not in parts:
            nv[place] = newNV(name, ",".join([*parts, value]))
    return True


def append(dest: list[Any], src: Iterable[Any]) -> None:
    dest.extend(src)


def _value(value: Any) -> Any:
    from omniORB import any as any_

    return any_.from_any(value, keep_structs=True)


def _text(value: Any) -> str:
    return str(_value(value))
