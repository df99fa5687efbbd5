"""Looking for an agent on MicroPython: the real one is found, and what was found works."""

from muros.links import DiscoveryLink, UdpLink
from tests.client.agent_thread import RunningAgent
from tests.micropython.runtimes import require
from tests.micropython.unix import run_mpy

PROGRAM = """
import sys
from muros.client import Udp, discover, ping
from muros.rclc import Context
from muros.compat import ticks_diff, ticks_ms

((host, port),) = discover(["127.0.0.1"], int(sys.argv[1]), 5)
print(host, port, ping(Udp(host, port), 5))
context = Context(Udp(host, port))
start = ticks_ms()
while context.state != "CONNECTED":
    assert ticks_diff(ticks_ms(), start) < 8000
    context.middleware.spin_once()
    context.middleware.wait(20)
print(context.ping(5.0))
context.close()
"""


def test_r20_r21_autodiscover() -> None:
    require("unix")
    data, door = UdpLink(0, "127.0.0.1"), DiscoveryLink(0)
    agent = RunningAgent(data, door)
    try:
        assert run_mpy(PROGRAM, [str(door.port)]) == f"127.0.0.1 {data.port} True\nTrue\n"
    finally:
        agent.stop()
