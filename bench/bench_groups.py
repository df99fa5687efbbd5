"""The ping-pong test bench of callback groups: real-time and best-effort messages, a thread for each, one processor.

Run from a checkout: python bench/bench_groups.py [--ping-period 0.033 --high-busyloop 0.025] [--plots FOLDER]

Ping sends a number each ``--ping-period`` on two topics; Pong burns ``--high-busyloop`` and ``--low-busyloop`` seconds
of processor time before it answers on the one and on the other. A thread of high priority runs all of Ping and the high
path of Pong, one of low priority the low path; both are pinned to one processor and scheduled by SCHED_FIFO, where that
is permitted. The report has the form of the test bench of ROS 2 (examples_rclcpp_cbg_executor); expected is:

- 0.01, 0.01, 0.01: nearly all of the high path, nothing of the low one;
- 0.033, 0.025, 0.01: all of the high path, and of the low one what time is left for: (0.033 - 0.025) / 0.01 = 80 %.

``--default-policy`` is what happens without priorities; ``--sweep`` runs rates from 10 to 100 Hz with 10 and 40 ms.
"""

import argparse
import statistics
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench import _plots as plots
from muros.rclc import (
    BEST_EFFORT,
    REAL_TIME_CRITICAL,
    CallbackGroup,
    Context,
    Node,
    Threads,
    scheduling,
)
from muros.rclc.host.groups import ExecutorThread

from std_msgs.msg import Int32

CPU = 0
SWEEP = (10, 15, 20, 25, 30, 40, 50, 70, 100)
"""Rates in Hz, as in the plot of the documentation."""
PATHS = ("high", "low")


@dataclass
class Setting:
    """What one run is about; times in seconds."""

    ping_period: float = 0.01
    high_busyloop: float = 0.01
    low_busyloop: float = 0.01
    seconds: float = 10.0
    url: str = "local:"
    policies: bool = True


@dataclass
class Ping:
    """A ping and when its pongs came."""

    sent: float
    received: dict[str, float] = field(default_factory=dict)


class PingNode:
    """Sends on both paths and notes what comes back."""

    def __init__(self, context: Context, period: float) -> None:
        node = context.node("ping_node")
        self.pings: list[Ping] = []
        self.group = CallbackGroup("ping", REAL_TIME_CRITICAL)
        self._publishers = [node.publisher(Int32, f"{path}_ping", "sensor_data") for path in PATHS]
        self.group.add(node.timer(period, self._send))
        for path in PATHS:
            self._listen(node, path)

    def _listen(self, node: Node, path: str) -> None:
        def received(msg: Any) -> None:
            self.pings[msg.data].received[path] = time.monotonic()

        self.group.add(node.subscription(Int32, f"{path}_pong", received, "sensor_data"))

    def _send(self) -> None:
        number = len(self.pings)
        self.pings.append(Ping(time.monotonic()))
        for publisher in self._publishers:
            publisher.publish(Int32(data=number))

    def round_trips(self, path: str) -> list[float]:
        """Seconds from ping to pong, of those that came."""
        return [ping.received[path] - ping.sent for ping in self.pings if path in ping.received]


class PongNode:
    """Computes before it answers, in a group for each path."""

    def __init__(self, context: Context, busy: dict[str, float]) -> None:
        node = context.node("pong_node")
        self.groups = {}
        for path, seconds in busy.items():
            self.groups[path] = CallbackGroup(path, REAL_TIME_CRITICAL if path == "high" else BEST_EFFORT)
            self._answer(node, path, seconds)

    def _answer(self, node: Node, path: str, seconds: float) -> None:
        publisher = node.publisher(Int32, f"{path}_pong", "sensor_data")

        def answer(msg: Any) -> None:
            burn(seconds)
            publisher.publish(msg)

        self.groups[path].add(node.subscription(Int32, f"{path}_ping", answer, "sensor_data"))


@dataclass
class Result:
    """What a run gave."""

    setting: Setting
    pings: list[Ping]
    round_trips: dict[str, list[float]]
    cpu: dict[str, float]
    problems: list[str]

    def share(self, path: str) -> float:
        """Percent of the pings that were answered."""
        return 100 * len(self.round_trips[path]) / max(len(self.pings), 1)

    def lines(self) -> list[str]:
        """The report."""
        ideal = int(self.setting.seconds / self.setting.ping_period + 1e-6)
        sent = len(self.pings)
        said = [
            f"[ping_node]: Both paths: Sent out {sent} of configured {ideal} pings, i.e. {100 * sent // ideal}%."
        ]
        for path in PATHS:
            came = self.round_trips[path]
            name = f"[ping_node]: {path.capitalize()} prio path:"
            said.append(f"{name} Received {len(came)} pongs, i.e. for {int(self.share(path))}% of the pings.")
            if came:
                said.append(f"{name} Average RTT is {1000 * statistics.fmean(came):3.1f}ms.")
                said.append(f"{name} Jitter of RTT is {1000 * statistics.pstdev(came):5.3f}ms.")
        said += [
            f"[pong_node]: {path.capitalize()} priority executor thread ran for {1000 * self.cpu[path]:.0f}ms."
            for path in PATHS
        ]
        return said + [f"[pong_node]: {problem}" for problem in self.problems]


def burn(seconds: float) -> None:
    """Uses processor time of this thread."""
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass


def run(setting: Setting) -> Result:
    """One run."""
    context = Context(setting.url)
    problems: list[str] = []
    context.on_problem(lambda code, text: problems.append(text) if code == 52 else None)
    ping = PingNode(context, setting.ping_period)
    pong = PongNode(context, {"high": setting.high_busyloop, "low": setting.low_busyloop})
    threads = Threads(context)
    policies = {"high": scheduling.fifo(), "low": scheduling.fifo(scheduling.LEAST_PRIORITY)}
    members = {"high": [ping.group, pong.groups["high"]], "low": [pong.groups["low"]]}
    made: dict[str, ExecutorThread] = {
        path: threads.executor(
            path, policies[path] if setting.policies else scheduling.other(), *members[path], cpus=[CPU]
        )
        for path in PATHS
    }
    with threads:
        before = {path: made[path].cpu_time for path in PATHS}
        time.sleep(setting.seconds)
        cpu = {path: made[path].cpu_time - before[path] for path in PATHS}
    context.close()
    return Result(setting, ping.pings, {path: ping.round_trips(path) for path in PATHS}, cpu, problems)


def draw(result: Result, folder: Path) -> None:
    """Round trips over time, and how they are spread."""
    folder.mkdir(parents=True, exist_ok=True)
    start = result.pings[0].sent
    over_time = {
        f"{path} priority": [
            (ping.sent - start, 1000 * (ping.received[path] - ping.sent))
            for ping in result.pings
            if path in ping.received
        ]
        for path in PATHS
    }
    (folder / "groups_rtt.svg").write_text(plots.lines("Ping-pong", "time in s", "RTT in ms", over_time))
    spread = {f"{path} priority": [1000 * t for t in result.round_trips[path]] for path in PATHS}
    (folder / "groups_distribution.svg").write_text(plots.distribution("Ping-pong", "RTT in ms", spread))


def sweep(setting: Setting, folder: Path | None) -> None:
    """Pongs a second at rising rates, 10 ms of high and 40 ms of low work."""
    curves: dict[str, list[tuple[float, float]]] = {f"{path} priority": [] for path in PATHS}
    print("rate in Hz    high pongs/s    low pongs/s")
    for rate in SWEEP:
        result = run(Setting(1 / rate, 0.01, 0.04, setting.seconds, setting.url, setting.policies))
        pongs = [len(result.round_trips[path]) / setting.seconds for path in PATHS]
        for path, count in zip(PATHS, pongs, strict=True):
            curves[f"{path} priority"].append((rate, count))
        print(f"{rate:10d}{pongs[0]:16.1f}{pongs[1]:15.1f}", flush=True)
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "groups_sweep.svg").write_text(
            plots.lines("Callback groups on one processor", "ping rate in Hz", "pongs a second", curves)
        )


def main() -> int:
    """Runs what is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--ping-period", type=float, default=0.01, metavar="S")
    parser.add_argument("--high-busyloop", type=float, default=0.01, metavar="S")
    parser.add_argument("--low-busyloop", type=float, default=0.01, metavar="S")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each run")
    parser.add_argument("--url", default="local:", help="the space: local: or dds:")
    parser.add_argument("--default-policy", action="store_true", help="without priorities")
    parser.add_argument("--sweep", action="store_true", help="rates from 10 to 100 Hz")
    parser.add_argument("--plots", type=Path, metavar="FOLDER", help="where to put plots, as SVG")
    options = parser.parse_args()
    setting = Setting(
        options.ping_period,
        options.high_busyloop,
        options.low_busyloop,
        options.seconds,
        options.url,
        not options.default_policy,
    )
    if options.sweep:
        sweep(setting, options.plots)
        return 0
    print(f"[pong_node]: Running experiment from now on for {setting.seconds:g} seconds ...", flush=True)
    result = run(setting)
    print("\n".join(result.lines()))
    if options.plots:
        draw(result, options.plots)
    return 0


if __name__ == "__main__":
    sys.exit(main())
