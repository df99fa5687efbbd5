"""What comes from outside and should not: octets at the ORB's port, values that are none, peers that are slow."""

import random
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from muros.findings import Finding
from muros.rtc import Component, InPort, OutPort
from muros.rtc.codes import DataPortStatus
from muros.rtc.corba import Orb, set_up
from muros.rtc.corba._conversion import texts_of, to_nv_list
from muros.rtc.corba._stubs import RTC, OpenRTM, OpenRTM__POA

WAIT = 20.0

PUSH = {
    "dataport.interface_type": "corba_cdr",
    "dataport.dataflow_type": "push",
    "dataport.subscription_type": "flush",
}


class Both(Component):
    """Has a port of each kind."""

    inp = InPort(RTC.TimedString)
    out = OutPort(RTC.TimedString)


class Offered:
    def __init__(self, orb: Orb) -> None:
        self.orb = orb
        self.findings: list[Finding] = []
        self.objects = set_up(orb)
        self.component = Both()
        self.component.configure("Both0", {})
        self.component.reporter.on_finding(self.findings.append)
        assert self.component.initialize() == 0
        self.reference = self.objects.offer(self.component)
        self.inp, self.out = self.reference.get_ports()


@pytest.fixture
def offered(orb: Orb) -> Iterator[Offered]:
    one = Offered(orb)
    yield one
    one.component.exit()
    one.objects.withdraw(one.component)


def test_octets_that_are_no_value(offered: Offered) -> None:
    code, profile = offered.inp.connect(RTC.ConnectorProfile("c", "", [offered.inp], to_nv_list(PUSH)))
    assert code == RTC.RTC_OK
    target = offered.orb.to_reference(texts_of(profile.properties)["dataport.corba_cdr.inport_ior"])
    dice = random.Random(5)
    for octets in (
        b"",
        b"\0" * 11,
        b"\0" * 8 + b"\xff" * 4,
        *(dice.randbytes(dice.randrange(40)) for _ in range(100)),
    ):
        target.put(octets)
        offered.component.inp.read()
    target.put(struct.pack("<III", 1, 2, 3) + b"hi\0")
    assert offered.component.inp.read().data == "hi"
    assert offered.findings


def test_octets_at_the_port_of_the_orb(offered: Offered) -> None:
    ior = bytes.fromhex(offered.orb.to_text(offered.reference)[4:])
    place = ior.index(b"127.0.0.1\0") + 10
    address = ("127.0.0.1", int.from_bytes(ior[place : place + 2], "little"))
    dice = random.Random(7)
    heads = [b"", b"GIOP\1\2\1\0", b"GIOP\1\2\0\0", b"GIOP\1\0\1\0", b"GIOP\1\2\3\7"]
    for number in range(60):
        body = dice.randbytes(dice.randrange(1, 200))
        length = dice.choice([len(body), 0, 0x7FFFFFFF, 0xFFFFFFFF, 60 << 20])
        with socket.create_connection(address, timeout=5.0) as line:
            line.sendall(heads[number % len(heads)] + struct.pack("<I", length) + body)
    assert offered.reference.get_component_profile().instance_name == "Both0"


class Slow(OpenRTM__POA.InPortCdr):  # type: ignore[misc]
    """An InPort that answers when it is let go."""

    def __init__(self) -> None:
        self.go = threading.Event()

    def put(self, data: bytes) -> Any:
        self.go.wait(WAIT)
        return OpenRTM.PORT_OK


WRITER = """
import sys
from muros.rtc import Component, OutPort
from muros.rtc.corba import set_up, start_orb
orb = start_orb("127.0.0.1:", call_timeout=0.3, connect_timeout=0.3)
objects = set_up(orb)
import RTC
from muros.rtc.corba._conversion import to_nv_list

class Writer(Component):
    out = OutPort(RTC.TimedString)

component = Writer()
component.configure("Writer0", {})
component.initialize()
port = objects.offer(component).get_ports()[0]
properties = {
    "dataport.interface_type": "corba_cdr", "dataport.dataflow_type": "push",
    "dataport.subscription_type": "flush", "dataport.corba_cdr.inport_ior": sys.argv[1],
}
print(port.connect(RTC.ConnectorProfile("c", "", [port], to_nv_list(properties)))[0])
for _ in range(3):
    component.out.write(RTC.TimedString(RTC.Time(0, 0), "x"))
    print(*(one.name for one in component.out.status), len(port.get_connector_profiles()))
component.exit()
orb.shutdown()
"""


def test_a_receiver_that_is_too_slow(orb: Orb) -> None:
    """Once is late, twice is lost: the writer never waits longer than a call may take."""
    target = Slow()
    try:
        done = subprocess.run(
            [sys.executable, "-c", WRITER, orb.to_text(orb.activate(target))],
            capture_output=True,
            text=True,
            timeout=WAIT,
            check=False,
        )
    finally:
        target.go.set()
        orb.deactivate(target)
    assert done.stdout.splitlines() == ["RTC_OK", "SEND_TIMEOUT 1", "CONNECTION_LOST 0", "0"], done.stderr


@pytest.mark.parametrize(
    ("ior", "code"),
    [
        ("", RTC.BAD_PARAMETER),
        ("IOR:00", None),
        ("nonsense", None),
        ("corbaloc::127.0.0.1:1/nobody", None),
    ],
)
def test_a_connector_that_leads_nowhere(offered: Offered, ior: str, code: Any) -> None:
    properties = {**PUSH, **({"dataport.corba_cdr.inport_ior": ior} if ior else {})}
    answer, _ = offered.out.connect(RTC.ConnectorProfile("c", "", [offered.out], to_nv_list(properties)))
    assert answer != RTC.RTC_OK
    assert code is None or answer == code
    assert offered.out.get_connector_profiles() == []
    assert offered.findings


def test_a_connector_to_an_object_of_another_kind(offered: Offered) -> None:
    ior = offered.orb.to_text(offered.reference)
    properties = {**PUSH, "dataport.corba_cdr.inport_ior": ior}
    answer, _ = offered.out.connect(RTC.ConnectorProfile("c", "", [offered.out], to_nv_list(properties)))
    assert answer != RTC.RTC_OK


def test_an_object_that_has_gone(offered: Offered) -> None:
    target = Slow()
    properties = {**PUSH, "dataport.corba_cdr.inport_ior": offered.orb.to_text(offered.orb.activate(target))}
    answer, _ = offered.out.connect(RTC.ConnectorProfile("c", "", [offered.out], to_nv_list(properties)))
    assert answer == RTC.RTC_OK
    offered.orb.deactivate(target)
    assert not offered.component.out.write(RTC.TimedString(RTC.Time(0, 0), "x"))
    assert offered.component.out.status[0] is DataPortStatus.CONNECTION_LOST
    assert offered.out.get_connector_profiles() == []
