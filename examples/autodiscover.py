"""Finds an agent in the network by itself: no address in the program.

    muros agent udp4 -p 8888 -d                      # -d: answers those who look for it
    python autodiscover.py

prints

    found an agent at 192.168.1.10:8888
    Sent: 0

With a host's name or address as its argument it asks there, and not the whole network.
"""

import sys

from counting import count_up

from muros.client import Udp, discover
from muros.rclc import Context, Executor

hosts = sys.argv[1:2]
port = int(sys.argv[2]) if len(sys.argv) > 2 else 7400
found = discover(hosts, port, attempts=10) if hosts else discover()
if not found:
    print("there is no agent")
    sys.exit(1)
host, port = found[0]
print("found an agent at", host + ":" + str(port))

context = Context(Udp(host, port))
node = context.node("autodiscover")
count_up(node)
Executor(context).spin()
