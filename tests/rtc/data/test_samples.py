"""Values: copied down to the ground, stamped, written by serializers of a user's own."""

from __future__ import annotations

import array
import threading
from typing import Any

import pytest

from muros.rtc.codes import DataPortStatus, ReturnCode, RtcError
from muros.rtc.data import (
    CDR,
    DataEvent,
    DataInPort,
    DataOutPort,
    codec_of,
    connect,
    copy_value,
    marshaling_types,
    register_serializer,
    same_type,
    stamp,
    type_label,
)
from muros.rtc.data import _serializers as serializers
from tests.rtc.data.kit import Pair, Time, TimedLong, TimedLongType, long


class Anything:
    """Has what it is given."""

    def __init__(self, **members: Any) -> None:
        self.__dict__.update(members)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(name)


class Reference:
    """Looks like a reference to an object."""

    def _is_a(self, repository_id: str) -> bool:
        return False


class Slotted:
    __slots__ = ("data",)


def test_copies_share_nothing_that_can_be_changed() -> None:
    reference, slotted = Reference(), Slotted()
    value: Any = Anything(
        number=1, text="t", octets=b"o", flag=True, nothing=None, buffer=bytearray(b"b"),
        numbers=[1, 2], empty=[], nested=[Anything(x=[1]), Anything(x=[2])], pair=(1, 2),
        deep=(Anything(x=1),), table={"a": [1]}, row=array.array("d", [1.0]), reference=reference,
        slotted=slotted, inner=Anything(tm=Time(1, 2)),
    )  # fmt: skip
    copied: Any = copy_value(value)
    assert type(copied) is Anything
    assert vars(copied).keys() == vars(value).keys()
    for name in ("buffer", "numbers", "empty", "nested", "deep", "table", "inner"):
        assert getattr(copied, name) is not getattr(value, name), name
    assert copied.nested[0].x == [1]
    assert copied.nested[0].x is not value.nested[0].x
    assert copied.deep[0] is not value.deep[0]
    assert copied.table == {"a": [1]}
    assert copied.table["a"] is not value.table["a"]
    assert copied.row == value.row
    assert copied.reference is reference
    assert copied.slotted is slotted
    assert copied.inner.tm == Time(1, 2)
    assert (copied.number, copied.text, copied.octets, copied.pair) == (1, "t", b"o", (1, 2))


def test_stamps() -> None:
    value = long(1)
    assert stamp(value, lambda: 5_000_000_006)
    assert value.tm == Time(5, 6)
    assert not stamp(Anything(data=1), lambda: 1)
    assert not stamp(Anything(tm=3), lambda: 1)


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("IDL:RTC/TimedLong:1.0", "IDL:RTC/TimedLong:1.0", True),
        ("IDL:RTC/TimedLong:1.0", "TimedLong", True),
        ("IDL:RTC/TimedLong:1.0", "RTC::TimedLong", True),
        ("IDL:RTC/TimedLong:1.0", "IDL:My/TimedLong:1.0", False),
        ("IDL:RTC/TimedLong:1.0", "TimedShort", False),
        ("any", "IDL:RTC/TimedLong:1.0", True),
        ("", "IDL:RTC/TimedLong:1.0", True),
    ],
)
def test_names_of_types(one: str, other: str, same: bool) -> None:
    assert same_type(one, other) is same
    assert same_type(other, one) is same


def test_labels_of_types() -> None:
    assert type_label("IDL:RTC/TimedLong:1.0") == "RTC/TimedLong"
    assert type_label(" ::RTC::TimedLong ") == "RTC/TimedLong"


class Decimal(TimedLongType):
    """A serializer of a user's own."""

    def encode(self, value: TimedLong, little: bool) -> bytes:
        return str(value.data).encode()

    def decode(self, octets: bytes, little: bool) -> TimedLong:
        return long(int(octets))


def test_a_serializer_of_ones_own(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serializers, "_NAMED", {})
    decimal = Decimal()
    register_serializer("decimal", decimal)
    assert codec_of(pair.codec, "decimal") is decimal
    assert codec_of(pair.codec, CDR) is pair.codec
    assert codec_of(pair.codec, "nosuch") is None
    assert marshaling_types(pair.codec)[:2] == (CDR, "decimal")
    assert "decimal" in pair.out.profile().properties["dataport.marshaling_types"]
    pair.connect({"dataport.marshaling_type": "decimal"})
    receiver = pair.in_._pushed[0]
    put = receiver.put
    pair.out.write(long(42))
    assert pair.in_.read() == long(42)
    put(b"17")
    assert pair.in_.read() == long(17)
    assert pair.codec.encoded == 0


def test_connecting_from_a_program() -> None:
    codec = TimedLongType()
    out, in_ = DataOutPort("out", codec), DataInPort("in", codec)
    profile = connect(out, in_, options={"dataport.subscription_type": "new"}, name="mine")
    assert (profile.name, profile.text("dataport.interface_type")) == ("mine", "direct")
    assert profile.text("dataport.subscription_type") == "new"
    with pytest.raises(RtcError, match="PRECONDITION_NOT_MET"):
        connect(out, in_)
    with pytest.raises(RtcError, match="needs the ports"):
        connect()
    out.disconnect_all()


def test_values_that_wait_for_a_sender_that_cannot_send(pair: Pair) -> None:
    """The sender's own buffer, full: refused, after waiting, or at the cost of the oldest."""
    for policy, status, event in (
        ("do_nothing", DataPortStatus.BUFFER_FULL, DataEvent.ON_BUFFER_FULL),
        ("block", DataPortStatus.BUFFER_TIMEOUT, DataEvent.ON_BUFFER_WRITE_TIMEOUT),
        ("overwrite", DataPortStatus.PORT_OK, DataEvent.ON_BUFFER_OVERWRITE),
    ):
        heard: list[int] = []
        listener = pair.out.add_listener(event, lambda info, value, heard=heard: heard.append(value.data))
        profile = pair.connect(
            {
                "dataport.dataflow_type": "pull",
                "dataport.outport.buffer.length": "2",
                "dataport.outport.buffer.write.full_policy": policy,
                "dataport.outport.buffer.write.timeout": "0.01",
            }
        )
        written = [pair.out.write(long(number)) for number in (1, 2, 3)]
        assert pair.out.status == [status]
        assert written == [True, True, status is DataPortStatus.PORT_OK]
        assert heard == [3]
        assert pair.in_.read().data == (2 if policy == "overwrite" else 1)
        link = pair.out.link(profile.connector_id)
        assert link is not None
        pair.out.disconnect_all()
        assert link.write(object()) is DataPortStatus.PRECONDITION_NOT_MET  # type: ignore[attr-defined]
        pair.out.remove_listener(event, listener)


def test_a_pulled_port_that_waits_for_its_sender(pair: Pair) -> None:
    pair.connect(
        {
            "dataport.dataflow_type": "pull",
            "dataport.outport.buffer.read.empty_policy": "block",
            "dataport.outport.buffer.read.timeout": "0.01",
        }
    )
    pair.listen()
    assert pair.in_.try_read() == (DataPortStatus.RECV_TIMEOUT, long(-1))
    assert pair.heard == [
        "OutPort.ON_BUFFER_READ_TIMEOUT(None)",
        "OutPort.ON_SENDER_TIMEOUT(None)",
        "InPort.ON_SENDER_TIMEOUT(None)",
    ]
    assert pair.out.disconnect_all() is ReturnCode.RTC_OK


@pytest.mark.parametrize(
    ("policy", "event"),
    [
        ("do_nothing", DataEvent.ON_BUFFER_FULL),
        ("block", DataEvent.ON_BUFFER_WRITE_TIMEOUT),
        ("overwrite", DataEvent.ON_BUFFER_OVERWRITE),
    ],
)
def test_values_that_wait_for_a_thread_that_is_sending(pair: Pair, policy: str, event: DataEvent) -> None:
    sending, go_on = threading.Event(), threading.Event()

    def hold(info: object, value: TimedLong) -> None:
        sending.set()
        go_on.wait(10)

    pair.in_.add_listener(DataEvent.ON_RECEIVED, hold)
    heard: list[int] = []
    pair.out.add_listener(event, lambda info, value: heard.append(value.data))
    pair.connect(
        {
            "dataport.subscription_type": "new",
            "dataport.publisher.push_policy": "all",
            "dataport.outport.buffer.length": "1",
            "dataport.outport.buffer.write.full_policy": policy,
            "dataport.outport.buffer.write.timeout": "0.01",
        }
    )
    try:
        assert pair.out.write(long(1))
        assert sending.wait(10)
        assert pair.out.write(long(2)) is (policy == "overwrite"), "the first stands there until it was sent"
        assert heard == [2]
    finally:
        go_on.set()
