"""The client's transports on MicroPython against the real agent: data both ways, and an agent that goes away."""

from collections.abc import Callable

import pytest

from muros.links import Link, PseudoterminalLink, TcpLink, UdpLink
from tests.client.agent_thread import RunningAgent
from tests.micropython.runtimes import require
from tests.micropython.unix import run_mpy

PROGRAM = """
import sys
from muros.client import LOST, Serial, Session, Tcp, Udp
from muros.compat import ticks_diff, ticks_ms

kind, place = sys.argv[1:3]
session = Session(Serial(place) if kind == "serial" else (Tcp if kind == "tcp" else Udp)("127.0.0.1", int(place)), 7)
node = session.participant("board")
writer = session.writer(node, "rt/loop", "std_msgs/msg/String")
heard = []
session.reader(node, "rt/loop", "std_msgs/msg/String", "default", lambda buf, off, n: heard.append(n))

def spin(done):
    start = ticks_ms()
    while not done():
        assert ticks_diff(ticks_ms(), start) < 8000, (session.state, heard)
        session.spin_once()
        session.wait(20)

spin(lambda: session.state == 2)
for n in (5, 300, 1500):
    spin(lambda: writer.write_bytes(bytes(n)))
spin(lambda: len(heard) == 3)
assert heard == [5, 300, 1500]
transport = session.transport
transport.close()
transport.send(b"nobody", 0, 6)
transport.wait(10)
print("heard")
if kind != "udp":  # the way is gone in the middle: lost, and made again
    session.spin_once()
    assert session.state == LOST
    spin(lambda: session.state == 2)
session.close()
print("done")
"""


@pytest.mark.parametrize(
    ("kind", "make"),
    [
        ("udp", lambda: UdpLink(0, "127.0.0.1")),
        ("tcp", lambda: TcpLink(0, "127.0.0.1")),
        ("serial", PseudoterminalLink),
    ],
)
def test_a_transport_on_micropython(kind: str, make: Callable[[], Link]) -> None:
    require("unix")
    link = make()
    agent = RunningAgent(link)
    try:
        place = (
            (link.device or "") if isinstance(link, PseudoterminalLink) else str(getattr(link, "port", ""))
        )
        assert run_mpy(PROGRAM, [kind, place]) == "heard\ndone\n"
    finally:
        agent.stop()
