"""The properties of a connection as one side sees them, and what they mean.

A property of the connection stands as `dataport.<key>` for both sides, or as `dataport.inport.<key>` and
`dataport.outport.<key>` for one of them; a port's own configuration has `<key>`. The more special one wins, the port's
own configuration yields to all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Final, TypeVar

from muros.rtc.codes import ReturnCode, RtcError
from muros.rtc.data._buffer import LENGTH, TIMEOUT, BufferOptions
from muros.rtc.data._policies import PushPolicy
from muros.rtc.data._ring import EmptyPolicy, FullPolicy
from muros.rtc.profiles import PropertyValue

__all__ = [
    "ENDIAN_KEY",
    "DataOptions",
    "Dataflow",
    "OptionError",
    "Side",
    "Stamp",
    "Subscription",
    "effective_properties",
    "merged_back",
    "parse_options",
]

PUSH_RATE: Final = 1000.0
"""Hz of a periodic connection that does not say its rate."""

MAX_PUSH_RATE: Final = 100_000.0
"""Hz. What asks for more gets this."""

MAX_LENGTH: Final = 1_000_000
"""Values. A buffer of a connection is not longer, whatever the connection asks for."""

ENDIAN_KEY: Final = "dataport.serializer.cdr.endian"

_PREFIX: Final = "dataport."


class Side(Enum):
    """Which side of a connection a port is."""

    IN = "inport"
    OUT = "outport"


class Dataflow(Enum):
    """`dataport.dataflow_type`: who calls whom."""

    PUSH = "push"
    PULL = "pull"
    DUPLEX = "duplex"
    """Both: whoever comes second."""


class Subscription(Enum):
    """When an OutPort sends what was written: `dataport.subscription_type`, or `dataport.io_mode`."""

    FLUSH = "flush"
    """In the call of write."""
    NEW = "new"
    """In a thread, at once."""
    PERIODIC = "periodic"
    """In a thread, at a rate."""


class Stamp(Enum):
    """`dataport.timestamp_policy`: when a value's `tm` is set to the time of day."""

    ON_WRITE = "on_write"
    ON_SEND = "on_send"
    ON_RECEIVED = "on_received"
    ON_READ = "on_read"


class OptionError(RtcError):
    """Properties of a connection that cannot be; `code` is what the connecting port answers."""

    def __init__(self, code: ReturnCode, text: str) -> None:
        super().__init__(text)
        self.code = code


SUBSCRIPTIONS: Final = {
    "flush": Subscription.FLUSH,
    "block": Subscription.FLUSH,
    "new": Subscription.NEW,
    "nonblock": Subscription.NEW,
    "periodic": Subscription.PERIODIC,
}
"""Subscription types and io modes by name; the two mean the same."""


@dataclass(frozen=True, slots=True)
class DataOptions:
    """What the properties of a connection mean to one side of it."""

    interface_type: str
    dataflow: Dataflow
    marshaling: str
    """`cdr`, the name of another serializer, or empty: the interface's own."""
    little: bool
    subscription: Subscription = Subscription.FLUSH
    push_policy: PushPolicy = PushPolicy.NEW
    push_rate: float = PUSH_RATE
    """Hz"""
    skip_count: int = 0
    stamps: frozenset[Stamp] = frozenset()
    buffer: BufferOptions = field(default_factory=BufferOptions)
    remarks: tuple[str, ...] = ()
    """What was not understood and taken as its default, in words."""


def effective_properties(
    configuration: Mapping[str, str], properties: Mapping[str, PropertyValue], side: Side
) -> dict[str, str]:
    """What holds for this side: its port's `configuration`, overlaid by the connection's `properties`."""
    general: dict[str, str] = {}
    special: dict[str, str] = {}
    sides = tuple(f"{one.value}." for one in Side)
    own = f"{side.value}."
    for name, value in properties.items():
        if not isinstance(value, str) or not name.startswith(_PREFIX):
            continue
        key = name.removeprefix(_PREFIX)
        if key.startswith(own):
            special[key.removeprefix(own)] = value
        elif not key.startswith(sides):
            general[key] = value
    return {**configuration, **general, **special}


def merged_back(
    configuration: Mapping[str, str], properties: Mapping[str, PropertyValue], side: Side, data_type: str
) -> dict[str, PropertyValue]:
    """What this side adds to the connection's properties so that they tell what holds for it."""
    effective = effective_properties(configuration, properties, side)
    prefix = f"{_PREFIX}{side.value}."
    added: dict[str, PropertyValue] = {f"{prefix}{key}": effective[key] for key in configuration}
    added[f"{prefix}data_type"] = data_type
    return added


def parse_options(options: Mapping[str, str], side: Side) -> DataOptions:
    """What the effective properties mean. OptionError for what no connection can be made from.

    Numbers that are none, and names of policies that are unknown, are taken as their defaults: `remarks` tells.
    """
    remarks: list[str] = []
    interface_type = _text(options, "interface_type")
    if not interface_type:
        raise OptionError(ReturnCode.BAD_PARAMETER, "dataport.interface_type is missing")
    dataflow = _dataflow(options)
    endian = _text(options, "serializer.cdr.endian", "little").split(",")[0].strip().lower()
    if endian not in ("little", "big"):
        raise OptionError(ReturnCode.RTC_ERROR, f"{ENDIAN_KEY}: {endian!r} is neither little nor big")
    subscription = Subscription.FLUSH
    if side is Side.OUT and dataflow is Dataflow.PUSH:
        subscription = _subscription(options)
    return DataOptions(
        interface_type=interface_type,
        dataflow=dataflow,
        marshaling=_text(options, "marshaling_type"),
        little=endian == "little",
        subscription=subscription,
        push_policy=_choice(options, "publisher.push_policy", PushPolicy, PushPolicy.NEW, remarks),
        push_rate=_push_rate(options, remarks),
        skip_count=_number(options, "publisher.skip_count", int, 0, remarks),
        stamps=_stamps(options, remarks),
        buffer=_buffer_options(options, interface_type, dataflow, side, remarks),
        remarks=tuple(remarks),
    )


def _dataflow(options: Mapping[str, str]) -> Dataflow:
    name = _text(options, "dataflow_type").lower()
    for dataflow in Dataflow:
        if dataflow.value == name:
            return dataflow
    if not name:
        raise OptionError(ReturnCode.BAD_PARAMETER, "dataport.dataflow_type is missing: push, pull or duplex")
    raise OptionError(
        ReturnCode.BAD_PARAMETER,
        f"dataport.dataflow_type: {name!r} is not to be had; ask for push, pull or duplex",
    )


def _subscription(options: Mapping[str, str]) -> Subscription:
    name = (_text(options, "io_mode") or _text(options, "subscription_type", "flush")).lower()
    if name not in SUBSCRIPTIONS:
        raise OptionError(
            ReturnCode.RTC_ERROR,
            f"dataport.subscription_type: {name!r} is unknown; ask for one of {', '.join(SUBSCRIPTIONS)}",
        )
    return SUBSCRIPTIONS[name]


def _buffer_options(
    options: Mapping[str, str], interface_type: str, dataflow: Dataflow, side: Side, remarks: list[str]
) -> BufferOptions:
    direct = interface_type == "direct" and side is Side.IN
    length = _number(options, "buffer.length", int, 1 if direct else LENGTH, remarks, least=1)
    if length > MAX_LENGTH:
        remarks.append(f"buffer.length: {length} is taken as {MAX_LENGTH}")
        length = MAX_LENGTH
    # Who is asked for a value he does not have says so: a value that was fetched is not given again.
    empty = EmptyPolicy.READBACK if side is Side.IN else EmptyPolicy.DO_NOTHING
    full = FullPolicy.OVERWRITE
    if dataflow is Dataflow.DUPLEX:  # nothing is kept: writer and reader wait for each other
        length, full, empty = MAX_LENGTH, FullPolicy.BLOCK, EmptyPolicy.BLOCK
    return BufferOptions(
        length=length,
        full_policy=_choice(options, "buffer.write.full_policy", FullPolicy, full, remarks),
        write_timeout=_number(options, "buffer.write.timeout", float, TIMEOUT, remarks),
        empty_policy=_choice(options, "buffer.read.empty_policy", EmptyPolicy, empty, remarks),
        read_timeout=_number(options, "buffer.read.timeout", float, TIMEOUT, remarks),
    )


def _push_rate(options: Mapping[str, str], remarks: list[str]) -> float:
    key = "publisher.push_rate" if "publisher.push_rate" in options else "push_rate"
    rate = _number(options, key, float, PUSH_RATE, remarks)
    if rate == 0:
        remarks.append(f"{key}: 0 is taken as {PUSH_RATE}")
        return PUSH_RATE
    return min(rate, MAX_PUSH_RATE)


def _stamps(options: Mapping[str, str], remarks: list[str]) -> frozenset[Stamp]:
    stamps = set()
    for name in _text(options, "timestamp_policy").lower().replace(",", " ").split():
        try:
            stamps.add(Stamp(name))
        except ValueError:
            remarks.append(f"timestamp_policy: {name!r} is unknown and ignored")
    return frozenset(stamps)


def _text(options: Mapping[str, str], key: str, default: str = "") -> str:
    return options.get(key, "").strip() or default


N = TypeVar("N", int, float)
E = TypeVar("E", bound=Enum)


def _number(
    options: Mapping[str, str],
    key: str,
    kind: Callable[[str], N],
    default: N,
    remarks: list[str],
    least: int = 0,
) -> N:
    text = _text(options, key)
    if not text:
        return default
    try:
        number = kind(text)
    except (ValueError, OverflowError):
        remarks.append(f"{key}: {text!r} is no number and taken as {default}")
        return default
    if not least <= number < float("inf"):
        remarks.append(f"{key}: {text} is taken as {default}")
        return default
    return number


def _choice(options: Mapping[str, str], key: str, kind: type[E], default: E, remarks: list[str]) -> E:
    name = _text(options, key).lower()
    for one in kind:
        if one.value == name:
            return one
    if name:
        remarks.append(f"{key}: {name!r} is unknown and taken as {default.value}")
    return default
