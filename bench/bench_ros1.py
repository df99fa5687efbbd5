"""Compares the conversion between ROS 1 and CDR with that of rosbags on six types, in one run.

    python bench/bench_ros1.py [--seconds 0.6]

Both sides convert the same bytes, and it is checked that they make the same of them; the measurements alternate in
short slices, so that whatever else the machine does hits both. Printed is the time of one call (median over the slices)
and the ratio muros : rosbags; below 1 muros is faster. Exit status 0 always: this measures, the reader judges.
"""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path

from rosbags.typesys import Stores, get_typestore

from muros.interfaces import converter, ros1_name

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from bench.bench_cdr import race, samples


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=0.6, help="time for each type and direction")
    seconds = parser.parse_args().seconds
    store = get_typestore(Stores.LATEST)
    values = {"std_msgs/msg/String": store.types["std_msgs/msg/String"]("x" * 16), **samples(store)}
    print(f"{'type':<30}{'':>8}{'muros us':>12}{'rosbags us':>12}{'ratio':>8}")
    for name, value in values.items():
        cdr = bytes(store.serialize_cdr(value, name))
        body, convert = cdr[4:], converter(ros1_name(name))
        ros1 = bytes(store.cdr_to_ros1(cdr, name))
        if convert.to_ros1(body) != ros1 or convert.to_cdr(ros1) != body:
            raise SystemExit(f"{name}: muros and rosbags differ")
        for way, ours, theirs in (
            ("to CDR", partial(convert.to_cdr, ros1), partial(store.ros1_to_cdr, ros1, name)),
            ("to ROS 1", partial(convert.to_ros1, body), partial(store.cdr_to_ros1, cdr, name)),
        ):
            mine, other = race(ours, theirs, seconds)
            print(f"{name:<30}{way:>8}{mine * 1e6:>12.2f}{other * 1e6:>12.2f}{mine / other:>8.2f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
