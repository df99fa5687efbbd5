"""Our service ports meet ports written on the RTC world's stubs alone, in both roles and both orders."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import RTC
from muros.rtc.codes import PeerLostError, ReturnCode
from muros.rtc.component import Component
from muros.rtc.corba import Objects, Orb, load_idl, set_up
from muros.rtc.profiles import ConnectorProfile, PeerPort
from muros.rtc.services import Consumer, ServicePort

IDL = Path(__file__).parent / "idl" / "Greeter.idl"
OK = ReturnCode.RTC_OK


class Foreign:
    """The other process."""

    def __init__(self, objects: Objects) -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("foreign.py")), str(IDL)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={
                **os.environ,
                "OMNIORB_CONFIG": os.devnull,
                "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            },
        )
        self.references = self._line().split()
        self.provider, self.consumer = (
            objects.port_behind(objects.orb.to_reference(text)._narrow(RTC.PortService))
            for text in self.references
        )

    def say(self, words: str) -> str:
        """Give it a line; its answer."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{words}\n")
        self.process.stdin.flush()
        return self._line()

    def end(self) -> None:
        """Kill it. Twice is allowed."""
        self.process.kill()
        self.process.wait(10)
        for stream in (self.process.stdin, self.process.stdout):
            assert stream is not None
            stream.close()

    def _line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()


class Ours(Component):
    """A port of each kind."""

    def __init__(self) -> None:
        super().__init__()
        self.volume = 3
        self.consumer = Consumer(load_idl(IDL)["Greetings"].Greeter)

    def greet(self, name: str) -> str:
        if name == "nobody":
            raise load_idl(IDL)["Greetings"].Refused("ours")
        return f"ours greets {name}"

    def on_initialize(self) -> None:
        self.p, self.c = ServicePort("p"), ServicePort("c")
        self.p.register_provider("one", "Greeter", self, load_idl(IDL)["Greetings"].Greeter)
        self.c.register_consumer("one", "Greeter", self.consumer)
        for port in (self.p, self.c):
            self.add_port(port)


@pytest.fixture
def objects(orb: Orb) -> Objects:
    return set_up(orb)


@pytest.fixture
def ours(objects: Objects) -> Iterator[Ours]:
    ours = Ours()
    ours.initialize([])
    objects.offer(ours)
    yield ours
    ours.exit()
    objects.withdraw(ours)


@pytest.fixture
def foreign(objects: Objects) -> Iterator[Foreign]:
    foreign = Foreign(objects)
    yield foreign
    foreign.end()


def connect(*ports: PeerPort, **properties: str) -> ReturnCode:
    """By one of ours, wherever that stands."""
    mine = next(port for port in ports if isinstance(port, ServicePort))
    return mine.connect(ConnectorProfile("wire", "mine", ports, properties))[0]


@pytest.mark.parametrize("ours_first", [True, False])
def test_we_call_a_foreign_provider(ours: Ours, foreign: Foreign, ours_first: bool) -> None:
    ports = (ours.c, foreign.provider) if ours_first else (foreign.provider, ours.c)
    assert connect(*ports) is OK
    assert ours.consumer.greet("us") == "foreign greets us"
    with pytest.raises(load_idl(IDL)["Greetings"].Refused):
        ours.consumer.greet("nobody")
    assert ours.c.disconnect("mine") is OK
    assert not ours.consumer.is_connected
    assert foreign.say("call x") == "nobody found"


@pytest.mark.parametrize("ours_first", [True, False])
def test_a_foreign_consumer_calls_us(ours: Ours, foreign: Foreign, ours_first: bool) -> None:
    ports = (ours.p, foreign.consumer) if ours_first else (foreign.consumer, ours.p)
    assert connect(*ports) is OK
    assert foreign.say("call you") == "not active"
    ours.p.activate()
    assert foreign.say("call you") == "ours greets you"
    assert foreign.say("call nobody") == "refused: ours"
    ours.p.deactivate()
    assert foreign.say("call you") == "not active"
    assert ours.p.disconnect_all() is OK
    assert foreign.say("call you") == "nobody found"


def reference(objects: Objects, port: ServicePort) -> str:
    return objects.orb.to_text(objects.port(port))


def test_a_foreign_port_asks_for_the_connection(ours: Ours, foreign: Foreign, objects: Objects) -> None:
    provider, consumer = foreign.references
    assert foreign.say(f"connect {provider} {reference(objects, ours.c)} strict") == "RTC_OK 1 0"
    assert ours.consumer.greet("all") == "foreign greets all"
    ours.p.activate()
    assert foreign.say(f"connect {reference(objects, ours.p)} {consumer} strict") == "RTC_OK 1 1"
    assert foreign.say("call all") == "ours greets all"
    ours.exit()
    assert foreign.say("call all") == "nobody found", "a component that ends takes leave"


@pytest.mark.parametrize("ours_first", [True, False])
def test_a_strict_connection_in_which_nothing_is_found_leaves_nothing(
    ours: Ours, foreign: Foreign, objects: Objects, ours_first: bool
) -> None:
    """Two consumers, one on each side: each finds nobody."""
    ports = (ours.c, foreign.consumer) if ours_first else (foreign.consumer, ours.c)
    assert connect(*ports, **{"port.connection.strictness": "strict"}) is ReturnCode.RTC_ERROR
    assert ours.c.connectors == ()
    assert (
        foreign.say(f"connect {reference(objects, ours.c)} {foreign.references[1]} strict") == "RTC_ERROR 0 0"
    )


def test_the_same_port_twice_is_refused_over_corba(ours: Ours, foreign: Foreign, objects: Objects) -> None:
    mine = reference(objects, ours.p)
    assert foreign.say(f"connect {mine} {mine} best_effort") == "BAD_PARAMETER 0 0"
    assert connect(ours.p, ours.p) is ReturnCode.BAD_PARAMETER
    assert connect(ours.p, foreign.consumer) is OK, "and the port works on"


def test_a_provider_that_dies_is_a_lost_peer(ours: Ours, foreign: Foreign) -> None:
    assert connect(ours.c, foreign.provider) is OK
    foreign.end()
    with pytest.raises(PeerLostError, match=r"Greeter one of port Ours0\.c"):
        ours.consumer.greet("anybody")
    assert ours.c.profile().connectors == ()
    assert not ours.consumer.is_connected
    assert connect(ours.c, foreign.provider) is ReturnCode.BAD_PARAMETER
    assert ours.c.connectors == ()
