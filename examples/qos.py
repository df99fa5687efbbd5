"""Quality of service: a map that late listeners get too, and a sensor whose lost samples nobody sends again.

    python qos.py dds: publish
    python qos.py dds: listen                        # as late as you like

prints

    map 1
    sensor 7
"""

import sys

from way import open_context

from muros.client import Qos
from muros.rclc import Executor

from std_msgs.msg import Int32

LATCHED = Qos(reliable=True, depth=1, durability="transient_local")

context = open_context()
role = sys.argv[2] if len(sys.argv) > 2 else "listen"
node = context.node("qos_" + role)
if role == "publish":
    map_publisher = node.publisher(Int32, "map", LATCHED)
    sensor_publisher = node.publisher(Int32, "sensor", "sensor_data")
    measured = Int32(data=0)

    def draw() -> None:
        """Publishes the map once; it waits for who asks for it."""
        if map_publisher.publish(Int32(data=1)):
            drawing.cancel()
            print("the map is out")

    def measure() -> None:
        """Publishes a value: what is lost is lost, the next comes soon."""
        measured.data += 1
        sensor_publisher.publish(measured)

    drawing = node.timer(0.1, draw)
    node.timer(0.1, measure)
else:
    node.subscription(Int32, "map", lambda message: print("map", message.data), LATCHED)
    node.subscription(Int32, "sensor", lambda message: print("sensor", message.data), "sensor_data")
Executor(context).spin()
