"""Settings that all tests share."""

import os
import signal

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
