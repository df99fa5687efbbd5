"""The ORB: endpoints, objects by keys, its end."""

import subprocess
import sys

import omniORB
import pytest
from omniORB import CORBA

from muros.rtc.codes import RtcError
from muros.rtc.corba import Orb, current_orb, endpoint_arguments, start_orb
from muros.rtc.corba._lost import asked_again, describe, peer, quick_answer
from muros.rtc.corba._stubs import RTC__POA, OpenRTM, OpenRTM__POA


@pytest.mark.parametrize(
    ("text", "arguments"),
    [
        ("all", ["-ORBendPoint", "giop:tcp::", "-ORBendPointPublish", "all(addr)"]),
        ("", ["-ORBendPoint", "giop:tcp::"]),
        ("127.0.0.1", ["-ORBendPoint", "giop:tcp:127.0.0.1:"]),
        ("127.0.0.1:", ["-ORBendPoint", "giop:tcp:127.0.0.1:"]),
        (":2810", ["-ORBendPoint", "giop:tcp::2810"]),
        ("[::1]:9", ["-ORBendPoint", "giop:tcp:[::1]:9"]),
        ("[::1]", ["-ORBendPoint", "giop:tcp:[::1]:"]),
        ("a:1, b", ["-ORBendPoint", "giop:tcp:a:1", "-ORBendPoint", "giop:tcp:b:"]),
        ("giop:unix:/tmp/x", ["-ORBendPoint", "giop:unix:/tmp/x"]),
    ],
)
def test_endpoints_of_rtc_conf_are_the_orbs(text: str, arguments: list[str]) -> None:
    assert endpoint_arguments(text) == arguments


@pytest.mark.parametrize("text", ["host:many", "host:70000", "a, b:-1"])
def test_bad_ports_are_told(text: str) -> None:
    with pytest.raises(RtcError, match="is no port"):
        endpoint_arguments(text)


class Target(OpenRTM__POA.InPortCdr):  # type: ignore[misc]
    def put(self, data: bytes) -> object:
        return OpenRTM.PORT_OK


def test_a_second_start_gives_the_orb_that_runs(orb: Orb) -> None:
    assert start_orb("127.0.0.1:") is orb
    assert current_orb() is orb


def test_objects_can_be_called_until_they_are_deactivated(orb: Orb) -> None:
    servant = Target()
    reference = orb.activate(servant)
    assert orb.activate(servant)._is_equivalent(reference)
    assert servant in orb.servants
    again = orb.to_reference(orb.to_text(reference))
    assert again.put(b"") == OpenRTM.PORT_OK
    assert orb.servant_of(again) is servant
    assert orb.is_local(again)
    orb.deactivate(servant)
    orb.deactivate(servant)
    assert servant not in orb.servants
    assert orb.servant_of(again) is None
    with pytest.raises(CORBA.OBJECT_NOT_EXIST):
        again.put(b"")


def test_a_key_makes_an_object_reachable_without_a_name_service(orb: Orb) -> None:
    first, second = Target(), Target()
    address = _address(orb, orb.activate(first, "example.Keyed0"))
    try:
        found = orb.to_reference(f"corbaloc::{address}/example.Keyed0")
        assert found._narrow(OpenRTM.InPortCdr).put(b"") == OpenRTM.PORT_OK
        orb.activate(second, "example.Keyed0")
        orb.deactivate(first)
        assert found._narrow(OpenRTM.InPortCdr).put(b"") == OpenRTM.PORT_OK
    finally:
        orb.deactivate(first)
        orb.deactivate(second)
    assert orb.to_reference(f"corbaloc::{address}/example.Keyed0")._non_existent()


def test_texts_that_are_no_references_are_refused(orb: Orb) -> None:
    for text in ("", "IOR:", "IOR:zz", "IOR:00", "http://x", "IOR:" + "f" * 1000, "\u65e5"):
        with pytest.raises(RtcError, match="is no reference"):
            orb.to_reference(text)


def test_errors_of_calls_are_ours(orb: Orb) -> None:
    nobody = orb.to_reference("corbaloc::127.0.0.1:1/nobody")
    with (
        pytest.raises(RtcError, match=r"port X does not answer: TRANSIENT \(ConnectFailed\)"),
        peer("port X"),
    ):
        nobody._non_existent()
    with pytest.raises(RtcError, match="port X failed: BAD_PARAM"), peer("port X"):
        raise CORBA.BAD_PARAM(0, CORBA.COMPLETED_NO)
    assert describe(CORBA.NO_PERMISSION(7, CORBA.COMPLETED_NO)) == "NO_PERMISSION (minor 0x7)"


def test_a_line_that_was_cut_is_tried_once_more() -> None:
    """As when another process listens at the address of one that has ended."""
    answers: list[object] = [CORBA.COMM_FAILURE(0, CORBA.COMPLETED_MAYBE), "here"]

    def call() -> object:
        answer = answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    assert asked_again(call) == "here"
    answers += [CORBA.COMM_FAILURE(0, CORBA.COMPLETED_MAYBE)] * 2
    with pytest.raises(CORBA.COMM_FAILURE):
        asked_again(call)
    answers += [CORBA.TRANSIENT(0, CORBA.COMPLETED_NO), "not asked"]
    with pytest.raises(CORBA.TRANSIENT):
        asked_again(call)


def test_repository_ids_of_a_component(orb: Orb) -> None:
    """What tools narrow to (the SDO ids begin with org.omg)."""

    class Component(OpenRTM__POA.DataFlowComponent):  # type: ignore[misc]
        pass

    class Context(RTC__POA.ExecutionContextService):  # type: ignore[misc]
        pass

    component, context = Component(), Context()
    try:
        reference = orb.activate(component)
        for name in (
            "IDL:openrtm.aist.go.jp/OpenRTM/DataFlowComponent:1.0",
            "IDL:omg.org/RTC/RTObject:1.0",
            "IDL:omg.org/RTC/DataFlowComponentAction:1.0",
            "IDL:org.omg/SDOPackage/SDO:1.0",
            "IDL:org.omg/SDOPackage/SDOSystemElement:1.0",
        ):
            assert reference._is_a(name)
        assert not reference._is_a("IDL:omg.org/RTC/FsmParticipant:1.0")
        assert orb.activate(context)._is_a("IDL:org.omg/SDOPackage/SDOService:1.0")
    finally:
        orb.deactivate(component)
        orb.deactivate(context)


_PROGRAM = """
from muros.rtc.codes import RtcError
from muros.rtc.corba import current_orb, start_orb
from muros.rtc.corba._stubs import OpenRTM, OpenRTM__POA
import threading

class Target(OpenRTM__POA.InPortCdr):
    def put(self, data):
        orb.shutdown()
        return OpenRTM.PORT_OK

try:
    start_orb("192.0.2.1:1")
except RtcError as error:
    print(str(error)[:24])
for _ in range(2):
    orb = start_orb("127.0.0.1:")
    target = orb.activate(Target())
    caller = threading.Thread(target=lambda: target.put(b""))
    caller.start()
    assert orb.wait(10.0)
    caller.join()
    orb.shutdown()
    orb.shutdown()
try:
    current_orb()
except RtcError as error:
    print(error)
"""


def run(program: str) -> subprocess.CompletedProcess[str]:
    """A program in a process of its own, for which warnings are errors."""
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )


def test_an_orb_is_ended_by_what_it_serves_and_started_again() -> None:
    done = run(_PROGRAM)
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    assert first == "the ORB does not start w"
    assert second.startswith("no ORB runs")


_SHARED = """
from omniORB import CORBA
from muros.rtc.corba import start_orb
from muros.rtc.corba._stubs import OpenRTM__POA

class Target(OpenRTM__POA.InPortCdr):
    pass

for way in ("destroy", "shutdown"):
    orb = start_orb("127.0.0.1:")
    target = Target()
    orb.activate(target)
    shared = CORBA.ORB_init([], CORBA.ORB_ID)
    if way == "shutdown":
        shared.shutdown(True)
    shared.destroy()
    orb.deactivate(target)
    orb.shutdown()
    orb.shutdown()
print("ended")
"""


def test_an_orb_that_others_have_destroyed_is_ended() -> None:
    """Tools that run components in the process of their own ORB (rtlog, rtinject) end it before the manager does."""
    done = run(_SHARED)
    assert (done.returncode, done.stdout, done.stderr) == (0, "ended\n", "")


def _address(orb: Orb, reference: object) -> str:
    """HOST:PORT of the ORB's first endpoint, from a reference's octets."""
    octets = bytes.fromhex(orb.to_text(reference)[4:])
    place = octets.index(b"127.0.0.1\0") + 10
    return f"127.0.0.1:{int.from_bytes(octets[place : place + 2], 'little')}"


def test_the_time_for_calls_holds_again_behind_a_shorter_one(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[int] = []
    monkeypatch.setattr(omniORB, "setClientThreadCallTimeout", given.append)
    with quick_answer(5.0):
        with quick_answer():
            assert given == [5000, 2000]
        assert given == [5000, 2000, 5000]
    assert given == [5000, 2000, 5000, 0]
