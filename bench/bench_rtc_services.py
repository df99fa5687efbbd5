"""Calls of a service port beside plain omniORB: round trips of `echo` between two processes.

Run from a checkout: python bench/bench_rtc_services.py [--quick] [--json FILE]

The floor is a servant and a stub without a service port, measured in the same run, turn by turn. `servant` is a
component's provider that is a servant itself, called as old components call it; `methods` a provider whose operations
are a component's methods, called through the consumer that says what is wrong. OpenRTM-aist took 34 us (median) and
146 us (p99) where plain omniORB took 31 and 194.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "src")]

from muros.rtc import Component, Provided, ReturnCode, ServicePort  # noqa: E402
from muros.rtc.corba import load_idl, start_orb  # noqa: E402
from muros.rtc.corba._objects import Objects  # noqa: E402
from muros.rtc.corba._setup import set_up  # noqa: E402
from muros.rtc.profiles import ConnectorProfile  # noqa: E402
from muros.rtc.services import Consumer  # noqa: E402

IDL = Path(__file__).with_name("_rtc_service.idl")
TEXT = "sixteen letters."
LIMIT_S = 30.0
"""How long any one step may take."""

FULL = (2000, 7)
"""Calls in a turn, and turns of each way."""
QUICK = (50, 1)


class Provider(Component):
    """Has the operation as a method of its own, and as a servant."""

    methods = Provided("BenchService::Parrot", idl=IDL)

    def echo(self, text: str) -> str:
        return text


def servant() -> Any:
    """A servant, as written without muros."""
    skeleton: Any = load_idl(IDL)["BenchService__POA"].Parrot
    return type("Servant", (skeleton,), {"echo": lambda self, text: text})()


def serve() -> int:
    """The process that is called: says where its objects are, and ends with its standard input."""
    orb = start_orb("127.0.0.1:")
    objects = set_up(orb)
    provider = Provider()
    provider.initialize([])
    port = ServicePort("servant")
    port.register_provider("servant", "Parrot", servant())
    provider.add_port(port)
    for one in provider.ports:
        one.activate()
    where = {
        "plain": orb.to_text(orb.activate(servant())),
        **{one.name: orb.to_text(objects.port(one)) for one in provider.ports},
    }
    print(json.dumps(where), flush=True)
    sys.stdin.read()
    provider.exit()
    orb.shutdown()
    return 0


def calls(where: Mapping[str, str], objects: Objects) -> dict[str, Callable[[str], str]]:
    """What calls the other process, by way."""
    orb = objects.orb
    echo = load_idl(IDL)["BenchService"].Parrot
    consumers = {}
    for name in ("servant", "methods"):
        port = ServicePort(name)
        consumers[name] = port.register_consumer(name, "Parrot", Consumer(echo))
        peer = objects.port_behind(orb.to_reference(where[name])._narrow(port_service()))
        code, _ = port.connect(ConnectorProfile(name, "", (port, peer)))
        assert code is ReturnCode.RTC_OK, code
    return {
        "plain": orb.to_reference(where["plain"])._narrow(echo).echo,
        "servant": lambda text: consumers["servant"].object.echo(text),
        "methods": lambda text: consumers["methods"].echo(text),
    }


def port_service() -> Any:
    import RTC

    return RTC.PortService


def turn(call: Callable[[str], str], number: int) -> list[float]:
    """Microseconds of each of `number` round trips."""
    took = []
    for _ in range(number):
        begin = time.perf_counter_ns()
        call(TEXT)
        took.append((time.perf_counter_ns() - begin) / 1e3)
    return took


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="few calls: whether it works")
    parser.add_argument("--json", help="write the rows to this file")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        return serve()
    number, turns = QUICK if options.quick else FULL
    with subprocess.Popen(
        [sys.executable, __file__, "--serve"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            where = json.loads(process.stdout.readline())
            orb = start_orb("127.0.0.1:")
            ways = calls(where, set_up(orb))
            took: dict[str, list[list[float]]] = {way: [] for way in ways}
            for call in ways.values():
                turn(call, number // 5)
            for _ in range(turns):
                for way, call in ways.items():
                    took[way].append(turn(call, number))
            orb.shutdown()
        finally:
            assert process.stdin is not None
            process.stdin.close()
            process.wait(LIMIT_S)
    rows = [row(way, of_way, took["plain"]) for way, of_way in took.items()]
    print(f"{'echo, two processes':<24}{'median us':>12}{'best':>8}{'p99':>8}{'beside plain':>14}")
    for one in rows:
        print(
            f"{one['way']:<24}{one['median']:>12.1f}{one['best']:>8.1f}{one['p99']:>8.1f}{one['ratio']:>14.2f}"
        )
    if options.json:
        Path(options.json).write_text(json.dumps(rows))
    return 0


def row(way: str, turns: list[list[float]], plain: list[list[float]]) -> dict[str, Any]:
    """Medians over the turns; `ratio` is the median of the turns' ratios to those beside them."""
    medians = [statistics.median(one) for one in turns]
    ratios = [mine / statistics.median(other) for mine, other in zip(medians, plain, strict=True)]
    p99 = [sorted(one)[int(0.99 * len(one))] for one in turns]
    return {
        "way": way,
        "median": statistics.median(medians),
        "best": min(medians),
        "p99": statistics.median(p99),
        "ratio": statistics.median(ratios),
    }


if __name__ == "__main__":
    raise SystemExit(main())
