"""Data types by the classes that an IDL compiler made of them.

Who knows IDL (`muros.rtc.corba`) registers itself here with `use_data_types`; nothing else of this room does.
"""

from __future__ import annotations

from collections.abc import Callable

from muros.rtc.codes import RtcError
from muros.rtc.data import AnyDataType

__all__ = ["data_type_of", "use_data_types"]

_resolve: Callable[[object], AnyDataType] | None = None


def use_data_types(resolve: Callable[[object], AnyDataType] | None) -> None:
    """Let `data_type_of` ask `resolve`, which raises RtcError for what is no data type."""
    global _resolve
    _resolve = resolve


def data_type_of(given: object) -> AnyDataType:
    """The data type of a class (`RTC.TimedLong`) or of a repository id; a data type is returned as it is.

    Raises RtcError for what is none.
    """
    if hasattr(given, "encode") and hasattr(given, "repository_id"):
        return given  # type: ignore[return-value]  # it has a data type's attributes
    if _resolve is None:
        raise RtcError(
            f"{given!r}: data types come with the ORB; components are run by a manager (muros.rtc.run)"
        )
    return _resolve(given)
