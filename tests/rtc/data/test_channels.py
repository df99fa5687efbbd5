"""Duplex connections: a value goes over when its writer and a reader meet."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

import pytest

from muros.rtc.codes import DataPortStatus, PeerLostError, PortStatus, ReturnCode
from muros.rtc.data import TRANSPORTS, Connection, DataInPort, DataOutPort, TransportError
from muros.rtc.profiles import ConnectorProfile
from tests.rtc.data.kit import Pair, TimedLong, TimedLongType, long
from tests.rtc.data.test_behaviour import wait_for

CHANNEL = {"dataport.interface_type": "csp_channel", "dataport.dataflow_type": "duplex"}
AT_ONCE = {
    **CHANNEL,
    "dataport.buffer.write.full_policy": "do_nothing",
    "dataport.buffer.read.empty_policy": "do_nothing",
}
WAIT = 10.0


@dataclass
class End:
    """What stands at one end, and the way to it."""

    name: str
    operation: Callable[..., object]
    question: Callable[[], bool]
    gone: bool = False
    asked: list[bool] = field(default_factory=list)

    @property
    def properties(self) -> dict[str, End]:
        return {self.name: self}

    def put(self, octets: bytes) -> PortStatus:
        return self._call(octets)  # type: ignore[return-value]

    def get(self) -> tuple[PortStatus, bytes]:
        return self._call()  # type: ignore[return-value]

    def is_writable(self, retry: bool) -> bool:
        self.asked.append(retry)
        if self.gone:
            raise PeerLostError("nobody there")
        return self.question()

    is_readable = is_writable

    def _call(self, *arguments: object) -> object:
        if self.gone:
            raise PeerLostError("nobody there")
        return self.operation(*arguments)

    def close(self) -> None: ...


class Memory:
    """Channels inside this process."""

    def __init__(self) -> None:
        self.ends: dict[str, End] = {}

    def offer_inlet(self, connection: Connection, put: Callable[..., object], ask: Callable[[], bool]) -> End:
        return self._offer("in", put, ask)

    def offer_outlet(
        self, connection: Connection, get: Callable[..., object], ask: Callable[[], bool]
    ) -> End:
        return self._offer("out", get, ask)

    def reach_inlet(self, connection: Connection) -> End:
        return self._reach("in", connection)

    def reach_outlet(self, connection: Connection) -> End:
        return self._reach("out", connection)

    def _offer(self, name: str, call: Callable[..., object], ask: Callable[[], bool]) -> End:
        self.ends[name] = End(name, call, ask)
        return self.ends[name]

    def _reach(self, name: str, connection: Connection) -> End:
        end = connection.profile.properties.get(name)
        if not isinstance(end, End):
            raise TransportError(f"{name} is missing")
        return end


@pytest.fixture
def memory(monkeypatch: pytest.MonkeyPatch) -> Memory:
    memory = Memory()
    monkeypatch.setitem(TRANSPORTS.duplex, "csp_channel", memory)
    return memory


@pytest.fixture
def pair(memory: Memory) -> Iterator[Pair]:
    pair = Pair()
    yield pair
    pair.out.disconnect_all()


@pytest.fixture
def pool() -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor(8) as pool:
        yield pool


def writing(pool: ThreadPoolExecutor, pair: Pair, number: int) -> Future[bool]:
    """A writer who stands and waits."""
    written = pool.submit(pair.out.write, long(number))
    wait_for(pair.in_.is_new)
    return written


def test_the_writer_comes_first(pair: Pair, pool: ThreadPoolExecutor) -> None:
    pair.connect(CHANNEL)
    assert not pair.in_.is_new()
    written = writing(pool, pair, 5)
    assert not written.done()
    assert pair.in_.new_connectors() == ["wire"]
    assert pair.in_.try_read() == (DataPortStatus.PORT_OK, long(5))
    assert written.result(WAIT)
    assert pair.out.status == [DataPortStatus.PORT_OK]
    assert not pair.in_.is_new()


def test_the_reader_comes_first(pair: Pair, memory: Memory, pool: ThreadPoolExecutor) -> None:
    pair.connect(CHANNEL)
    read = pool.submit(pair.in_.try_read)
    wait_for(memory.ends["in"].question)
    assert pair.out.write(long(6))
    assert read.result(WAIT) == (DataPortStatus.PORT_OK, long(6))
    assert not memory.ends["in"].question()


def test_who_does_not_wait_is_told_at_once(pair: Pair) -> None:
    pair.connect(AT_ONCE)
    assert not pair.out.write(long(1))
    assert pair.out.status == [DataPortStatus.SEND_FULL]
    assert pair.in_.try_read() == (DataPortStatus.BUFFER_EMPTY, long(-1))
    assert not pair.in_.is_new(), "what was not taken is not there any longer"


def test_nobody_comes(pair: Pair) -> None:
    short = {"dataport.buffer.write.timeout": "0.02", "dataport.buffer.read.timeout": "0.02"}
    pair.connect({**CHANNEL, **short})
    assert not pair.out.write(long(1))
    assert pair.out.status == [DataPortStatus.SEND_TIMEOUT]
    assert pair.in_.try_read() == (DataPortStatus.BUFFER_TIMEOUT, long(-1))
    assert not pair.in_.is_new()
    assert pair.out.connectors, "the connection stands"


@pytest.mark.parametrize("readers", [1, 3])
def test_all_values_go_over_once_in_order(pair: Pair, pool: ThreadPoolExecutor, readers: int) -> None:
    """Whoever comes first, by chance: none is lost, none comes twice."""
    forever = {"dataport.buffer.write.timeout": "0", "dataport.buffer.read.timeout": "0"}
    pair.connect({**CHANNEL, **forever})
    count, got = 300, queue.SimpleQueue[int]()

    def read(times: int) -> None:
        for _ in range(times):
            got.put(pair.in_.read().data)

    reading = [pool.submit(read, count // readers) for _ in range(readers)]
    assert all(pair.out.write(long(number)) for number in range(count))
    for one in reading:
        one.result(WAIT)
    numbers = [got.get() for _ in range(count)]
    assert sorted(numbers) == list(range(count))
    assert readers > 1 or numbers == list(range(count))


def test_several_writers_take_turns(pair: Pair, pool: ThreadPoolExecutor) -> None:
    pair.connect({**CHANNEL, "dataport.buffer.write.timeout": "0", "dataport.buffer.read.timeout": "0"})
    written = [pool.submit(pair.out.write, long(number)) for number in range(4)]
    assert {pair.in_.read().data for _ in written} == {0, 1, 2, 3}
    assert all(one.result(WAIT) for one in written)


def test_a_reader_takes_one_value_of_two_channels(
    pair: Pair, memory: Memory, pool: ThreadPoolExecutor
) -> None:
    """The other writer goes on waiting: nothing is taken that nobody reads."""
    other = DataOutPort("other", TimedLongType())
    pair.connect(CHANNEL)
    profile = ConnectorProfile("second", "", (other, pair.in_), CHANNEL)
    assert other.connect(profile)[0] is ReturnCode.RTC_OK
    first = writing(pool, pair, 1)
    second = pool.submit(other.write, long(2))
    wait_for(lambda: pair.in_.is_new("second"))
    assert pair.in_.read("second").data == 2
    assert second.result(WAIT)
    assert not first.done()
    assert pair.in_.read().data == 1
    assert first.result(WAIT)
    other.disconnect_all()


@pytest.mark.parametrize("end", ["in", "out", "asked"])
def test_a_peer_that_has_gone(pair: Pair, memory: Memory, end: str) -> None:
    pair.connect(CHANNEL)
    memory.ends["in" if end == "in" else "out"].gone = True
    if end == "in":
        assert not pair.out.write(long(1))
        assert pair.out.status == [DataPortStatus.CONNECTION_LOST]
        assert not pair.out.connectors
    else:
        if end == "asked":
            assert not pair.in_.is_new()
        else:
            assert pair.in_.try_read() == (DataPortStatus.CONNECTION_LOST, long(-1))
        assert not pair.in_.connectors
    assert pair.codes() == ["connection-lost"]


@pytest.mark.parametrize("end", ["in", "out"])
def test_a_peer_that_goes_while_the_other_waits_for_ever(
    pair: Pair, memory: Memory, pool: ThreadPoolExecutor, end: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("_channel", "in_port"):
        monkeypatch.setattr(f"muros.rtc.data.{module}.ASK_AGAIN", 0.01)
    pair.connect({**CHANNEL, "dataport.buffer.write.timeout": "0", "dataport.buffer.read.timeout": "0"})
    if end == "in":
        written = writing(pool, pair, 1)
        wait_for(lambda: True in memory.ends["in"].asked)
        memory.ends["in"].gone = True
        assert not written.result(WAIT)
        assert pair.out.status == [DataPortStatus.CONNECTION_LOST]
    else:
        read = pool.submit(pair.in_.try_read)
        wait_for(memory.ends["in"].question)
        memory.ends["out"].gone = True
        assert read.result(WAIT)[0] is DataPortStatus.CONNECTION_LOST


def test_a_connection_that_ends_lets_both_go(pair: Pair, memory: Memory, pool: ThreadPoolExecutor) -> None:
    forever = {"dataport.buffer.write.timeout": "0", "dataport.buffer.read.timeout": "0"}
    pair.connect({**CHANNEL, **forever})
    written = writing(pool, pair, 1)
    pair.out.disconnect_all()
    assert not written.result(WAIT)
    pair.connect({**CHANNEL, **forever})
    read = pool.submit(pair.in_.try_read)
    wait_for(memory.ends["in"].question)
    pair.in_.disconnect_all()
    assert read.result(WAIT)[0] is not DataPortStatus.PORT_OK


def test_a_put_and_a_get_at_the_same_time_give_one_value(
    pair: Pair, memory: Memory, pool: ThreadPoolExecutor
) -> None:
    """The reader comes while the writer's put is on its way: get waits for what becomes of it."""
    pair.connect(CHANNEL)
    arrived, go = threading.Event(), threading.Event()
    put = memory.ends["in"].operation

    def slow(octets: bytes) -> object:
        answer = put(octets)  # refused, nobody reads yet
        arrived.set()
        assert go.wait(WAIT)
        return answer

    asked, get = threading.Event(), memory.ends["out"].operation

    def asking() -> object:
        asked.set()
        return get()

    memory.ends["in"].operation, memory.ends["out"].operation = slow, asking
    written = pool.submit(pair.out.write, long(9))
    assert arrived.wait(WAIT)
    read = pool.submit(pair.in_.try_read)
    assert asked.wait(WAIT)
    go.set()
    assert read.result(WAIT) == (DataPortStatus.PORT_OK, long(9))
    assert written.result(WAIT)
    assert not pair.in_.is_new()


def test_a_put_while_the_reader_asks_is_neither_taken_nor_missed(
    pair: Pair, memory: Memory, pool: ThreadPoolExecutor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What get found is read before what comes meanwhile; and who found nothing asks again."""
    for module in ("_channel", "in_port"):
        monkeypatch.setattr(f"muros.rtc.data.{module}.ASK_AGAIN", 10 * WAIT)
    forever = {"dataport.buffer.write.timeout": "0", "dataport.buffer.read.timeout": "0"}
    pair.connect({**CHANNEL, **forever})
    answered, go = threading.Event(), threading.Event()
    get = memory.ends["out"].operation

    def slow() -> object:
        answer = get()
        if not answered.is_set():
            answered.set()
            assert go.wait(WAIT)
        return answer

    memory.ends["out"].operation = slow
    read = pool.submit(pair.in_.read)
    assert answered.wait(WAIT)  # with nothing, which the reader does not know yet
    written = writing(pool, pair, 1)
    assert not read.done()
    go.set()
    assert read.result(WAIT) == long(1), "without waiting for the next look"
    assert written.result(WAIT)

    answered.clear()
    go.clear()
    written = writing(pool, pair, 2)
    read = pool.submit(pair.in_.read)
    assert answered.wait(WAIT)  # with the value
    assert written.result(WAIT)
    written = writing(pool, pair, 3)
    go.set()
    assert read.result(WAIT) == long(2)
    assert pair.in_.read() == long(3)
    assert written.result(WAIT)


def test_octets_that_are_no_value(pair: Pair, memory: Memory) -> None:
    pair.connect({**AT_ONCE})
    memory.ends["out"].operation = lambda: (PortStatus.PORT_OK, b"no value")
    assert pair.in_.try_read()[0] is DataPortStatus.PORT_ERROR
    assert "malformed-data" in pair.codes()


@pytest.mark.parametrize("answer", [status for status in PortStatus if status is not PortStatus.PORT_OK])
def test_a_peer_that_says_no(pair: Pair, memory: Memory, answer: PortStatus) -> None:
    pair.connect(AT_ONCE)
    memory.ends["in"].operation = lambda octets: answer
    memory.ends["out"].operation = lambda: (answer, b"")
    assert not pair.out.write(long(1))
    assert pair.in_.try_read() == (DataPortStatus.BUFFER_EMPTY, long(-1))


def test_a_channel_has_two_ends(memory: Memory) -> None:
    codec = TimedLongType()
    out: DataOutPort[TimedLong] = DataOutPort("out", codec)
    ins = [DataInPort(name, codec) for name in ("in", "in2")]
    for ports in ((out, *ins), (out,), (ins[0],), tuple(ins)):
        code, _ = ports[0].connect(ConnectorProfile("wire", "", ports, CHANNEL))
        assert code is ReturnCode.BAD_PARAMETER
        assert not any(port.connectors or port.connector_infos for port in (out, *ins))


@pytest.mark.parametrize("dataflow", ["push", "pull"])
def test_a_channel_is_duplex(pair: Pair, dataflow: str) -> None:
    assert pair.ask({**CHANNEL, "dataport.dataflow_type": dataflow})[0] is ReturnCode.BAD_PARAMETER
    assert pair.ask({**CHANNEL, "dataport.interface_type": "direct"})[0] is ReturnCode.BAD_PARAMETER


def test_profiles_tell_of_it(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    properties = dict(pair.in_.profile().properties)
    assert properties["dataport.dataflow_type"] == "push,pull,duplex"
    assert "csp_channel" in properties["dataport.interface_type"].split(",")
    monkeypatch.delitem(TRANSPORTS.duplex, "csp_channel")
    assert dict(pair.in_.profile().properties)["dataport.dataflow_type"] == "push,pull"
