"""Settings that all tests share."""

import os
import signal
from fnmatch import fnmatch
from pathlib import Path
from typing import Final

import pytest
from hypothesis import HealthCheck, settings

# Two cores shared with other work: no deadline for one example, the time limit for a test stays. In
# continuous integration each run has the same examples, so that a red run means a change and not bad luck.
settings.register_profile("dev", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("ci", settings.get_profile("dev"), derandomize=True, print_blob=True)
# Whatever opens the ROS 2 graph without saying where stays on this machine: tests meet nobody else's robots.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
for name in ("ROS_DOMAIN_ID", "ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS"):
    os.environ.pop(name, None)

# Shells start what runs in their background with Ctrl-C ignored, and programs that tests end that way would inherit it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

settings.load_profile("ci" if os.environ.get("CI") == "true" else "dev")


REAL_TIME: Final = (
    "cli", "cyclone", "dds", "diagnostics", "examples", "rclc_space", "ros1", "rosserial", "rtps_net",
    "rtc/cli", "rtc/corba", "rtc/examples", "rtc/manager", "rtc/shim", "rtc/*/test_over_corba.py",
    "rtc/data/test_processes.py", "rtc/data/test_space_ros.py", "rtc/test_guide.py",
    "test_bench_*.py", "test_guide*.py", "test_parameters_guide.py",
)  # fmt: skip
"""Tests that meet other programs in real time, by folder or file. A machine that stalls for seconds, or a peer that
loses its own way, makes one fail now and then. So each has a second chance, and the summary names who needed it."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Give the tests of REAL_TIME their second chance."""
    here = Path(__file__).parent
    for item in items:
        path = item.path.relative_to(here)
        places = {path.as_posix(), *(folder.as_posix() for folder in path.parents)}
        if any(fnmatch(place, pattern) for place in places for pattern in REAL_TIME):
            item.add_marker(pytest.mark.flaky(reruns=1))
