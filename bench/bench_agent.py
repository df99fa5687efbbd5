"""The agent under raw UDP load on loopback, beside a relay that only receives and sends.

Run from a checkout: python bench/bench_agent.py [--quick] [--only latency] [--json FILE]

The agent, the relay and the load are processes of their own. A message is one WRITE_DATA of 32 bytes in a datagram of
its own. The relay is the least that a server in Python can do, measured in the same run; the columns A and B are what
the reference C++ agent reached on another day (A: 3.0.1 with its CED middleware, B: 2.4.2 with Fast DDS), on two cores
as well: they say what order of magnitude to expect, not who wins.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from random import Random
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from bench import _load as load  # noqa: E402
from bench._load import BEST_EFFORT, RELIABLE, Client  # noqa: E402
from bench._load_server import MUROS, RELAY, Server, raise_file_limit, relay_to  # noqa: E402

LIMIT_S = 60.0
"""How long any one step may take."""
HIGHEST_RATE = 240_000
"""Where the search for the highest rate begins, messages a second."""

REFERENCE: dict[str, dict[Any, tuple[str, str]]] = {
    "latency": {
        (32, "best effort"): ("199 / 1756", "224 / 1926"),
        (32, "reliable"): ("156 / 1191", "232 / 2734"),
        (512, "best effort"): ("193 / 1011", "197 / 2050"),
        (512, "reliable"): ("165 / 1437", "180 / 1924"),
    },
    "reliable": {
        (4, 1): ("30 000", "26 000"),
        (4, 10): ("90 200", "63 100"),
        (4, 100): ("75 000", "5 900"),
        (16, 1): ("76 500", "56 100"),
        (16, 10): ("88 300", "68 000"),
        (16, 100): ("61 700", "4 600"),
    },
    "delivered": {
        (4, 1): ("21 700", "15 100"),
        (4, 10): ("39 800", "20 200"),
        (16, 1): ("41 600 (81 %)", "20 100 (83 %)"),
        (16, 10): ("33 800 (74 %)", "25 800 (97 %)"),
    },
    "best-effort": {
        (1, False): ("44 900", "40 000"),
        (10, False): ("37 500", "70 000"),
        (100, False): ("37 500", "5 000"),
        (1, True): ("2 300-3 000", "2 200-5 600"),
        (10, True): ("30 000", "13 700"),
    },
    "sessions": {1: ("4 100", "15"), 10: ("10 800", "22")},
    "memory": {
        0: ("5.6 MB", "14.8 MB"),
        1: ("6.0 MB, 8, 0.2 %", "19.5 MB, 16, 0.2 %"),
        100: ("7.5 MB, 107, 4 %", "1581 MB, 808, 180 %"),
        1000: ("20.9 MB, 1007, 30 %", "-"),
    },
    "leave": {100: ("7.2 s", "9.7 s"), 1000: ("56 s", "-")},
}


@dataclass(frozen=True, slots=True)
class Sizes:
    """How much is measured."""

    seconds: float = 0.8
    """Of one throughput run."""
    rounds: int = 2
    """Runs of which the best counts: other programs only ever take away."""
    clients: tuple[int, ...] = (1, 10, 100)
    searches: int = 7
    pings: int = 600
    sessions: int = 500
    population: tuple[int, ...] = (1, 100, 1_000)
    idle: float = 2.0
    """Seconds in which idle processor time is measured."""


FULL = Sizes()
QUICK = Sizes(
    seconds=0.1, rounds=1, clients=(1, 3), searches=2, pings=40, sessions=20, population=(1, 20), idle=0.2
)


class Report:
    """Prints tables as they grow and keeps their rows as values."""

    def __init__(self) -> None:
        self.rows: list[dict[str, Any]] = []

    def table(self, title: str, *columns: str) -> None:
        """Begins a table; the last two columns are the reference's."""
        print(f"\n{title}")
        self._print([*columns, "A", "B"])

    def row(self, section: str, key: Any, cells: Sequence[str], **values: Any) -> None:
        """A line, with the reference's figures for ``key``."""
        self._print([*cells, *REFERENCE.get(section, {}).get(key, ("-", "-"))])
        self.rows.append({"section": section, **values})

    @staticmethod
    def _print(cells: Sequence[str]) -> None:
        print(f"  {cells[0]:<34}" + "".join(f"{cell:>19}" for cell in cells[1:]), flush=True)


class Bench:
    """The measures, one method each. ``agent`` is the command of the agent, with ``{port}`` in it."""

    def __init__(self, sizes: Sizes, agent: str, report: Report) -> None:
        self.sizes = sizes
        self.agent = agent
        self.report = report
        self._tables: dict[tuple[int, int], list[bytes]] = {}

    def latency(self) -> None:
        """From one client's socket through the server to another's."""
        report = self.report
        report.table(
            "latency from client to client, p50 / p99 in us", "message", "muros", "relay", "ratio of p50"
        )
        for pause, when in ((0.002, "machine idle"), (0.0, "one after the other")):
            for size in (32, 512):
                for stream_id, name in ((BEST_EFFORT, "best effort"), (RELIABLE, "reliable")):
                    table = self._messages(stream_id, size)
                    ours = self._quickest(lambda s=stream_id: self._pair(self.agent, s), table, pause)  # type: ignore[misc]
                    floor = self._quickest(self._relay_pair, table, pause)
                    report.row(
                        "latency",
                        (size, name) if pause else None,
                        [
                            f"{size} B {name}, {when}",
                            _p(ours),
                            _p(floor),
                            _ratio(ours.percentile(50), floor.percentile(50)),
                        ],
                        size=size,
                        stream=name,
                        idle=bool(pause),
                        p50=ours.percentile(50),
                        p99=ours.percentile(99),
                        relay_p50=floor.percentile(50),
                        relay_p99=floor.percentile(99),
                    )

    def reliable(self) -> None:
        """Writers only, and with a reader for each topic."""
        report = self.report
        for reading, section in ((False, "reliable"), (True, "delivered")):
            report.table(
                "reliable, one reader a topic: delivered/s (share of what was acknowledged)"
                if reading
                else "reliable, writers only: acknowledged/s",
                "clients, history",
                "muros",
                "cpu a message",
                "relay",
                "its cpu",
                "share of the relay",
            )
            for history in (4, 16):
                for count in self.sizes.clients:
                    if reading and count >= 100:
                        continue
                    ours = self._best(self.agent, count, history, reading)
                    floor = self._best(RELAY, count, history, False)
                    moved = ours.delivered if reading else ours.acked
                    rate, least = moved / ours.seconds, floor.acked / floor.seconds
                    share = ours.delivered / max(1, ours.acked)
                    report.row(
                        section,
                        (history, count),
                        [
                            f"{count} clients, history {history}",
                            f"{rate:,.0f}" + (f" ({share:.0%})" if reading else ""),
                            f"{ours.cpu / max(1, ours.acked) * 1e6:.1f} us",
                            f"{least:,.0f}",
                            f"{floor.cpu / max(1, floor.acked) * 1e6:.1f} us",
                            f"{rate / least:.2f}",
                        ],
                        clients=count,
                        history=history,
                        rate=rate,
                        relay=least,
                        share=share if reading else None,
                        cpu_us=ours.cpu / max(1, ours.acked) * 1e6,
                    )

    def best_effort(self) -> None:
        """The highest rate with less than half a percent lost."""
        report = self.report
        report.table(
            "best effort: highest rate with < 0.5 % lost, messages/s",
            "clients",
            "muros",
            "cpu a message",
            "relay",
            "its cpu",
            "share of the relay",
        )
        for reading in (False, True):
            for count in self.sizes.clients:
                if reading and count >= 100:
                    continue
                rate, cpu = self._highest(self.agent, count, reading)
                floor, floor_cpu = self._highest(RELAY, count, True)
                report.row(
                    "best-effort",
                    (count, reading),
                    [
                        f"{count} clients" + (", a reader each" if reading else ""),
                        f"{rate:,.0f}",
                        f"{cpu:.1f} us",
                        f"{floor:,.0f}",
                        f"{floor_cpu:.1f} us",
                        f"{rate / floor:.2f}" if floor else "-",
                    ],
                    clients=count,
                    reading=reading,
                    rate=rate,
                    relay=floor,
                    cpu_us=cpu,
                )

    def set_up(self) -> None:
        """Sessions set up and closed."""
        report = self.report
        report.table(
            "sessions/s: session, participant, topic, publisher, writer; then goodbye (relay: as many datagrams)",
            "at once",
            "set up",
            "torn down",
            "cpu of both",
            "relay",
        )
        for at_once in (1, 10):
            with Server(self.agent) as server, self._clients(server, self.sizes.sessions) as clients:
                cpu = server.cpu()
                up = load.drive(
                    clients, lambda c: [load.connect(c.key), load.create(f"load{c.key}")], at_once, LIMIT_S
                )
                down = load.drive(clients, lambda c: [load.leave()], at_once, LIMIT_S)
                cpu = (server.cpu() - cpu) / len(clients)
            with Server(RELAY) as server, self._clients(server, self.sizes.sessions) as clients:
                floor = load.drive(clients, lambda c: _echoed(c), at_once, LIMIT_S)
            count = self.sizes.sessions
            report.row(
                "sessions",
                at_once,
                [
                    f"{at_once} at a time",
                    f"{count / up:,.0f}",
                    f"{count / down:,.0f}",
                    f"{cpu * 1e3:.2f} ms",
                    f"{count / floor:,.0f}",
                ],
                at_once=at_once,
                up=count / up,
                down=count / down,
                relay=count / floor,
                cpu_ms=cpu * 1e3,
            )

    def memory(self) -> None:
        """What sessions cost while they have nothing to do, and how fast they go."""
        report = self.report
        report.table(
            "sessions with a writer, a reader and a running reading: memory, threads, idle cpu",
            "sessions",
            "memory",
            "threads",
            "idle cpu",
        )
        with Server(self.agent) as server, ExitStack() as stack:
            self._idle_row(server, 0)
            present: list[Client] = []
            for count in self.sizes.population:
                more = stack.enter_context(self._clients(server, count - len(present), first=len(present)))
                load.drive(more, _full_session, 10, LIMIT_S)
                present += more
                load.settle(present)
                self._idle_row(server, len(present))
            report.table("clients with a running reading say goodbye, all at once", "clients", "seconds")
            for count in sorted({min(100, len(present)), len(present)}):
                seconds = load.drive(present[:count], lambda c: [load.leave()], 64, LIMIT_S)
                report.row(
                    "leave", count, [f"{count} clients", f"{seconds:.3f} s"], clients=count, seconds=seconds
                )
                load.drive(present[:count], _full_session, 10, LIMIT_S)

    def stall(self) -> None:
        """A client that misbehaves must cost the others nothing."""
        report = self.report
        report.table(
            "nobody stalls another: latency of a pair, 32 B reliable, p50 / p99 in us",
            "beside, at the same agent",
            "muros",
            "at another agent",
            "ratio of p50",
        )
        for name, prepare in _COMPANY.items():
            here, there = (
                [self._in_company(prepare, apart=apart) for _ in range(self.sizes.rounds)]
                for apart in (False, True)
            )
            ours, control = (min(flows, key=lambda flow: flow.percentile(99)) for flows in (here, there))
            report.row(
                "stall",
                None,
                [name, _p(ours), _p(control), _ratio(ours.percentile(50), control.percentile(50))],
                beside=name,
                p50=ours.percentile(50),
                p99=ours.percentile(99),
                control_p50=control.percentile(50),
                control_p99=control.percentile(99),
                lost=sum(flow.lost for flow in here),
            )

    # Set-ups

    @contextmanager
    def _clients(self, server: Server, count: int, first: int = 0) -> Iterator[list[Client]]:
        clients: list[Client] = []
        try:
            for i in range(first, first + count):
                clients.append(Client(server.port, 0x10000000 + i))
            yield clients
        finally:
            for client in clients:
                client.close()

    @contextmanager
    def _pair(self, command: str, stream_id: int) -> Iterator[tuple[Server, Client, Client]]:
        with Server(command) as server, self._clients(server, 2) as (writer, reader):
            load.drive([writer], lambda c: [load.connect(c.key), load.create("pair")], 1, LIMIT_S)
            load.drive([reader], lambda c: _reading(c, "pair", stream_id), 1, LIMIT_S)
            if stream_id == BEST_EFFORT:
                writer.sent = 0
            yield server, writer, reader

    @contextmanager
    def _relay_pair(self) -> Iterator[tuple[Server, Client, Client]]:
        with Server(RELAY) as server, self._clients(server, 2) as (writer, reader):
            relay_to(reader.sock)
            yield server, writer, reader

    def _quickest(
        self,
        pair: Callable[[], AbstractContextManager[tuple[Server, Client, Client]]],
        table: list[bytes],
        pause: float,
    ) -> load.Flow:
        flows = []
        for _ in range(self.sizes.rounds):
            with pair() as (_, writer, reader):
                flows.append(load.latency(writer, reader, table, self.sizes.pings, pause))
        return min(flows, key=lambda flow: flow.percentile(99))

    def _in_company(self, prepare: Callable[["Bench", Server, ExitStack], None], *, apart: bool) -> load.Flow:
        """The latency of a pair; with ``apart`` the company is at another agent: it costs the machine as much."""
        with self._pair(self.agent, RELIABLE) as (server, writer, reader), ExitStack() as stack:
            prepare(self, stack.enter_context(Server(self.agent)) if apart else server, stack)
            return load.latency(writer, reader, self._messages(RELIABLE, 32), self.sizes.pings, 0.001)

    def _best(self, command: str, count: int, history: int, reading: bool) -> load.Flow:
        flows = []
        for _ in range(self.sizes.rounds):
            with Server(command) as server, self._clients(server, count * (2 if reading else 1)) as clients:
                if command is not RELAY:
                    writers, readers = _split(clients, count)
                else:
                    writers, readers = clients, []
                table = self._messages(RELIABLE, 32)
                flows.append(load.closed_loop(server, writers, readers, history, table, self.sizes.seconds))
        return max(flows, key=lambda flow: flow.delivered if reading else flow.acked)

    def _highest(self, command: str, count: int, reading: bool) -> tuple[float, float]:
        """The highest rate and the server's processor time for a message in us, by halving the ratio of rates."""
        table = self._messages(BEST_EFFORT, 32)
        with Server(command) as server, self._clients(server, count * (2 if reading else 1)) as clients:
            if command is RELAY:
                writers, readers = clients[:count], clients[count : count + 1]
                relay_to(readers[0].sock)
            else:
                writers, readers = _split(clients, count, BEST_EFFORT)
            for writer in writers:
                writer.sent = 0
            low, high = 1_000.0, float(HIGHEST_RATE)
            best = (0.0, 0.0)
            for _ in range(self.sizes.searches):
                rate = (low * high) ** 0.5
                flow = load.paced(server, writers, readers, table, rate, self.sizes.seconds / 2)
                reached = flow.sent / flow.seconds
                if flow.lost <= 0.005 * flow.sent and reached > 0.95 * rate:
                    low = rate
                    best = reached, flow.cpu / flow.sent * 1e6
                else:
                    high = rate
                load.settle(readers)
        return best

    def _idle_row(self, server: Server, count: int) -> None:
        time.sleep(self.sizes.idle / 4)
        cpu, start = server.cpu(), time.perf_counter()
        time.sleep(self.sizes.idle)
        idle = (server.cpu() - cpu) / (time.perf_counter() - start)
        memory, threads = server.rss(), server.threads()
        cells = [f"{count}" if count else "none", f"{memory:.1f} MB", f"{threads}", f"{idle:.2%}"]
        self.report.row("memory", count, cells, sessions=count, rss=memory, threads=threads, idle=idle)

    def _messages(self, stream_id: int, size: int) -> list[bytes]:
        table = self._tables.get((stream_id, size))
        if table is None:
            table = self._tables[stream_id, size] = load.messages(stream_id, size)
        return table


def _split(clients: list[Client], count: int, stream_id: int = RELIABLE) -> tuple[list[Client], list[Client]]:
    """The first ``count`` write a topic each, the others read one each."""
    writers, readers = clients[:count], clients[count:]
    topics = {client.key: f"load{i % count}" for i, client in enumerate(clients)}
    load.drive(writers, lambda c: [load.connect(c.key), load.create(topics[c.key])], 10, LIMIT_S)
    load.drive(readers, lambda c: _reading(c, topics[c.key], stream_id), 10, LIMIT_S)
    return writers, readers


def _reading(client: Client, topic: str, stream_id: int) -> list[load.Stage]:
    return [load.connect(client.key), load.create(topic, writer=False, reader=True), load.read(stream_id)]


def _full_session(client: Client) -> list[load.Stage]:
    topic = f"load{client.key}"
    return [load.connect(client.key), load.create(topic, reader=True), load.read()]


def _echoed(client: Client) -> list[load.Stage]:
    """The same datagrams for a relay: whatever comes back is the answer."""
    stages = [load.connect(client.key), load.create(f"load{client.key}"), load.leave()]
    return [load.Stage(s.submessages, s.submessages[0][0], len(s.submessages), 0) for s in stages]


# The company of a pair


def _nobody(bench: Bench, server: Server, stack: ExitStack) -> None:
    """To compare with."""


def _mute(bench: Bench, server: Server, stack: ExitStack) -> None:
    """It reads the same topic on a reliable stream."""
    (mute,) = stack.enter_context(bench._clients(server, 1, first=100))
    load.drive([mute], lambda c: _reading(c, "pair", RELIABLE), 1, LIMIT_S)


def _come_and_go(bench: Bench, server: Server, stack: ExitStack) -> None:
    """Each makes all that a session can have, reads, and says goodbye."""
    _beside(_churn, server, stack)


def _garbage(bench: Bench, server: Server, stack: ExitStack) -> None:
    """Messages of a session nobody opened, and random bytes."""
    _beside(_noise, server, stack)


_COMPANY: dict[str, Callable[[Bench, Server, ExitStack], None]] = {
    "nobody": _nobody,
    "one that never acknowledges": _mute,
    "100 sessions/s coming and going": _come_and_go,
    "1000 senseless datagrams/s": _garbage,
}


def _beside(work: Callable[[int], None], server: Server, stack: ExitStack) -> None:
    process = get_context("fork").Process(target=work, args=(server.port,), daemon=True)
    process.start()
    stack.callback(process.join, 5)
    stack.callback(process.terminate)


def _churn(port: int) -> None:
    end = time.monotonic() + LIMIT_S
    key = 0x20000000
    while time.monotonic() < end:
        client = Client(port, key)
        load.drive([client], lambda c: [*_full_session(c), load.leave()], 1, LIMIT_S)
        client.close()
        key += 1
        time.sleep(0.01)


def _noise(port: int) -> None:
    end = time.monotonic() + LIMIT_S
    client = Client(port, 0)
    random = Random(1)
    while time.monotonic() < end:
        for _ in range(5):
            client.send(b"\x81\x80\0\0" + random.randbytes(40))
            client.send(random.randbytes(random.randrange(1, 60)))
        load.empty(client)
        time.sleep(0.01)


# Figures for people


def _p(flow: load.Flow) -> str:
    return f"{flow.percentile(50):.0f} / {flow.percentile(99):.0f}"


def _ratio(ours: float, floor: float) -> str:
    return f"{ours / floor:.2f}"


SECTIONS: dict[str, Callable[[Bench], None]] = {
    "latency": Bench.latency,
    "reliable": Bench.reliable,
    "best-effort": Bench.best_effort,
    "sessions": Bench.set_up,
    "memory": Bench.memory,
    "stall": Bench.stall,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Exit status 1 when a load could not be run."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=SECTIONS, action="append", help="one table; may be repeated")
    parser.add_argument("--quick", action="store_true", help="tiny counts: whether it works, not how fast")
    parser.add_argument("--agent", default=MUROS, help="command of another agent, with {port} in it")
    parser.add_argument("--json", type=Path, help="write the figures here too")
    options = parser.parse_args(argv)
    sizes = QUICK if options.quick else FULL
    report = Report()
    bench = Bench(sizes, options.agent, report)
    start = time.monotonic()
    try:
        raise_file_limit(2 * max(*sizes.population, *sizes.clients, sizes.sessions) + 64)
        for name in options.only or SECTIONS:
            SECTIONS[name](bench)
    except (load.LoadError, OSError, RuntimeError) as error:
        print(f"bench_agent: {error}", file=sys.stderr)
        return 1
    finally:
        if options.json:
            options.json.write_text(json.dumps(report.rows, indent=1))
    print(f"\n{time.monotonic() - start:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
