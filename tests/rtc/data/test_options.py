"""Properties of connections: who overrides whom, what they mean, and that none of them does harm."""

from __future__ import annotations

import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from muros.rtc.codes import ReturnCode
from muros.rtc.data import TRANSPORTS, Side, effective_properties
from muros.rtc.data._options import OptionError, Subscription, merged_back, parse_options
from tests.rtc.data.kit import MemoryTransport, Pair, long

KEYS = [
    "interface_type", "dataflow_type", "subscription_type", "io_mode", "publisher.push_policy",
    "publisher.push_rate", "push_rate", "publisher.skip_count", "marshaling_type", "serializer.cdr.endian",
    "timestamp_policy", "allow_dup_connection", "fan_in", "fan_out", "buffer.length",
    "buffer.write.full_policy", "buffer.write.timeout", "buffer.read.empty_policy", "buffer.read.timeout",
    "data_type", "inport.buffer.length", "outport.buffer.length", "inport.data_type", "outport.data_type",
]  # fmt: skip
TEXTS = st.one_of(
    st.sampled_from(
        [
            "", " ", "corba_cdr", "direct", "push", "pull", "duplex", "flush", "new", "periodic", "all", "skip",
            "little,big", "big", "on_write,on_read", "0", "-1", "1", "3", "1e99", "nan", "inf", "1e308", "0x10",
            "9" * 400, "block", "readback", "do_nothing", "cdr", "any", "YES", "IDL:RTC/TimedLong:1.0",
        ]
    ),
    st.text(max_size=12),
)  # fmt: skip
ASKED = st.dictionaries(st.sampled_from(KEYS), TEXTS)


@given(ASKED, st.sampled_from(Side))
def test_options_are_understood_or_refused(options: dict[str, str], side: Side) -> None:
    try:
        understood = parse_options(options, side)
    except OptionError as error:
        understood, refused = None, error
    if understood is None:
        assert refused.code in (ReturnCode.BAD_PARAMETER, ReturnCode.RTC_ERROR)
        assert str(refused)
    else:
        buffer = understood.buffer
        assert 1 <= buffer.length <= 1_000_000
        assert 0 <= buffer.write_timeout < float("inf")
        assert 0 <= buffer.read_timeout < float("inf")
        assert 0 < understood.push_rate <= 100_000
        assert understood.skip_count >= 0


@settings(max_examples=60, deadline=None)
@given(ASKED, st.booleans(), st.booleans())
def test_requests_of_any_kind_leave_all_or_nothing(
    options: dict[str, str], usual: bool, in_first: bool
) -> None:
    transport = MemoryTransport()
    pair = Pair()
    before = TRANSPORTS.push.get("corba_cdr"), TRANSPORTS.pull.get("corba_cdr")
    TRANSPORTS.push["corba_cdr"] = TRANSPORTS.pull["corba_cdr"] = transport
    try:
        asked = {f"dataport.{key}": text for key, text in options.items()}
        if usual:
            asked |= {"dataport.interface_type": "corba_cdr", "dataport.dataflow_type": "push"}
        code, profile = pair.ask(asked, in_first)
        standing = [port.connector(profile.connector_id) is not None for port in (pair.out, pair.in_)]
        assert standing == [code is ReturnCode.RTC_OK] * 2
        if code is ReturnCode.RTC_OK:
            pair.out.write(long(1))
        else:
            assert pair.findings
            assert not pair.out.connector_infos
            assert not pair.in_.connector_infos
        pair.out.disconnect_all()
        assert not pair.in_.connectors
    finally:
        for kind, one in zip((TRANSPORTS.push, TRANSPORTS.pull), before, strict=True):
            if one is None:
                kind.pop("corba_cdr")  # type: ignore[attr-defined]
            else:
                kind["corba_cdr"] = one  # type: ignore[index]
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("port out")]


def test_the_special_one_wins() -> None:
    configuration = {"buffer.length": "1", "fan_in": "1", "only": "here"}
    properties = {
        "dataport.buffer.length": "2",
        "dataport.fan_in": "2",
        "dataport.inport.buffer.length": "3",
        "dataport.outport.buffer.length": "4",
        "dataport.inport_ref": object(),
        "other.buffer.length": "5",
    }
    assert effective_properties(configuration, properties, Side.IN) == {
        "buffer.length": "3", "fan_in": "2", "only": "here",
    }  # fmt: skip
    assert effective_properties(configuration, properties, Side.OUT)["buffer.length"] == "4"
    assert merged_back(configuration, properties, Side.IN, "IDL:RTC/TimedLong:1.0") == {
        "dataport.inport.buffer.length": "3",
        "dataport.inport.fan_in": "2",
        "dataport.inport.only": "here",
        "dataport.inport.data_type": "IDL:RTC/TimedLong:1.0",
    }


@pytest.mark.parametrize("key", ["publisher.push_rate", "push_rate"])
def test_both_keys_of_the_rate(key: str) -> None:
    base = {"interface_type": "corba_cdr", "dataflow_type": "push", "io_mode": "periodic"}
    understood = parse_options({**base, key: "25"}, Side.OUT)
    assert understood.push_rate == 25.0
    assert understood.subscription is Subscription.PERIODIC
    assert parse_options(base, Side.OUT).push_rate == 1000.0
    rates = {"publisher.push_rate": "5", "push_rate": "9"}
    assert parse_options({**base, **rates}, Side.OUT).push_rate == 5.0


@pytest.mark.parametrize(
    ("mode", "meant"),
    [
        ({"io_mode": "block"}, Subscription.FLUSH),
        ({"io_mode": "nonblock"}, Subscription.NEW),
        ({"subscription_type": "New"}, Subscription.NEW),
        ({"subscription_type": "flush", "io_mode": "periodic"}, Subscription.PERIODIC),
        ({}, Subscription.FLUSH),
    ],
)
def test_io_modes(mode: dict[str, str], meant: Subscription) -> None:
    base = {"interface_type": "corba_cdr", "dataflow_type": "push"}
    assert parse_options({**base, **mode}, Side.OUT).subscription is meant


def test_times_beyond_all_reason(pair: Pair) -> None:
    """A year or 1e300 seconds is for ever: who waits so long is not hurt by the number."""
    pair.connect(
        {
            "dataport.subscription_type": "periodic",
            "dataport.publisher.push_policy": "all",
            "dataport.publisher.push_rate": "1e-300",
            "dataport.inport.buffer.read.empty_policy": "block",
            "dataport.inport.buffer.read.timeout": "1e300",
        }
    )
    answers: list[int] = []
    reader = threading.Thread(target=lambda: answers.append(pair.in_.read().data), daemon=True)
    reader.start()
    pair.out.write(long(8))
    reader.join(10)
    assert answers == [8]
    assert [thread for thread in threading.enumerate() if thread.name.startswith("port out")]


def test_a_port_may_be_kept_to_some_interface_types() -> None:
    pair = Pair()
    pair.in_.configuration = {"provider_types": "direct, smoke", "consumer_types": "none"}
    told = pair.in_.profile().properties
    assert (told["dataport.interface_type"], told["dataport.dataflow_type"]) == ("direct", "push")
    assert pair.ask({"dataport.interface_type": "corba_cdr"})[0] is ReturnCode.BAD_PARAMETER
    assert "ask for direct" in pair.findings[-1].why
    assert (
        pair.ask({"dataport.interface_type": "direct", "dataport.dataflow_type": "pull"})[0]
        is ReturnCode.BAD_PARAMETER
    )
    assert "ask for another dataflow" in pair.findings[-1].why
    assert pair.ask({"dataport.interface_type": "direct"})[0] is ReturnCode.RTC_OK
    pair.out.disconnect_all()
    pair.in_.configuration = {"provider_types": "all"}
    pair.out.configuration = {"consumer_types": "corba_cdr"}
    assert pair.ask({"dataport.interface_type": "direct"})[0] is ReturnCode.BAD_PARAMETER
    assert pair.ask({"dataport.interface_type": "corba_cdr"})[0] is ReturnCode.RTC_OK
    pair.out.disconnect_all()
