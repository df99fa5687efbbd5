"""Objects that come and go in many threads, their keys, the end of the ORB's threads."""

import gc
import subprocess
import sys
import weakref
from typing import Any

import pytest
from omniORB import CORBA

from muros.rtc.corba import Orb
from muros.rtc.corba._adapter import RETIRED_SECONDS, Adapter, object_key
from muros.rtc.corba._stubs import OpenRTM, OpenRTM__POA


class Target(OpenRTM__POA.InPortCdr):  # type: ignore[misc]
    def put(self, data: bytes) -> Any:
        return OpenRTM.PORT_OK


def test_references_to_one_object_have_one_hash(orb: Orb) -> None:
    first, second = Target(), Target()
    one, other = orb.activate(first), orb.activate(second)
    again = orb.to_reference(orb.to_text(one))
    assert orb.hash_of(again) == orb.hash_of(one) != orb.hash_of(other)
    elsewhere = orb.to_reference("corbaloc::192.0.2.1:5,:192.0.2.2:6/a.key")
    assert object_key(orb.to_text(elsewhere)) == b"a.key"
    assert orb.servant_of(elsewhere) is None
    orb.deactivate(first)
    orb.deactivate(second)


@pytest.mark.parametrize(
    "text", ["", "IOR:", "IOR:zz", "IOR:00", "IOR:" + "ff" * 200, "IOR:01000000" + "00" * 30]
)
def test_texts_without_a_key_have_none(text: str) -> None:
    assert object_key(text) == b""


def test_a_key_of_another_process_is_not_ours(orb: Orb) -> None:
    """Keys are names: `manager` is that of every manager."""
    ours = Target()
    orb.activate(ours, "manager")
    theirs = orb.to_reference("corbaloc::192.0.2.1:2810/manager")
    assert orb.servant_of(theirs) is None
    orb.deactivate(ours)


def test_servants_are_dropped_when_their_calls_are_long_over(orb: Orb) -> None:
    now = 0.0
    adapter = Adapter(orb._adapter._poa, orb._adapter._keyed, clock=lambda: now)
    servant = Target()
    watched = weakref.ref(servant)
    adapter.activate(servant)
    adapter.deactivate(servant)
    del servant
    gc.collect()
    assert watched() is not None
    now = RETIRED_SECONDS + 1.0
    second = Target()
    also_watched = weakref.ref(second)
    reference = adapter.activate(second)
    assert watched() is None
    adapter.deactivate(second)
    del second
    now *= 3
    assert adapter.find(reference) is None
    assert also_watched() is None
    adapter.close()


def test_servants_that_come_and_go_fast_do_not_pile_up(orb: Orb) -> None:
    adapter = Adapter(orb._adapter._poa, orb._adapter._keyed, clock=lambda: 0.0)
    watched = []
    for _ in range(1100):
        servant = Target()
        watched.append(weakref.ref(servant))
        adapter.activate(servant)
        adapter.deactivate(servant)
    del servant
    gc.collect()
    assert 1000 <= sum(one() is not None for one in watched) <= 1001
    adapter.close()


def test_a_place_keeps_its_reference(orb: Orb) -> None:
    servant = Target()
    place = orb.reserve(servant)
    for _ in range(2):
        with pytest.raises(CORBA.OBJECT_NOT_EXIST):
            place.reference._narrow(OpenRTM.InPortCdr).put(b"")
        place.activate()
        place.activate()
        assert place.reference._narrow(OpenRTM.InPortCdr).put(b"") == OpenRTM.PORT_OK
        place.deactivate()
        place.deactivate()


MANY_THREADS = """
import threading
from muros.rtc.corba import start_orb
from muros.rtc.corba._stubs import OpenRTM, OpenRTM__POA

orb = start_orb("127.0.0.1:")

class Target(OpenRTM__POA.InPortCdr):
    pass

def come_and_go():
    for _ in range(4000):
        servant = Target()
        reference = orb.activate(servant)
        orb.hash_of(reference)
        assert orb.servant_of(reference) is servant
        orb.deactivate(servant)

threads = [threading.Thread(target=come_and_go) for _ in range(4)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
orb.shutdown()
"""


def test_objects_come_and_go_in_many_threads() -> None:
    """Two threads must not wait for each other, one with Python's lock and one with that of the ORB's table."""
    done = subprocess.run(
        [sys.executable, "-c", MANY_THREADS], capture_output=True, text=True, timeout=40, check=False
    )
    assert done.returncode == 0, done.stderr


CALLED = """
import sys, threading
from muros.rtc.corba import start_orb
from muros.rtc.corba._stubs import OpenRTM, OpenRTM__POA

orb = start_orb("127.0.0.1:")
threads = []

class Target(OpenRTM__POA.InPortCdr):
    def put(self, data):
        threads.append(threading.current_thread())
        return OpenRTM.PORT_OK

print(orb.to_text(orb.activate(Target())), flush=True)
sys.stdin.readline()
orb.shutdown()
print(len(threads), sum(thread in threading.enumerate() for thread in threads))
"""


def test_the_threads_of_the_orb_end_with_it(orb: Orb) -> None:
    """Or else a process that ends at once is aborted now and then."""
    with subprocess.Popen(
        [sys.executable, "-c", CALLED], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        target = orb.to_reference(process.stdout.readline())._narrow(OpenRTM.InPortCdr)
        for _ in range(5):
            target.put(b"")
        out, _ = process.communicate("\n", timeout=20)
    assert out.split() == ["5", "0"]
    assert process.returncode == 0
