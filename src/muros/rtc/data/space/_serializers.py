"""What the registries of data ports know of the space, without importing it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from muros.rtc.data._serializers import register_serializers
from muros.rtc.data._transports import Connection, Inlet, Offer, Put, register_transport
from muros.rtc.data._types import AnyDataType

if TYPE_CHECKING:
    from muros.rtc.data._transports import PushTransport

__all__ = ["INTERFACE_TYPES", "register_space"]

INTERFACE_TYPES: Final = ("space", "ros2")
"""Names of the transport in `dataport.interface_type`: ours, and the one of OpenRTM-aist's module for ROS 2."""

PREFIX: Final = "ros2:"


class _Messages:
    """Serializers named `ros2:<package>/<Message>`."""

    def names(self, data_type: AnyDataType) -> tuple[str, ...]:
        name = _default(data_type)
        return (name,) if name else ()

    def codec(
        self, data_type: AnyDataType, marshaling: str, options: Mapping[str, str]
    ) -> AnyDataType | None:
        if not marshaling.startswith(PREFIX):
            return None
        from muros.rtc.data.space import _messages

        return _messages.codec_of(data_type, marshaling.removeprefix(PREFIX), options.get("frame_id", ""))


class _Lazily:
    """The transport, imported when it is first used."""

    def offer_inlet(self, connection: Connection, put: Put) -> Offer:
        return _transport().offer_inlet(connection, put)

    def reach_inlet(self, connection: Connection) -> Inlet:
        return _transport().reach_inlet(connection)


def register_space() -> None:
    """Let connections ask for the space."""
    register_serializers(_MESSAGES)
    for name in INTERFACE_TYPES:
        register_transport(name, push=_Lazily(), marshaling=_default)


def _default(data_type: AnyDataType) -> str:
    from muros.rtc.data.space import _messages

    name = _messages.default_message(data_type.repository_id)
    return f"{PREFIX}{name}" if name else ""


def _transport() -> PushTransport:
    global _made
    if _made is None:
        from muros.rtc.data.space._transport import SpaceTransport

        _made = SpaceTransport()
    return _made


_MESSAGES: Final = _Messages()
_made: PushTransport | None = None
