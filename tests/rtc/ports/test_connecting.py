"""Ports agree on connections, and leave nothing behind when they do not."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import pytest

from muros.findings import Finding
from muros.rtc.codes import PeerLostError, PortType, ReturnCode
from muros.rtc.ports import ConnectEvent, ConnectEventKind, Port
from muros.rtc.profiles import ConnectorProfile, PeerPort

OK = ReturnCode.RTC_OK
BAD = ReturnCode.BAD_PARAMETER
NO = ReturnCode.PRECONDITION_NOT_MET
ERROR = ReturnCode.RTC_ERROR


@dataclass
class Instance:
    instance_name: str


class Talker(Port):
    """Offers a property, wants those of the others; says no where it is told to."""

    def __init__(self, name: str, log: list[str] | None = None) -> None:
        self.findings: list[Finding] = []
        super().__init__(name, PortType.SERVICE, report=self.findings.append, owner=Instance("Comp0"))
        self.log = [] if log is None else log
        self.publish_code = self.subscribe_code = OK
        self.raises: Exception | None = None
        self.meanwhile: Callable[[], object] = lambda: None

    def prepare(self, profile: ConnectorProfile) -> ConnectorProfile:
        return profile.with_properties({f"{self.name}.prepared": "yes"})

    def publish_interfaces(self, profile: ConnectorProfile) -> tuple[ReturnCode, ConnectorProfile]:
        self.log.append(f"{self.name} publishes")
        if self.raises:
            raise self.raises
        return self.publish_code, profile.with_properties({f"{self.name}.offer": "an object"})

    def subscribe_interfaces(self, profile: ConnectorProfile) -> ReturnCode:
        self.log.append(f"{self.name} subscribes to {sorted(k for k in profile.properties if 'offer' in k)}")
        self.meanwhile()
        return self.subscribe_code

    def unsubscribe_interfaces(self, profile: ConnectorProfile) -> None:
        self.log.append(f"{self.name} unsubscribes")


@dataclass
class Peer:
    """A port of another process: what it is asked, and what it answers."""

    code: ReturnCode = OK
    lost: bool = False
    offers: Mapping[str, str] = field(default_factory=lambda: {"peer.offer": "IOR:00"})
    asked: list[str] = field(default_factory=list)

    __hash__ = object.__hash__

    def notify_connect(self, profile: ConnectorProfile) -> tuple[ReturnCode, ConnectorProfile]:
        self._ask("connect")
        return self.code, replace(profile.with_properties(self.offers), connector_id="its own idea", ports=())

    def notify_disconnect(self, connector_id: str) -> ReturnCode:
        self._ask(f"disconnect {connector_id}")
        return OK

    def is_there(self) -> bool:
        return not self.lost

    def _ask(self, what: str) -> None:
        if self.lost:
            raise PeerLostError("the port does not answer")
        self.asked.append(what)


def wanted(*ports: PeerPort, **more: str) -> ConnectorProfile:
    return ConnectorProfile("wanted", "", ports, more)


def test_two_ports_agree_and_part() -> None:
    log: list[str] = []
    a, b = Talker("a", log), Talker("b", log)

    code, agreed = a.connect(wanted(a, b, asked="for"))

    assert code is OK
    assert agreed.properties == {
        "asked": "for", "a.prepared": "yes", "a.offer": "an object", "b.prepared": "yes", "b.offer": "an object",
    }  # fmt: skip
    assert agreed.connector_id.count("-") == 4
    assert a.connectors[0] == agreed
    assert b.connector(agreed.connector_id) is not None
    assert log == [
        "a publishes",
        "b publishes",
        "b subscribes to ['a.offer', 'b.offer']",
        "a subscribes to ['a.offer', 'b.offer']",
    ]

    log.clear()
    assert b.disconnect(agreed.connector_id) is OK
    assert a.connectors == b.connectors == ()
    assert log == ["b unsubscribes", "a unsubscribes"]
    assert b.disconnect(agreed.connector_id) is BAD
    assert a.findings == b.findings == []


def test_connect_may_be_asked_of_any_port() -> None:
    a, b, c = Talker("a"), Talker("b"), Talker("c")
    code, agreed = c.connect(wanted(a, b))
    assert code is OK
    assert not c.connectors
    assert a.connectors
    assert b.connectors
    assert a.disconnect(agreed.connector_id) is OK


def test_three_ports_share_a_connection() -> None:
    ports = [Talker(name) for name in "abc"]
    code, _ = ports[1].connect(wanted(*ports))
    assert code is OK
    assert [len(p.connectors) for p in ports] == [1, 1, 1]
    assert ports[2].disconnect_all() is OK
    assert [len(p.connectors) for p in ports] == [0, 0, 0]


@pytest.mark.parametrize("which", [0, 1, 2])
@pytest.mark.parametrize("step", ["publish", "subscribe", "raise", "limit"])
def test_a_port_that_says_no_leaves_nothing_behind(which: int, step: str) -> None:
    log: list[str] = []
    ports = [Talker(name, log) for name in "abc"]
    told = ports[which]
    if step == "publish":
        told.publish_code = ReturnCode.UNSUPPORTED
    elif step == "subscribe":
        told.subscribe_code = ReturnCode.UNSUPPORTED
    elif step == "raise":
        told.raises = RuntimeError("out of order")
    else:
        told.configuration = {"connection_limit": "0"}

    code, _ = ports[0].connect(wanted(*ports))

    expected = {
        "publish": ReturnCode.UNSUPPORTED,
        "subscribe": ReturnCode.UNSUPPORTED,
        "raise": ERROR,
        "limit": NO,
    }
    assert code is expected[step]
    assert [p.connectors for p in ports] == [(), (), ()]
    begun = [entry[0] for entry in log if "publishes" in entry]
    assert sorted(begun) == sorted(entry[0] for entry in log if "unsubscribes" in entry)
    if step in ("raise", "limit"):
        assert any("out of order" in f.why or "0 connections of 0" in f.why for f in told.findings)
    # Nothing is reserved any more.
    told.publish_code = told.subscribe_code = OK
    told.raises, told.configuration = None, {}
    assert ports[0].connect(wanted(*ports))[0] is OK


@pytest.mark.parametrize("hook", ["prepare", "subscribe_interfaces", "unsubscribe_interfaces"])
def test_what_a_kind_of_port_raises_is_told(hook: str, monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = Talker("a"), Talker("b")

    def fail(*arguments: object) -> None:
        raise OSError("no more handles")

    monkeypatch.setattr(b, hook, fail)
    code, agreed = a.connect(wanted(a, b))
    assert code is (OK if hook == "unsubscribe_interfaces" else ERROR)
    assert a.disconnect(agreed.connector_id) is (OK if hook == "unsubscribe_interfaces" else BAD)
    assert a.connectors == b.connectors == ()
    assert "OSError: no more handles" in [f.why for f in b.findings]


def test_the_same_port_twice_is_refused() -> None:
    a, b = Talker("a"), Talker("b")
    assert a.connect(wanted(a, a))[0] is BAD
    assert a.notify_connect(replace(wanted(b, a, b), connector_id="x"))[0] is BAD
    assert "twice" in a.findings[0].why
    assert a.log == b.log == []


@pytest.mark.parametrize(
    "profile",
    [wanted(), replace(wanted(*(Talker(str(n)) for n in range(101))), name="long")],
    ids=["none", "101"],
)
def test_a_chain_that_cannot_be_walked_is_refused(profile: ConnectorProfile) -> None:
    port = Talker("a")
    assert port.connect(profile)[0] is BAD
    assert port.findings[0].code == "connect-refused"


def test_a_port_that_is_not_named_does_not_take_part() -> None:
    a, b = Talker("a"), Talker("b")
    assert a.notify_connect(replace(wanted(b), connector_id="x"))[0] is BAD
    assert a.notify_connect(wanted(a))[0] is BAD
    assert [f.why for f in a.findings] == ["the port is not among those to connect", "it has no id"]


def test_an_id_is_used_once() -> None:
    a, b, c = Talker("a"), Talker("b"), Talker("c")
    assert a.connect(replace(wanted(a, b), connector_id="mine"))[0] is OK
    assert a.connect(replace(wanted(a, c), connector_id="mine"))[0] is NO
    assert c.connect(replace(wanted(c, a), connector_id="mine"))[0] is NO
    assert len(a.connectors) == 1, "the first connection stays as it is"
    assert not c.connectors


def test_two_ports_are_connected_once_unless_permitted() -> None:
    a, b = Talker("a"), Talker("b")
    assert a.connect(wanted(a, b))[0] is OK
    assert b.connect(wanted(b, a))[0] is NO
    assert a.connect(replace(wanted(a, b), properties={"dataport.allow_dup_connection": "YES"}))[0] is OK
    a.configuration = b.configuration = {"allow_dup_connection": "yes"}
    assert a.connect(wanted(a, b))[0] is OK
    assert len(a.connectors) == len(b.connectors) == 3


def test_a_limit_that_is_no_number_is_told() -> None:
    a, b = Talker("a"), Talker("b")
    a.configuration = {"connection_limit": "many"}
    assert a.connect(wanted(a, b))[0] is OK
    assert a.findings[0].code == "bad-key"


class TestOtherProcesses:
    def test_what_a_peer_hands_back_is_taken_over_but_who_takes_part(self) -> None:
        a, peer = Talker("a"), Peer()
        code, agreed = a.connect(replace(wanted(a, peer), connector_id="mine"))
        assert code is OK
        assert agreed.properties["peer.offer"] == "IOR:00"
        assert agreed.connector_id == "mine"
        assert agreed.ports == (a, peer)

    def test_a_peer_is_told_when_this_side_cannot_go_on(self) -> None:
        a, peer = Talker("a"), Peer()
        a.subscribe_code = ERROR
        assert a.connect(replace(wanted(a, peer), connector_id="mine"))[0] is ERROR
        assert peer.asked == ["connect", "disconnect mine"]

    def test_a_peer_that_fails_half_way_is_told_to_let_go(self) -> None:
        for first in (True, False):
            a, peer = Talker("a"), Peer(code=ERROR)
            ports = (peer, a) if first else (a, peer)
            assert a.connect(replace(wanted(*ports), connector_id="mine"))[0] is ERROR
            assert peer.asked == ["connect", "disconnect mine"]
            assert not a.connectors

    def test_a_first_port_that_fails_behind_ours_leaves_nothing_here(self) -> None:
        a = Talker("a")

        class CallsOn(Peer):
            __hash__ = object.__hash__

            def notify_connect(self, profile: ConnectorProfile) -> tuple[ReturnCode, ConnectorProfile]:
                code, profile = a.notify_connect(profile)
                assert code is OK
                return ERROR, profile

        peer = CallsOn()
        assert a.connect(replace(wanted(peer, a), connector_id="mine"))[0] is ERROR
        assert peer.asked == ["disconnect mine", "disconnect mine"]
        assert a.connectors == ()
        assert a.log[-1] == "a unsubscribes"

    def test_a_peer_that_has_no_room_has_not_begun(self) -> None:
        a, peer = Talker("a"), Peer(code=NO)
        assert a.connect(replace(wanted(a, peer), connector_id="mine"))[0] is NO
        assert peer.asked == ["connect"]

    def test_a_peer_that_is_gone_cannot_be_connected(self) -> None:
        a, peer = Talker("a"), Peer(lost=True)
        assert a.connect(wanted(a, peer))[0] is BAD
        assert a.connect(wanted(peer, a))[0] is BAD
        assert not a.connectors

    @pytest.mark.parametrize("first", [True, False])
    def test_a_connection_to_a_peer_that_is_gone_can_be_ended(self, first: bool) -> None:
        a, peer = Talker("a"), Peer()
        ports = (peer, a) if first else (a, peer)
        assert a.notify_connect(replace(wanted(*ports), connector_id="mine"))[0] is OK
        peer.lost = True
        assert a.disconnect("mine") is OK
        assert a.connectors == ()
        assert a.log[-1] == "a unsubscribes"

    def test_lost_peers_are_dropped_when_somebody_looks(self) -> None:
        ports: tuple[PeerPort, ...]
        a, b, gone, stays = Talker("a"), Talker("b"), Peer(), Peer()
        ports = (a, gone, b)
        assert a.notify_connect(replace(wanted(a, b), connector_id="both"))[0] is OK
        assert a.notify_connect(replace(wanted(a, stays), connector_id="stays"))[0] is OK
        assert b.notify_connect(replace(wanted(*ports), connector_id="lost"))[0] is NO, (
            "a and b are connected"
        )
        assert b.disconnect("both") is OK
        for port in (a, b):
            assert port.notify_connect(replace(wanted(gone, port), connector_id="lost"))[0] is OK
        assert len(a.profile().connectors) == 2
        gone.lost = True
        assert [c.connector_id for c in a.profile().connectors] == ["stays"]
        assert a.findings[-1].code == "peer-lost"

    def test_one_that_raises_anything_at_all_harms_nobody(self) -> None:
        class Odd(Peer):
            def _ask(self, what: str) -> None:
                raise KeyError(what)

            def is_there(self) -> bool:
                raise KeyError("there")

        a, odd = Talker("a"), Odd()
        assert a.connect(wanted(a, odd))[0] is ERROR
        assert a.connect(wanted(odd, a))[0] is BAD
        assert a.notify_connect(replace(wanted(odd, a), connector_id="mine"))[0] is OK
        assert a.living_connectors() == ()


def test_an_end_that_overtakes_its_beginning_is_kept() -> None:
    """b ends the connection while a has yet to remember it."""
    a, b = Talker("a"), Talker("b")
    a.meanwhile = lambda: b.disconnect("mine")
    assert a.connect(replace(wanted(a, b), connector_id="mine"))[0] is ERROR
    assert a.connectors == b.connectors == ()
    assert a.log[-1] == "a unsubscribes"
    assert b.log[-1] == "b unsubscribes"


def test_listeners_hear_the_steps_in_order() -> None:
    a, b = Talker("a"), Talker("b")
    heard: list[ConnectEvent] = []
    for kind in ConnectEventKind:
        a.connect_listeners.add(kind, heard.append)
    a.connect_listeners.add(ConnectEventKind.ON_CONNECTED, lambda event: 1 / 0)
    a.connect(replace(wanted(a, b), connector_id="mine"))
    a.disconnect("mine")
    assert [(e.kind.value, e.code) for e in heard] == [
        ("ON_NOTIFY_CONNECT", None),
        ("ON_PUBLISH_INTERFACES", OK),
        ("ON_CONNECT_NEXTPORT", OK),
        ("ON_SUBSCRIBE_INTERFACES", OK),
        ("ON_CONNECTED", OK),
        ("ON_NOTIFY_DISCONNECT", None),
        ("ON_DISCONNECT_NEXT", OK),
        ("ON_UNSUBSCRIBE_INTERFACES", None),
        ("ON_DISCONNECTED", OK),
    ]
    assert [f.code for f in a.findings] == ["listener-failed"]


def test_a_plain_port_agrees_to_everything() -> None:
    a, b = Port("a", PortType.SERVICE), Port("b", PortType.SERVICE)
    a.configuration = {"connection_limit": "-1"}
    code, agreed = a.connect(wanted(a, b))
    assert (code, dict(agreed.properties)) == (OK, {})
    a.activate()
    a.deactivate()
    assert a.disconnect_all() is OK
    assert b.connector(agreed.connector_id) is None


def test_its_profile_says_what_it_is() -> None:
    port = Port(
        "out", PortType.DATA_OUT, {"dataport.data_type": "IDL:RTC/TimedLong:1.0"}, owner=Instance("Seq0")
    )
    port.configuration = {"buffer.length": "4"}
    profile = port.profile()
    assert profile.name == "Seq0.out"
    assert profile.port is port
    assert profile.properties == {
        "port.port_type": "DataOutPort",
        "dataport.data_type": "IDL:RTC/TimedLong:1.0",
        "buffer.length": "4",
    }
    assert Port("bare", PortType.DATA_IN).profile().name == "bare"


def test_many_threads_connect_and_part() -> None:
    """Both ends begin at once, all the time: nobody waits for ever, and both know the same connections."""
    ports = [Talker(name) for name in "abcd"]
    for port in ports:
        port.configuration = {"allow_dup_connection": "YES", "connection_limit": "5"}

    def work(n: int) -> None:
        for turn in range(60):
            first, second = ports[(n + turn) % 4], ports[(n + turn * 3 + 1) % 4]
            first.connect(wanted(first, second))
            if turn % 3 == 2:
                second.disconnect_all()

    threads = [threading.Thread(target=work, args=(n,)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10)
    assert not any(thread.is_alive() for thread in threads)
    for port in ports:
        assert len(port.connectors) <= 5
        for connector in port.connectors:
            assert all(isinstance(p, Port) and p.connector(connector.connector_id) for p in connector.ports)
