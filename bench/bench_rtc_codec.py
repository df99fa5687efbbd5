"""Compares muros' codecs of RTC data types with the ORB's own marshalling, in one run.

    python bench/bench_rtc_codec.py [--seconds 0.5]

Both encode and decode the same values; the measurements alternate in short slices, so that whatever else the machine
does hits both. Printed is the time of one call (median over the slices) and the ratio muros : ORB; below 1 muros is
faster. Exit status 0 always: this measures, the reader judges.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path[:0] = [str(Path(__file__).resolve().parents[1] / "src")]

from muros.rtc.corba import data_type_of, start_orb  # noqa: E402
from muros.rtc.corba._stubs import RTC  # noqa: E402

SLICES = 20


def samples() -> list[Any]:
    """One value of each type."""
    tm = RTC.Time(1_700_000_000, 123_456_789)
    point = RTC.PointCloudPoint(RTC.Point3D(1.0, 2.0, 3.0), RTC.RGBColour(0.1, 0.2, 0.3))
    return [
        RTC.TimedLong(tm, 7),
        RTC.TimedString(tm, "a text of some length"),
        RTC.TimedPose3D(tm, RTC.Pose3D(RTC.Point3D(1.0, 2.0, 3.0), RTC.Orientation3D(0.1, 0.2, 0.3))),
        RTC.TimedOctetSeq(tm, bytes(65536)),
        RTC.TimedDoubleSeq(tm, [float(number) for number in range(8192)]),
        RTC.PointCloud(tm, [point] * 1000),
    ]


def compare(ways: list[Callable[[], object]], seconds: float) -> list[float]:
    """Seconds that one call of each takes, turn by turn."""
    counts = []
    for way in ways:
        begin = time.perf_counter()
        way()
        counts.append(max(1, int(seconds / SLICES / max(time.perf_counter() - begin, 1e-7))))
    times: list[list[float]] = [[] for _ in ways]
    for _ in range(SLICES):
        for way, count, taken in zip(ways, counts, times, strict=True):
            begin = time.perf_counter()
            for _ in range(count):
                way()
            taken.append((time.perf_counter() - begin) / count)
    return [statistics.median(taken) for taken in times]


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=0.5, help="time for each way (default: 0.5)")
    seconds = parser.parse_args().seconds
    orb = start_orb("127.0.0.1:")
    import omniORB

    print(f"{'':16}{'encode':>10}{'ORB':>10}{'ratio':>8}{'decode':>12}{'ORB':>10}{'ratio':>8}   (us)")
    for value in samples():
        kind = data_type_of(type(value))
        typecode = omniORB.findTypeCode(kind.repository_id)
        octets = kind.encode(value, True)
        ours, theirs, back, their_back = compare(
            [
                lambda kind=kind, value=value: kind.encode(value, True),  # type: ignore[misc]
                lambda code=typecode, value=value: omniORB.cdrMarshal(code, value, 1),  # type: ignore[misc]
                lambda kind=kind, octets=octets: kind.decode(octets, True),  # type: ignore[misc]
                lambda code=typecode, octets=octets: omniORB.cdrUnmarshal(code, octets, 1),  # type: ignore[misc]
            ],
            seconds,
        )
        print(
            f"{type(value).__name__:16}{ours * 1e6:10.2f}{theirs * 1e6:10.2f}{ours / theirs:8.2f}"
            f"{back * 1e6:12.2f}{their_back * 1e6:10.2f}{back / their_back:8.2f}"
        )
    orb.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
