"""Two nodes in one program: both in one session with the agent, each with a namespace and topics of its own.

    python int32_multinode.py dds:                   # then: muros node list

prints

    /one/counter sent: 0
    /two/counter sent: 0
"""

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import Int32

context = open_context()


class Counter:
    """A node that counts."""

    def __init__(self, namespace: str) -> None:
        self.name = "/" + namespace + "/counter"
        self.message = Int32(data=0)
        node = context.node("counter", namespace=namespace)
        self.publisher = node.publisher(Int32, "int32")
        node.timer(0.2, self.send)

    def send(self) -> None:
        """Publishes the number."""
        if self.publisher.publish(self.message):
            print(self.name, "sent:", self.message.data)
            self.message.data += 1


counters = [Counter("one"), Counter("two")]
Executor(context).spin()
