"""Compares the CDR codecs of muros with those of rosbags on five types, in one run.

    python bench/bench_cdr.py [--seconds 0.6]

Both sides encode and decode the same values; the measurements alternate in short slices, so that whatever else the
machine does hits both. Printed is the time of one call (median over the slices) and the ratio muros : rosbags; below 1
muros is faster. Exit status 0 always: this measures, the reader judges.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np
from rosbags.typesys import Stores, get_typestore

from muros.interfaces import message

SLICES = 40


def samples(store: object) -> dict[str, object]:
    """One value of each type, made of the classes of rosbags."""
    types = store.types  # type: ignore[attr-defined]

    def new(name: str, *values: object) -> object:
        return types[name](*values)

    header = new(
        "std_msgs/msg/Header", new("builtin_interfaces/msg/Time", 1_700_000_000, 123_456_789), "base_link"
    )
    vector = new("geometry_msgs/msg/Vector3", 1.0, -2.0, 3.5)
    covariance = np.arange(9, dtype=np.float64)
    joints = [f"joint_{n}" for n in range(7)]
    values = np.linspace(0.0, 1.0, 7)
    fields = [
        new("sensor_msgs/msg/PointField", name, 4 * at, 7, 1)
        for at, name in enumerate(("x", "y", "z", "rgb"))
    ]
    points = np.arange(1 << 20, dtype=np.uint32).astype(np.uint8)
    scan = np.linspace(0.1, 30.0, 720).astype(np.float32)
    return {
        "geometry_msgs/msg/Twist": new("geometry_msgs/msg/Twist", vector, vector),
        "sensor_msgs/msg/Imu": new(
            "sensor_msgs/msg/Imu",
            header,
            new("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0),
            covariance,
            vector,
            covariance,
            vector,
            covariance,
        ),
        "sensor_msgs/msg/JointState": new(
            "sensor_msgs/msg/JointState", header, joints, values, values, values
        ),
        "sensor_msgs/msg/LaserScan": new(
            "sensor_msgs/msg/LaserScan", header, -3.1, 3.1, 0.01, 0.0, 0.1, 0.1, 30.0, scan, scan
        ),
        "sensor_msgs/msg/PointCloud2": new(
            "sensor_msgs/msg/PointCloud2", header, 1, 1 << 16, fields, False, 16, 1 << 20, points, True
        ),
    }


def race(ours: Callable[[], object], theirs: Callable[[], object], seconds: float) -> tuple[float, float]:
    """The median time of one call of each, in seconds, measured in alternating slices."""
    once = min(_time(theirs, 1) for _ in range(5))
    calls = max(1, int(seconds / SLICES / 2 / once))
    slices: tuple[list[float], list[float]] = ([], [])
    for turn in range(SLICES):
        for side in (0, 1) if turn % 2 else (1, 0):
            slices[side].append(_time((ours, theirs)[side], calls) / calls)
    return statistics.median(slices[0]), statistics.median(slices[1])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=0.6, help="time for each type and direction")
    seconds = parser.parse_args().seconds
    store = get_typestore(Stores.LATEST)
    print(f"{'type':<30}{'':>8}{'muros us':>12}{'rosbags us':>12}{'ratio':>8}")
    for name, value in samples(store).items():
        data = bytes(store.serialize_cdr(value, name))
        view = memoryview(data)
        ours = message(name)
        mine = ours.deserialize(data, header=True)
        assert mine.serialize(header=True) == data
        body = data[4:]
        races = {
            "encode": (mine.serialize, lambda v=value, n=name: store.serialize_cdr(v, n)),
            "decode": (
                lambda c=ours, b=body: c.deserialize(b),
                lambda v=view, n=name: store.deserialize_cdr(v, n),
            ),
        }
        for direction, (one, other) in races.items():
            a, b = race(one, other, seconds)
            print(f"{name:<30}{direction:>8}{a * 1e6:>12.2f}{b * 1e6:>12.2f}{a / b:>8.2f}")
    return 0


def _time(call: Callable[[], object], calls: int) -> float:
    turns = range(calls)
    start = time.perf_counter()
    for _ in turns:
        call()
    return time.perf_counter() - start


if __name__ == "__main__":
    raise SystemExit(main())
