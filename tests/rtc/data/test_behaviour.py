"""Data ports behave as the recorded ones of OpenRTM-aist-Python 2.1, except where a test here says why not."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from muros.rtc.codes import DataPortStatus, ReturnCode
from tests.rtc.data.kit import Pair, long

Case = dict[str, Any]

CASES: dict[str, Case] = json.loads(
    (Path(__file__).parents[2] / "vectors" / "rtc" / "dataport_behaviour.json").read_text()
)["cases"]

FLUSH = [name for name in CASES if name.startswith("flush")]
NEW = [name for name in CASES if name.startswith("new ")]
PERIODIC = [name for name in CASES if name.startswith("periodic ")]
PULL = [name for name in CASES if name.startswith("pull")]
SEQUENCE = "settings kept over connections"
OVERWRITE = "InPort.ON_BUFFER_OVERWRITE"


def test_every_recorded_case_is_replayed_here() -> None:
    assert set(CASES) == {*FLUSH, *NEW, *PERIODIC, *PULL, "direct", "timestamp on_write", SEQUENCE}


@pytest.mark.parametrize("name", FLUSH)
def test_flush(pair: Pair, name: str) -> None:
    case = CASES[name]
    replay(pair, case)
    if case["properties"].get("dataport.inport.buffer.write.full_policy", "overwrite") == "overwrite":
        # The recorded one never tells of a value that was overwritten; ours does.
        lost = len(case["write_results"]) - len([read for read in case["reads"] if read["isNew"]])
        assert len([one for one in pair.heard if one.startswith(OVERWRITE)]) == lost > 0


@pytest.mark.parametrize("name", NEW)
def test_new(pair: Pair, name: str) -> None:
    """Each write is waited for, as the recorded ones were 20 ms apart."""
    replay(pair, CASES[name], sent_counter(pair, name))


@pytest.mark.parametrize("name", PERIODIC)
def test_periodic(pair: Pair, name: str) -> None:
    """Which period a value falls into depends on the machine; what is sent, and in which order, does not."""
    case = CASES[name]
    pair.listen()
    pair.connect({**case["properties"], "dataport.publisher.push_rate": "100"})
    repeats = "policy=new" in name

    def sent() -> bool:
        last = pair.heard.count("OutPort.ON_RECEIVED(6)")
        return last > 5 if repeats else bool(last) and pair.heard[-1] == "OutPort.ON_SENDER_EMPTY(None)"

    for number, wanted in enumerate(case["write_results"], 1):
        assert pair.out.write(long(number)) is wanted
    wait_for(sent)
    assert pair.out.disconnect_all() is ReturnCode.RTC_OK
    told = [one for one in pair.heard if "EMPTY" not in one and "OVERWRITE" not in one]
    for event in (
        "OutPort.ON_BUFFER_READ",
        "OutPort.ON_SEND",
        "InPort.ON_RECEIVED",
        "InPort.ON_BUFFER_WRITE",
    ):
        mine = [one for one in told if one.startswith(f"{event}(")]
        theirs = [one for one in case["listeners_during_write"] if one.startswith(f"{event}(")]
        if repeats:
            assert set(mine[-5:]) == {theirs[-1]}, "the last value is sent again each period"
        else:
            assert mine == theirs
    if not repeats:
        empty = pair.heard.index("OutPort.ON_BUFFER_EMPTY(None)")
        assert pair.heard[empty + 1] == "OutPort.ON_SENDER_EMPTY(None)"


@pytest.mark.parametrize("name", PULL)
def test_pull(pair: Pair, name: str) -> None:
    """`is_new` knows of values when the OutPort is in this process; the recorded one always says no."""
    replay(pair, with_is_new(CASES[name]))


def test_direct(pair: Pair) -> None:
    """The newest value only, as recorded; but listeners hear of it, which the recorded ones do not."""
    case = CASES["direct"]
    heard = pair.heard
    pair.listen()
    pair.connect(case["properties"])
    assert [pair.out.write(long(n)) for n in (1, 2, 3)] == case["write_results"]
    assert heard[:6] == [
        "InPort.ON_CONNECT(None)",
        "OutPort.ON_CONNECT(None)",
        "OutPort.ON_SEND(1)",
        "InPort.ON_RECEIVED(1)",
        "InPort.ON_BUFFER_WRITE(1)",
        "OutPort.ON_RECEIVED(1)",
    ]
    assert [(pair.in_.is_new(), pair.in_.read().data) for _ in case["reads"]] == [
        (read["isNew"], read["read"]) for read in case["reads"]
    ]
    assert (pair.codec.encoded, pair.codec.decoded) == (0, 0)


def test_timestamp_on_write() -> None:
    pair = Pair()
    pair.out._wall = lambda: 12_000_000_034
    replay(pair, CASES["timestamp on_write"])
    assert (pair.in_.read().tm.sec, pair.in_.read().tm.nsec) == (12, 34)
    pair.out.disconnect_all()


def test_settings_do_not_outlive_their_connection(pair: Pair) -> None:
    """The recorded InPort has one buffer for all its connections, whose settings stay. Ours has one for each."""
    first, second = CASES[SEQUENCE]["sequence"].values()
    replay(pair, first)
    pair.connect(second["properties"])
    assert [pair.out.write(long(n)) for n in range(1, 6)] == [True] * 5
    assert pair.out.status == [DataPortStatus.PORT_OK]


def sent_counter(pair: Pair, name: str) -> Callable[[int], None]:
    """Waits, after each write of a case, until what is to be sent then has been."""
    ends = ("OutPort.ON_RECEIVED(", "OutPort.ON_RECEIVER_FULL(")

    def after_write(number: int) -> None:
        count = number // 2 if "policy=skip" in name else number
        wait_for(lambda: len([one for one in pair.heard if one.startswith(ends)]) >= count)

    return after_write


def with_is_new(case: Case) -> Case:
    """A case of a pulled connection, as `is_new` ought to answer."""
    left = len(case["write_results"])
    reads = [{**read, "isNew": number < left} for number, read in enumerate(case["reads"])]
    return {**case, "reads": reads}


def replay(pair: Pair, case: Case, after_write: Callable[[int], None] = lambda number: None) -> None:
    """Connect, write 1 to n, read, disconnect; compare all that is heard."""
    pair.listen()
    code, _ = pair.ask(case["properties"])
    assert code.name == case["connect"]
    codes = []
    for number, wanted in enumerate(case["write_results"], 1):
        assert pair.out.write(long(number)) is wanted
        codes += [status.name for status in pair.out.status]
        after_write(number)
    assert codes == case["write_codes"]
    assert take(pair) == case["listeners_during_write"]
    for read in case["reads"]:
        assert pair.in_.is_new() is read["isNew"]
        assert pair.in_.read().data == read["read"]
    assert take(pair) == case["listeners_during_read"]
    assert pair.out.disconnect(pair.out.connectors[0].connector_id).name == case["disconnect"]
    assert [one.removesuffix("(None)") for one in take(pair)] == case["listeners_on_disconnect"]


def take(pair: Pair) -> list[str]:
    """What was heard since the last time, without what the recorded ones never tell."""
    heard = [one for one in pair.heard if not one.startswith(OVERWRITE)]
    pair.heard[:] = [one for one in pair.heard if one.startswith(OVERWRITE)]
    return heard


def wait_for(ready: Callable[[], bool], seconds: float = 10.0) -> None:
    deadline = time.monotonic() + seconds
    while not ready():
        assert time.monotonic() < deadline, "what was waited for did not happen"
        time.sleep(0.001)
