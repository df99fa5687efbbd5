"""Many threads at once: nothing is lost that policies keep, nothing comes twice, each sender's order stays."""

from __future__ import annotations

import threading

import pytest

from muros.rtc.codes import DataPortStatus
from muros.rtc.data import DataInPort, DataOutPort, connect
from tests.rtc.data.kit import TimedLong, TimedLongType, long

SENDERS = 3
VALUES = 200
KEEP_ALL = {
    "buffer.length": 4,
    "buffer.write.full_policy": "block",
    "buffer.write.timeout": 0,
    "buffer.read.empty_policy": "block",
    "buffer.read.timeout": 0,
}


@pytest.mark.parametrize("interface", ["corba_cdr", "direct"])
@pytest.mark.parametrize(
    "subscription",
    [
        {"subscription_type": "flush"},
        {"subscription_type": "new", "publisher.push_policy": "all"},
        {"subscription_type": "new", "publisher.push_policy": "fifo"},
        {"subscription_type": "periodic", "publisher.push_policy": "all", "push_rate": 2000},
        {"dataflow_type": "pull", "outport.buffer.read.empty_policy": "do_nothing"},
    ],
    ids=["flush", "all", "fifo", "periodic", "pull"],
)
def test_every_value_comes_once_and_in_order(interface: str, subscription: dict[str, object]) -> None:
    codec = TimedLongType()
    in_: DataInPort[TimedLong] = DataInPort("in", codec)
    outs = [DataOutPort(f"out{number}", codec) for number in range(SENDERS)]
    for out in outs:
        connect(out, in_, options={"interface_type": interface, **KEEP_ALL, **subscription})

    def send(number: int) -> None:
        for n in range(VALUES):
            assert outs[number].write(long(number * VALUES + n))

    threads = [threading.Thread(target=send, args=(number,), daemon=True) for number in range(SENDERS)]
    for thread in threads:
        thread.start()
    came: list[int] = []
    while len(came) < SENDERS * VALUES:
        status, value = in_.try_read()
        if status is DataPortStatus.PORT_OK:
            came.append(value.data)
        else:
            assert status in (DataPortStatus.RECV_EMPTY, DataPortStatus.RECV_TIMEOUT)
    for thread in threads:
        thread.join(10)
    assert not in_.is_new()
    for number in range(SENDERS):
        mine = [value for value in came if value // VALUES == number]
        assert mine == list(range(number * VALUES, (number + 1) * VALUES))
    in_.disconnect_all()


def test_connections_come_and_go_while_values_do() -> None:
    codec = TimedLongType()
    in_: DataInPort[TimedLong] = DataInPort("in", codec)
    out: DataOutPort[TimedLong] = DataOutPort("out", codec)
    stop = threading.Event()

    def send() -> None:
        while not stop.is_set():
            out.write(long(1))

    def read() -> None:
        while not stop.is_set():
            in_.read()
            in_.is_new()

    threads = [threading.Thread(target=work, daemon=True) for work in (send, read)]
    for thread in threads:
        thread.start()
    try:
        for number in range(60):
            kind = ("flush", "new", "periodic")[number % 3]
            profile = connect(out, in_, options={"interface_type": "corba_cdr", "subscription_type": kind})
            out.disconnect(profile.connector_id)
    finally:
        stop.set()
        for thread in threads:
            thread.join(10)
    assert not any(thread.is_alive() for thread in threads)
    assert not in_.connector_infos
    assert not out.connector_infos
