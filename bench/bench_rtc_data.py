"""Data ports of RT components beside plain omniORB: latency one way and throughput, in one process and in two.

Run from a checkout: python bench/bench_rtc_data.py [--quick] [--json FILE]

The floor is a servant written on the stubs alone whose `put` is called with octets, measured in the same run, turn by
turn. Latency: one value every 2 ms, from `write` to the listener that holds the value. Throughput: writes without a
pause; nobody reads, so the InPort's buffer overwrites.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "src")]

from bench._rtc_data_worker import STAMP, TYPES, Receiver  # noqa: E402
from muros.rtc.codes import ReturnCode  # noqa: E402
from muros.rtc.corba import data_type_of  # noqa: E402
from muros.rtc.data import DataOutPort, connect  # noqa: E402
from muros.rtc.profiles import ConnectorProfile  # noqa: E402

LIMIT_S = 30.0
"""How long any one step may take."""

PERIOD = 0.002
"""Seconds between two values whose latency is measured."""

BASE = {"dataport.interface_type": "corba_cdr", "dataport.dataflow_type": "push"}
WAYS: Mapping[str, Mapping[str, str]] = {
    "flush": {**BASE, "dataport.subscription_type": "flush"},
    "new": {
        **BASE,
        "dataport.subscription_type": "new",
        "dataport.publisher.push_policy": "all",
        "dataport.outport.buffer.write.full_policy": "block",
    },
    "shared_memory": {
        **BASE, "dataport.interface_type": "shared_memory", "dataport.subscription_type": "flush",
    },
    "direct": {},
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Sizes:
    """How much is measured."""

    values: int = 400
    seconds: float = 1.0
    turns: int = 3


FULL = Sizes()
QUICK = Sizes(values=20, seconds=0.05, turns=1)


class Side(Protocol):
    """The receiving side: this process, or another one."""

    def do(self, what: str, **more: Any) -> Any: ...


class Here:
    """The receiving side in this process."""

    def __init__(self, receiver: Receiver) -> None:
        self.receiver = receiver

    def do(self, what: str, **more: Any) -> Any:
        return getattr(self.receiver, what)(**more)


class There:
    """The receiving side in a process of its own."""

    def __init__(self) -> None:
        script = str(Path(__file__).with_name("_rtc_data_worker.py"))
        self.process = subprocess.Popen(
            [sys.executable, script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.reference = self._answer()

    def do(self, what: str, **more: Any) -> Any:
        if what == "floor":
            return self.reference
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps({"do": what, **more}) + "\n")
        self.process.stdin.flush()
        return self._answer()

    def _answer(self) -> Any:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError("the receiving process has ended")
        return json.loads(line)["result"]

    def close(self) -> None:
        """Ends the process."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        self.process.wait(LIMIT_S)
        assert self.process.stdout is not None
        self.process.stdout.close()


Write = Callable[[], object]


def plain_writer(side: Side, size: str) -> Write:
    """The floor's way to write one value."""
    from muros.rtc.corba import current_orb
    from muros.rtc.corba._stubs import OpenRTM

    reference = current_orb().to_reference(side.do("floor"))._narrow(OpenRTM.InPortCdr)
    rest = bytes(4 if size == "TimedLong" else 65536 + 4)

    def write() -> None:
        reference.put(STAMP.pack(*divmod(time.monotonic_ns(), 1_000_000_000)) + rest)

    return write


@contextmanager
def port_writer(side: Side, size: str, way: str) -> Iterator[Write]:
    """A connected OutPort's way to write one value."""
    data_type = data_type_of(TYPES[size])
    port: DataOutPort[Any] = DataOutPort("out", data_type)
    if way == "direct":
        assert isinstance(side, Here)
        connect(port, side.receiver.ports[size], options={"inport.buffer.length": 8})
    else:
        agreed = side.do("connect", size=size, properties=dict(WAYS[way]))
        code, _ = port.connect(ConnectorProfile("bench", "", (port,), {**agreed, **WAYS[way]}))
        if code is not ReturnCode.RTC_OK:
            raise RuntimeError(f"{way}: {code.name}")
    value = data_type.default()
    if size != "TimedLong":
        value.data = bytes(65536)
    tm = value.tm

    def write() -> None:
        tm.sec, tm.nsec = divmod(time.monotonic_ns(), 1_000_000_000)
        port.write(value)

    try:
        yield write
    finally:
        port.disconnect_all()
        side.do("disconnect")


def latency(side: Side, write: Write, sizes: Sizes) -> list[int]:
    """Delays in ns, of values a period apart."""
    side.do("look", looks=True)
    side.do("take")
    due = time.monotonic()
    for _ in range(sizes.values):
        write()
        due += PERIOD
        time.sleep(max(0.0, due - time.monotonic()))
    side.do("wait", count=sizes.values)
    delays: list[int] = side.do("take")["delays"]
    return delays


def throughput(side: Side, write: Write, sizes: Sizes) -> float:
    """Values a second."""
    side.do("look", looks=False)
    begin = now = time.perf_counter()
    count = 0
    while now - begin < sizes.seconds:
        for _ in range(100):
            write()
        count += 100
        now = time.perf_counter()
    return count / (now - begin)


def measure(where: str, side: Side, ways: list[str], sizes: Sizes) -> list[dict[str, Any]]:
    """Rows: each way beside the floor, measured in turns."""
    rows = []
    for size in TYPES:
        floor = plain_writer(side, size)
        for way in ways:
            delays: dict[str, list[int]] = {"floor": [], "ours": []}
            rates: dict[str, list[float]] = {"floor": [], "ours": []}
            with port_writer(side, size, way) as ours:
                for _ in range(sizes.turns):
                    for name, write in (("floor", floor), ("ours", ours)):
                        delays[name] += latency(side, write, sizes)
                        rates[name].append(throughput(side, write, sizes))
            row: dict[str, Any] = {"where": where, "way": way, "value": size}
            for name in ("ours", "floor"):
                ordered = sorted(delays[name])
                row[f"{name} p50 us"] = round(statistics.median(ordered) / 1000, 1)
                row[f"{name} p99 us"] = round(ordered[int(0.99 * (len(ordered) - 1))] / 1000, 1)
                row[f"{name} values/s"] = round(statistics.median(rates[name]))
            row["latency / floor"] = round(row["ours p50 us"] / row["floor p50 us"], 2)
            row["floor / rate"] = round(row["floor values/s"] / row["ours values/s"], 2)
            rows.append(row)
            print("  ".join(f"{key} {text}" for key, text in row.items()), flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="a moment of each, to see that it works")
    parser.add_argument("--json", metavar="FILE", help="where to put the rows")
    arguments = parser.parse_args()
    sizes = QUICK if arguments.quick else FULL
    receiver = Receiver()
    rows = measure("one process", Here(receiver), ["flush", "new", "direct"], sizes)
    there = There()
    try:
        rows += measure("two processes", there, ["flush", "new", "shared_memory"], sizes)
    finally:
        there.close()
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(rows, indent=1))
    receiver.orb.shutdown()


if __name__ == "__main__":
    main()
