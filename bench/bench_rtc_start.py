"""How long an RT component takes from the start of its process until it is visible in the name service, and its memory.

    python bench/bench_rtc_start.py [--rounds 5]

Beside it, in the same rounds: the least that an object on the same ORB takes (omniORB and the RTC stubs imported, one
servant activated and bound), and an interpreter that does nothing. Rounds alternate; printed are medians and best. All
have their modules compiled, as after an installation. OpenRTM-aist took 703 ms (best 582) on the machine where this was
designed, and 31 MB with one component.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from muros.rtc.corba import NameServer, start_name_server, start_orb

MUROS = """
import json, os, sys, time
begin = time.perf_counter()
def memory():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
stages = {"interpreter MB": memory()}
from muros.rtc import Component
from muros.rtc.manager import Manager, parse_options, read_settings
import muros.rtc.corba._world
stages["import ms"], stages["import MB"] = 1e3 * (time.perf_counter() - begin), memory()
class Bench(Component):
    category = "bench"
begin = time.perf_counter()
manager = Manager(read_settings(parse_options(sys.argv[1:]), environment={}))
manager.start()
stages["manager ms"], stages["manager MB"] = 1e3 * (time.perf_counter() - begin), memory()
begin = time.perf_counter()
manager.register(Bench)
manager.create_component("Bench")
stages["component ms"], stages["component MB"] = 1e3 * (time.perf_counter() - begin), memory()
for _ in range(10):
    manager.create_component("Bench")
stages["11 components MB"] = memory()
print(json.dumps(stages), flush=True)
manager.wait(float(60))
manager.close()
"""

PLAIN = """
import json, os, sys, time
from omniORB import CORBA
import CosNaming
from rtctree.rtc import RTC, RTC__POA
class Plain(RTC__POA.RTObject): ...
orb = CORBA.ORB_init(["x", "-ORBendPoint", "giop:tcp:127.0.0.1:"], CORBA.ORB_ID)
poa = orb.resolve_initial_references("RootPOA")
poa._get_the_POAManager().activate()
root = orb.string_to_object(f"corbaloc::{sys.argv[1]}/NameService")._narrow(CosNaming.NamingContext)
root.rebind([CosNaming.NameComponent("Bench0", "rtc")], Plain()._this())
with open("/proc/self/statm") as file:
    pages = int(file.read().split()[1])
print(json.dumps({"plain omniORB, MB": pages * os.sysconf("SC_PAGE_SIZE") / 1e6}), flush=True)
time.sleep(60)
"""


def visible_after(
    command: list[str], is_visible: Callable[[], bool], folder: Path
) -> tuple[float, dict[str, float]]:
    """Milliseconds until a process is seen, and what it says of itself."""
    environment = {
        **os.environ,
        "OMNIORB_CONFIG": os.devnull,
        "PYTHONPYCACHEPREFIX": str(folder / "compiled"),
    }
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    begin = time.perf_counter()
    with subprocess.Popen(command, stdout=subprocess.PIPE, cwd=folder, env=environment) as process:
        try:
            while not is_visible():
                if process.poll() is not None or time.perf_counter() - begin > 30:
                    raise SystemExit(f"{command[:4]} did not become visible")
                time.sleep(0.002)
            seconds = time.perf_counter() - begin
            assert process.stdout is not None
            stages = json.loads(process.stdout.readline())
        finally:
            process.terminate()
    return 1e3 * seconds, stages


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=5, help="times that each is started")
    rounds = parser.parse_args().rounds
    times: dict[str, list[float]] = {"muros": [], "plain omniORB": [], "interpreter": []}
    stages: dict[str, list[float]] = {}
    orb = start_orb("127.0.0.1:")
    with (
        tempfile.TemporaryDirectory() as name,
        start_name_server(free_port(), folder=Path(name, "names")) as server,
    ):
        folder = Path(name)
        names = NameServer(orb, server.address)
        settings = {
            "corba.nameservers": server.address,
            "corba.endpoints": "127.0.0.1:",
            "corba.master_manager": f"127.0.0.1:{free_port()}",
            "naming.formats": "%n.rtc",
            "logger.enable": "NO",
        }
        options = [word for key, text in settings.items() for word in ("-o", f"{key}:{text}")]
        commands = {
            "muros": [sys.executable, "-c", MUROS, *options],
            "plain omniORB": [sys.executable, "-c", PLAIN, server.address],
        }
        for warm in (False, *[True] * rounds):
            for kind, command in commands.items():
                for number in range(11):
                    names.unbind(f"Bench{number}.rtc")
                milliseconds, said = visible_after(
                    command, lambda: names.resolve("Bench0.rtc") is not None, folder
                )
                if not warm:
                    continue
                times[kind].append(milliseconds)
                for stage, value in said.items():
                    stages.setdefault(stage, []).append(value)
            begin = time.perf_counter()
            subprocess.run([sys.executable, "-c", ""], check=True)
            times["interpreter"].append(1e3 * (time.perf_counter() - begin))
    orb.shutdown()
    print(f"{'until visible':<24}{'median ms':>12}{'best':>10}")
    for kind, values in times.items():
        print(f"{kind:<24}{statistics.median(values):>12.0f}{min(values):>10.0f}")
    print(
        f"muros : plain omniORB {statistics.median(times['muros']) / statistics.median(times['plain omniORB']):.2f}"
    )
    print(f"\n{'of muros, and memory':<24}{'median':>12}")
    for stage, values in stages.items():
        print(f"{stage:<24}{statistics.median(values):>12.1f}")
    return 0


def free_port() -> int:
    import socket

    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
        return port


if __name__ == "__main__":
    raise SystemExit(main())
