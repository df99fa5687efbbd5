"""Faults: slow receivers, callbacks that raise or block, peers that have gone, octets that are nothing."""

from __future__ import annotations

import threading

import pytest

from muros.rtc.codes import DataPortStatus, PeerLostError, PortStatus, ReturnCode
from muros.rtc.data import (
    Changes,
    ConnectorEvent,
    ConnectorInfo,
    DataError,
    DataEvent,
    DataInPort,
    _publishers,
)
from tests.rtc.data.kit import Ends, MemoryTransport, Pair, TimedLong, TimedLongType, long
from tests.rtc.data.test_behaviour import wait_for


class Wire:
    """Puts faults into the way from the OutPort to the InPort, or back."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.reached: list[Ends] = []
        reach = MemoryTransport._reach

        def remember(connection: object, name: str) -> Ends:
            ends = reach(connection, name)  # type: ignore[arg-type]
            self.reached.append(ends)
            return ends

        monkeypatch.setattr(MemoryTransport, "_reach", staticmethod(remember))

    def fault(self, *faults: Exception | PortStatus) -> None:
        self.reached[-1].faults += faults


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Wire:
    return Wire(monkeypatch)


def test_a_dead_peer_of_a_flush_connection_is_dropped_in_that_write(pair: Pair, wire: Wire) -> None:
    pair.connect()
    assert pair.out.write(long(1))
    wire.fault(PeerLostError("its process has ended"))
    assert not pair.out.write(long(2))
    assert pair.out.status == [DataPortStatus.CONNECTION_LOST]
    assert not pair.out.connectors
    assert not pair.out.connector_infos
    assert "connection-lost" in pair.codes()
    assert not pair.out.write(long(3))
    assert pair.out.status == []
    pair.connect()
    assert pair.out.write(long(4)), "the ports can be connected again"


def test_a_dead_peer_of_a_new_connection_is_dropped_at_the_next_write(pair: Pair, wire: Wire) -> None:
    pair.connect({"dataport.subscription_type": "new"})
    wire.fault(PeerLostError("its process has ended"))
    assert pair.out.write(long(1))
    wait_for(lambda: "connection-lost" in pair.codes())
    wait_for(lambda: not pair.out.write(long(2)))
    assert not pair.out.connectors


def test_a_dead_peer_of_a_pulled_connection_is_dropped_in_that_read(pair: Pair, wire: Wire) -> None:
    pair.connect({"dataport.dataflow_type": "pull"})
    pair.out.write(long(7))
    assert pair.in_.try_read() == (DataPortStatus.PORT_OK, long(7))
    wire.fault(PeerLostError("its process has ended"))
    assert pair.in_.try_read() == (DataPortStatus.CONNECTION_LOST, long(7))
    assert not pair.in_.connectors
    assert pair.in_.try_read() == (DataPortStatus.PRECONDITION_NOT_MET, long(7))


@pytest.mark.parametrize(
    ("answer", "status"),
    [
        (PortStatus.PORT_ERROR, DataPortStatus.PORT_ERROR),
        (PortStatus.UNKNOWN_ERROR, DataPortStatus.UNKNOWN_ERROR),
        (PortStatus.BUFFER_EMPTY, DataPortStatus.UNKNOWN_ERROR),
        (ValueError("from a transport"), DataPortStatus.UNKNOWN_ERROR),
    ],
)
def test_other_answers(
    pair: Pair, wire: Wire, answer: PortStatus | Exception, status: DataPortStatus
) -> None:
    pair.connect()
    pair.listen()
    wire.fault(answer)
    assert not pair.out.write(long(1))
    assert pair.out.status == [status]
    assert pair.heard == ["OutPort.ON_SEND(1)", "OutPort.ON_RECEIVER_ERROR(1)"]
    assert pair.findings
    assert pair.out.write(long(2))


def test_a_receiver_that_is_silent_is_not_said_to_have_answered(pair: Pair, wire: Wire) -> None:
    pair.connect()
    wire.fault(PortStatus.BUFFER_TIMEOUT)
    assert not pair.out.write(long(1))
    assert [finding.why for finding in pair.findings] == ["it did not answer, or have room, in time"]


def test_other_answers_to_a_pull(pair: Pair, wire: Wire) -> None:
    pair.connect({"dataport.dataflow_type": "pull"})
    pair.listen()
    wire.fault(PortStatus.BUFFER_TIMEOUT, PortStatus.PORT_ERROR, ValueError("from a transport"))
    statuses = [pair.in_.try_read()[0] for _ in range(3)]
    assert statuses == [
        DataPortStatus.RECV_TIMEOUT,
        DataPortStatus.PORT_ERROR,
        DataPortStatus.UNKNOWN_ERROR,
    ]
    assert pair.heard == [
        "InPort.ON_SENDER_TIMEOUT(None)",
        "InPort.ON_SENDER_ERROR(None)",
        "InPort.ON_SENDER_ERROR(None)",
    ]


@pytest.mark.parametrize("empty", ["readback", "do_nothing"])
def test_malformed_octets_are_counted_and_the_previous_value_stays(
    pair: Pair, wire: Wire, empty: str
) -> None:
    profile = pair.connect({"dataport.inport.buffer.read.empty_policy": empty})
    pair.out.write(long(5))
    assert pair.in_.read() == long(5)
    pair.listen()
    for octets in (b"", b"short", bytes(13)):
        assert wire.reached[-1].put(octets) is PortStatus.PORT_OK, "nobody looks before it is read"
    pair.heard.clear()
    for _ in range(3):
        assert pair.in_.try_read() == (DataPortStatus.PORT_ERROR, long(5))
    assert pair.in_.read() == long(5)
    assert pair.codes().count("malformed-data") == 1, (
        "the first is told, then the tenth, and the rest at the end"
    )
    link = pair.in_.link(profile.connector_id)
    assert link is not None
    assert link.malformed == 3
    assert pair.heard == ["InPort.ON_BUFFER_EMPTY(None)"]
    assert pair.out.write(long(6))
    assert pair.in_.try_read() == (DataPortStatus.PORT_OK, long(6)), "the connection lives"


def test_a_value_that_does_not_fit_its_type_is_the_writers_fault(pair: Pair) -> None:
    pair.connect()
    with pytest.raises(DataError, match="TimedLong"):
        pair.out.write(long(1 << 40))
    assert pair.out.write(long(1))


def test_callbacks_that_raise_are_told_and_harm_nobody(pair: Pair) -> None:
    def fail(*arguments: object) -> TimedLong:
        raise RuntimeError("user's mistake")

    pair.connect()
    for event in DataEvent:
        pair.out.add_listener(event, fail)
        pair.in_.add_listener(event, fail)
    pair.out.on_write = fail
    pair.in_.on_read = fail
    assert pair.out.write(long(3))
    assert pair.in_.try_read() == (DataPortStatus.PORT_OK, long(3))
    assert {"listener-failed", "callback-failed"} <= set(pair.codes())
    assert any("user's mistake" in finding.why for finding in pair.findings)
    pair.in_.on_read_convert = fail
    assert pair.in_.read() == long(3)
    pair.out.on_write_convert = fail
    assert not pair.out.write(long(4)), "what could not be converted is not sent"
    assert pair.out.status == [DataPortStatus.INVALID_ARGS]
    assert not pair.in_.is_new()


def test_a_receiver_that_blocks_does_not_hold_up_the_writer_of_a_new_connection(
    pair: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_publishers, "JOIN_TIME", 0.05)
    entered, leave = threading.Event(), threading.Event()

    def block(info: ConnectorInfo, value: TimedLong) -> None:
        entered.set()
        leave.wait(10)

    profile = pair.connect({"dataport.subscription_type": "new"})
    pair.in_.add_listener(DataEvent.ON_RECEIVED, block)
    try:
        assert pair.out.write(long(1))
        assert entered.wait(10)
        assert all(pair.out.write(long(number)) for number in range(2, 30))
        link = pair.out.link(profile.connector_id)
        assert link is not None
        assert link.overwritten > 0, "the oldest make room"
        assert "values-overwritten" in pair.codes()
        assert pair.out.disconnect_all() is ReturnCode.RTC_OK, "ends though the receiver still blocks"
    finally:
        leave.set()
    wait_for(lambda: not publishers())


def test_publishers_leave_no_threads(pair: Pair) -> None:
    for subscription in ("new", "periodic"):
        for _ in range(10):
            pair.connect({"dataport.subscription_type": subscription})
            pair.out.write(long(1))
            assert publishers()
            pair.out.disconnect_all()
        wait_for(lambda: not publishers())


def test_who_waits_for_a_value_is_let_go_by_a_disconnection(pair: Pair) -> None:
    pair.connect(
        {"dataport.inport.buffer.read.empty_policy": "block", "dataport.inport.buffer.read.timeout": "0"}
    )
    answers: list[tuple[DataPortStatus, TimedLong]] = []
    reader = threading.Thread(target=lambda: answers.append(pair.in_.try_read()), daemon=True)
    reader.start()
    pair.out.disconnect_all()
    reader.join(10)
    assert answers
    assert answers[0][1] == long(-1)


def test_who_waits_for_a_value_gets_it(pair: Pair) -> None:
    pair.connect(
        {"dataport.inport.buffer.read.empty_policy": "block", "dataport.inport.buffer.read.timeout": "0"}
    )
    answers: list[tuple[DataPortStatus, TimedLong]] = []
    reader = threading.Thread(target=lambda: answers.append(pair.in_.try_read()), daemon=True)
    reader.start()
    pair.out.write(long(9))
    reader.join(10)
    assert answers == [(DataPortStatus.PORT_OK, long(9))]


def test_who_waits_for_room_gets_it(pair: Pair) -> None:
    pair.connect(
        {
            "dataport.inport.buffer.length": "1",
            "dataport.inport.buffer.write.full_policy": "block",
            "dataport.inport.buffer.write.timeout": "0",
        }
    )
    pair.out.write(long(1))
    writer = threading.Thread(target=lambda: pair.out.write(long(2)), daemon=True)
    writer.start()
    assert pair.in_.read() == long(1)
    writer.join(10)
    assert not writer.is_alive()
    assert pair.in_.try_read() == (DataPortStatus.PORT_OK, long(2))


def test_a_full_receiver_of_a_new_connection_gets_what_waits_once_it_reads(pair: Pair) -> None:
    pair.connect(
        {
            "dataport.subscription_type": "new",
            "dataport.publisher.push_policy": "all",
            "dataport.inport.buffer.length": "1",
            "dataport.inport.buffer.write.full_policy": "do_nothing",
        }
    )
    pair.out.write(long(1))
    wait_for(pair.in_.is_new)
    pair.out.write(long(2))
    wait_for(lambda: "values-refused" in pair.codes())
    assert pair.in_.read() == long(1)
    pair.out.write(long(3))
    wait_for(pair.in_.is_new)
    assert pair.in_.read() == long(2)


def test_nothing_is_decoded_for_nobody() -> None:
    pair = Pair()
    pair.connect()
    for number in range(5):
        pair.out.write(long(number))
    assert (pair.codec.encoded, pair.codec.decoded) == (5, 0)
    pair.in_.read()
    assert (pair.codec.encoded, pair.codec.decoded) == (5, 1)
    pair.out.disconnect_all()


def test_values_are_the_readers_own(pair: Pair) -> None:
    for interface in ("corba_cdr", "direct"):
        pair.connect({"dataport.interface_type": interface})
        mine = long(1)
        pair.out.write(mine)
        mine.data = 2
        first = pair.in_.read()
        first.tm.sec = 99
        first.data = 3
        assert pair.in_.read() == long(1), "read back as it came"
        pair.out.disconnect_all()


def test_listeners_may_change_the_value(pair: Pair) -> None:
    def double(info: ConnectorInfo, value: TimedLong) -> Changes:
        value.data *= 2
        return Changes.DATA_CHANGED

    def replace(info: ConnectorInfo, value: TimedLong) -> tuple[Changes, TimedLong]:
        return Changes.DATA_CHANGED, long(value.data + 1)

    def look(info: ConnectorInfo, value: TimedLong) -> Changes:
        value.data = 0
        return Changes.NO_CHANGE

    pair.connect()
    pair.out.add_listener(DataEvent.ON_SEND, double)
    pair.in_.add_listener(DataEvent.ON_RECEIVED, replace)
    pair.out.write(long(10))
    assert pair.in_.read() == long(21)
    assert pair.out.remove_listener(DataEvent.ON_SEND, double)
    assert not pair.out.remove_listener(DataEvent.ON_SEND, double)
    assert pair.in_.remove_listener(DataEvent.ON_RECEIVED, replace)
    pair.in_.add_listener(DataEvent.ON_BUFFER_READ, replace)
    pair.out.write(long(10))
    assert pair.in_.read() == long(11)


def test_overwriting_where_the_newest_value_is_wanted_is_only_counted(pair: Pair) -> None:
    profile = pair.connect({"dataport.inport.buffer.length": "1"})
    for number in range(12):
        pair.out.write(long(number))
    link = pair.in_.link(profile.connector_id)
    assert link is not None
    assert link.overwritten == 11
    assert pair.in_.read() == long(11)
    pair.out.disconnect_all()
    assert pair.codes() == []


def test_overwriting_is_told(pair: Pair) -> None:
    profile = pair.connect({"dataport.inport.buffer.length": "2"})
    heard: list[int] = []
    pair.in_.add_listener(DataEvent.ON_BUFFER_OVERWRITE, lambda info, value: heard.append(value.data))
    for number in range(12):
        pair.out.write(long(number))
    assert heard == list(range(2, 12))
    link = pair.in_.link(profile.connector_id)
    assert link is not None
    assert link.overwritten == 10
    for number in range(3):
        pair.out.write(long(number))
    pair.out.disconnect_all()
    assert set(pair.codes()) == {"values-overwritten"}
    assert [finding.new for finding in pair.findings] == [1, 9, 3], (
        "the first, the tenth, the rest at the end"
    )
    assert "9 values of connection wire overwritten" in pair.findings[1].format()


def test_values_of_several_senders_come_in_the_order_of_their_arrival() -> None:
    one, two = Pair(), Pair()
    two.in_ = one.in_
    one.connect()
    profile = two.connect({"dataport.inport.buffer.length": "2"})
    one.out.write(long(1))
    two.out.write(long(2))
    one.out.write(long(3))
    assert one.in_.is_new()
    assert one.in_.new_connectors() == ["wire", "wire"]
    assert one.in_.read(profile.connector_id) == long(2)
    assert not one.in_.is_new(profile.connector_id)
    assert one.in_.is_new(["nosuch", "wire"])
    assert [one.in_.read().data for _ in range(2)] == [1, 3]
    assert one.in_.is_empty()
    one.in_.disconnect_all()


def test_values_can_be_pushed_and_pulled_at_once(pair: Pair) -> None:
    other = Pair()
    other.in_ = pair.in_
    pair.connect()
    other.connect({"dataport.dataflow_type": "pull"})
    other.out.write(long(5))
    pair.out.write(long(4))
    assert [pair.in_.try_read() for _ in range(3)] == [
        (DataPortStatus.PORT_OK, long(4)),
        (DataPortStatus.PORT_OK, long(5)),
        (DataPortStatus.PORT_OK, long(4)),
    ], "what was pushed first, then what can be fetched; then the pushed connection reads back"
    other.out.disconnect_all()


@pytest.mark.parametrize("policy", ["on_send", "on_received", "on_read"])
@pytest.mark.parametrize("dataflow", ["push", "pull"])
def test_time_stamps(policy: str, dataflow: str) -> None:
    pair = Pair()
    for port in (pair.out, pair.in_):
        port._wall = lambda: 3_000_000_004
    pair.connect({"dataport.timestamp_policy": policy, "dataport.dataflow_type": dataflow})
    mine = long(1)
    assert pair.out.write(mine)
    assert pair.in_.read().tm.sec == 3
    pair.out.disconnect_all()


def test_both_endiannesses(pair: Pair) -> None:
    for endian in ("little,big", "big,little", "big", "little"):
        pair.connect({"dataport.serializer.cdr.endian": endian})
        pair.out.write(long(258))
        assert pair.in_.read() == long(258)
        pair.out.disconnect_all()


def test_reading_all_before_and_writing_all_after(pair: Pair) -> None:
    pair.connect()
    assert not pair.out.write_after(), "there is nothing to write yet"
    assert not pair.in_.read_before()
    pair.out.value = long(6)
    assert pair.out.write_after()
    assert pair.in_.read_before()
    assert pair.in_.value == long(6)
    assert not pair.in_.read_before()


def test_what_is_read_before_anything_came() -> None:
    port = DataInPort("in", TimedLongType())
    assert port.try_read() == (DataPortStatus.PRECONDITION_NOT_MET, long(0))
    assert Pair().in_.read() == long(-1)
    assert port.is_empty()


def test_connector_listeners_know_the_connection(pair: Pair) -> None:
    seen: list[ConnectorInfo] = []
    pair.in_.add_listener(ConnectorEvent.ON_CONNECT, seen.append)
    profile = pair.connect({"dataport.inport.buffer.length": "3", "dataport.outport.buffer.length": "4"})
    assert [(info.name, info.connector_id) for info in seen] == [("wire", profile.connector_id)]
    assert seen[0].properties["buffer.length"] == "3"
    assert seen[0].properties["interface_type"] == "corba_cdr"


def publishers() -> list[threading.Thread]:
    """Threads of publishers."""
    return [thread for thread in threading.enumerate() if thread.name.startswith("port out")]


def test_a_sender_may_write_and_leave() -> None:
    pair = Pair()
    pair.connect({"dataport.inport.buffer.read.empty_policy": "do_nothing"})
    assert pair.out.write(long(1))
    assert pair.out.write(long(2))
    pair.out.disconnect_all()
    assert pair.in_.connectors == ()
    assert pair.in_.is_new()
    assert [pair.in_.try_read() for _ in range(3)] == [
        (DataPortStatus.PORT_OK, long(1)),
        (DataPortStatus.PORT_OK, long(2)),
        (DataPortStatus.PRECONDITION_NOT_MET, long(2)),
    ]
    assert not pair.in_.is_new()


def test_of_many_that_wrote_and_left_the_first_are_forgotten_and_that_is_said() -> None:
    pair = Pair()
    for number in range(10):
        pair.connect()
        assert pair.out.write(long(number))
        pair.out.disconnect_all()
    values = []
    while pair.in_.is_new():
        values.append(pair.in_.read().data)
    assert values == list(range(2, 10))
    assert pair.codes() == ["values-unread"] * 2
