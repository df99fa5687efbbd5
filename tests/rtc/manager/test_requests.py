"""Requests in one text: components to create, ports to connect."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rtc.manager._requests import (
    ComponentId,
    RequestError,
    parse_connect_untrusted,
    parse_create_untrusted,
)


def test_a_type_alone() -> None:
    request = parse_create_untrusted("ConsoleOut")
    assert request.id == ComponentId("ConsoleOut")
    assert not request.properties
    assert str(request) == "ConsoleOut"


def test_every_part_of_a_request() -> None:
    text = "RTC:AIST:example:ConsoleOut:Python:1.0?instance_name=Left&conf.default.a=1=2&empty="
    request = parse_create_untrusted(text)
    assert request.id == ComponentId("ConsoleOut", "AIST", "example", "Python", "1.0")
    assert request.properties == {"instance_name": "Left", "conf.default.a": "1=2", "empty": ""}
    assert str(request) == text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "'' names no component; write Type[?]key=value&key=value"),
        ("?a=b", "names no component"),
        ("RTC:a:b:c", "'RTC:a:b:c' is no component id; it has the form RTC:vendor:category:"),
        ("RTC:a:b::Python:1", "is no component id"),
        ("XYZ:a:b:c:d:e", "is no component id"),
        ("Foo?a", "'Foo[?]a': 'a' is no key=value"),
        ("Foo?=b", "'Foo[?]=b': no key before '=b'"),
        ("Foo?instance_name=a\nERROR: x", "control characters have no place in a request"),
        ("a" * 65537, "a request of 65537 characters; at most 65536 are read"),
    ],
)
def test_wrong_requests_to_create(text: str, message: str) -> None:
    with pytest.raises(RequestError, match=message):
        parse_create_untrusted(text)


@pytest.mark.parametrize(
    ("text", "fits"),
    [
        ("ConsoleOut", True),
        ("RTC::::", False),
        ("RTC:::ConsoleOut::", True),
        ("RTC:AIST::ConsoleOut::", True),
        ("RTC:AIST:example:ConsoleOut:Python:1.0", True),
        ("RTC:AIST:example:ConsoleOut:C++:1.0", False),
        ("RTC:AIST:example:ConsoleOut:Python:1.1", False),
        ("ConsoleIn", False),
        ("Console output", True),
    ],
)
def test_parts_that_are_not_empty_agree(text: str, fits: bool) -> None:
    properties = {
        "implementation_id": "ConsoleOut",
        "type_name": "Console output",
        "vendor": "AIST",
        "category": "example",
        "language": "Python",
        "version": "1.0",
    }
    try:
        assert parse_create_untrusted(text).id.fits(properties) is fits
    except RequestError:
        assert not fits


def test_a_connection() -> None:
    request = parse_connect_untrusted("Out0.out?port=In0.in&port2=rtcname://host:2809/h.host_cxt/In1.in")
    assert request.ports == ("Out0.out", "In0.in", "rtcname://host:2809/h.host_cxt/In1.in")
    assert request.properties == {"dataport.dataflow_type": "push", "dataport.interface_type": "corba_cdr"}


def test_keys_of_a_connection_may_be_short() -> None:
    request = parse_connect_untrusted(
        "a.b?port=c.d&subscription_type=new&push_policy=all&publisher.push_rate=10&dataflow_type=pull"
        "&dataport.x=y&port.connection.strictness=strict"
    )
    assert request.properties == {
        "dataport.dataflow_type": "pull",
        "dataport.interface_type": "corba_cdr",
        "dataport.subscription_type": "new",
        "dataport.publisher.push_policy": "all",
        "dataport.publisher.push_rate": "10",
        "dataport.x": "y",
        "port.connection.strictness": "strict",
    }


def test_one_port_alone() -> None:
    assert parse_connect_untrusted("a.b?interface_type=space&topic=chatter").ports == ("a.b",)


@pytest.mark.parametrize("text", ["", "a", "a.", ".b", "a.b?port=c", "a.b?port", "a.b?=x"])
def test_wrong_requests_to_connect(text: str) -> None:
    with pytest.raises(RequestError):
        parse_connect_untrusted(text)


@given(st.text(alphabet="aR:T.C?&=port0 ", max_size=40) | st.text())
def test_any_text_is_read_or_refused(text: str) -> None:
    for parse in (parse_create_untrusted, parse_connect_untrusted):
        with contextlib.suppress(RequestError):
            assert str(parse(text))
