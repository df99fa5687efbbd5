"""rclpy gets what a board streams through an agent in the ROS 2 graph."""

import zlib

from muros.client import Udp
from muros.links import UdpLink
from muros.rclc import Context, Executor, Streamer
from tests.client.agent_thread import RunningAgent
from tests.dds.peers import Peer

from sensor_msgs.msg import Image

SIZE = 200_000
DATA = bytes(i * 7 & 255 for i in range(SIZE))


def test_an_image_of_200_kb(ros: Peer, dds_url: str) -> None:
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link, space=dds_url)
    domain = int(dds_url.partition(":")[2])
    context = Context(Udp("127.0.0.1", link.port), domain_id=domain)
    ended: list[bool] = []

    def fill(buf: bytearray, off: int, n: int, at: int) -> None:
        buf[off : off + n] = DATA[at : at + n]

    try:
        publisher = context.node("camera").publisher(Image, "image")
        streamer = Streamer(publisher, fill, on_end=ended.append)
        node = ros.do("node", name="screen", domain=domain)
        heard = ros.do("subscription", node=node, topic="/image", type="sensor_msgs/msg/Image")
        assert context.wait_connected(20.0)
        assert ros.do("matched", thing=heard) == 1
        assert publisher.wait_for_subscriptions(1, 20.0)
        assert streamer.publish(Image(height=400, width=500, encoding="mono8", step=500), SIZE)
        assert Executor(context).spin_until(lambda: ended, 20.0)
        (image,) = ros.do("take", subscription=heard)
    finally:
        context.close()
        agent.stop()
    assert ended == [True]
    assert (image["height"], image["width"], image["encoding"]) == (400, 500, "mono8")
    assert image["data"] == {"size": SIZE, "sum": zlib.crc32(DATA)}
