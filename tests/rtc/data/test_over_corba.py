"""The recorded behaviour again, with the transports that need an ORB, and with values of the IDL."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from muros.rtc.codes import DataPortStatus
from muros.rtc.corba import Orb, data_type_of
from muros.rtc.corba._shared_memory import SharedMemoryTransport, is_available
from muros.rtc.corba._transports import corba_cdr, data_service
from muros.rtc.data import TRANSPORTS, DataInPort, DataOutPort, connect, copy_value
from muros.rtc.data.space._messages import TYPES, codec_of
from tests.rtc.data.kit import Pair, long
from tests.rtc.data.test_behaviour import CASES, FLUSH, NEW, PULL, replay, sent_counter, with_is_new

WAYS = ["corba_cdr", "data_service", "shared_memory"]


@pytest.fixture(params=WAYS)
def way(request: pytest.FixtureRequest, orb: Orb, monkeypatch: pytest.MonkeyPatch) -> str:
    """An interface type, really carried."""
    name: str = request.param
    if name == "shared_memory" and not is_available():
        pytest.skip("there is no shared memory here")
    makers: dict[str, Callable[[Orb], Any]] = {
        "corba_cdr": corba_cdr,
        "data_service": data_service,
        "shared_memory": SharedMemoryTransport,
    }
    transport = makers[name](orb)
    monkeypatch.setitem(TRANSPORTS.push, name, transport)
    monkeypatch.setitem(TRANSPORTS.pull, name, transport)
    return name


def carried(case: dict[str, Any], way: str) -> dict[str, Any]:
    return {**case, "properties": {**case["properties"], "dataport.interface_type": way}}


@pytest.mark.parametrize(
    "name", [name for name in FLUSH if "empty=do" not in name and "empty=bl" not in name]
)
def test_flush(pair: Pair, way: str, name: str) -> None:
    replay(pair, carried(CASES[name], way))


@pytest.mark.parametrize("name", NEW)
def test_new(pair: Pair, way: str, name: str) -> None:
    replay(pair, carried(CASES[name], way), sent_counter(pair, name))


@pytest.mark.parametrize("name", PULL)
def test_pull(pair: Pair, way: str, name: str) -> None:
    replay(pair, carried(with_is_new(CASES[name]), way))


@pytest.mark.parametrize("dataflow", ["push", "pull"])
def test_both_endiannesses(pair: Pair, way: str, dataflow: str) -> None:
    for endian in ("little,big", "big"):
        pair.connect(
            {
                "dataport.interface_type": way,
                "dataport.dataflow_type": dataflow,
                "dataport.serializer.cdr.endian": endian,
            }
        )
        pair.out.write(long(258))
        assert pair.in_.read() == long(258)
        pair.out.disconnect_all()


def test_objects_that_have_gone(pair: Pair, way: str) -> None:
    """What the other side has taken away is a lost connection, not an error that goes on."""
    profile = pair.connect({"dataport.interface_type": way})
    assert pair.out.write(long(1))
    pair.in_.unsubscribe_interfaces(profile)
    assert not pair.out.write(long(2))
    assert pair.out.status == [DataPortStatus.CONNECTION_LOST]
    assert not pair.out.connectors


def test_ports_leave_no_objects(pair: Pair, way: str, orb: Orb) -> None:
    standing = len(orb.servants)
    for dataflow in ("push", "pull"):
        for _ in range(5):
            pair.connect({"dataport.interface_type": way, "dataport.dataflow_type": dataflow})
            assert len(orb.servants) > standing
            pair.in_.disconnect_all()
        assert len(orb.servants) == standing


def test_values_of_the_idl_go_from_port_to_port(way: str) -> None:
    for name in ("RTC::TimedDoubleSeq", "RTC::TimedString", "RTC::TimedPose3D", "RTC::CameraImage"):
        data_type = data_type_of(name)
        out, in_ = DataOutPort("out", data_type), DataInPort("in", data_type)
        for interface in (way, "direct"):
            connect(out, in_, options={"interface_type": interface})
            value = data_type.default()
            value.tm.sec = 7
            assert out.write(value)
            assert data_type.encode(in_.read(), True) == data_type.encode(value, True)
            out.disconnect_all()


@pytest.mark.parametrize("label", TYPES)
def test_values_of_the_idl_become_messages(label: str) -> None:
    data_type = data_type_of(f"IDL:RTC/{label}:1.0")
    for row in TYPES[label]:
        codec = codec_of(data_type, row.message)
        assert codec is not None
        value = data_type.default()
        if label == "CameraImage":
            value.bpp, value.format = 8, "mono8"
        back = codec.decode(codec.encode(value, True), True)
        assert data_type.encode(back, True) == data_type.encode(value, True)
        assert data_type.encode(copy_value(value), True) == data_type.encode(value, True)
