"""Asks for a sum, first waiting for the answer, then from an executor, which goes on with other things meanwhile.

    python add_two_ints_client.py dds:

prints

    24 + 42 = 66
    66 + 1 = 67
"""

from way import open_context

from muros.rclc import Executor

from example_interfaces.srv import AddTwoInts

context = open_context()
node = context.node("add_two_ints_client")
client = node.client(AddTwoInts, "add_two_ints")

reply = client.call(AddTwoInts.Request(a=24, b=42), timeout=10.0)
print("24 + 42 =", reply.sum if reply else "nobody answers")


def ask() -> None:
    """Sends a request."""
    if client.send(AddTwoInts.Request(a=66, b=1), answered):
        asking.cancel()


def answered(reply: "AddTwoInts.Response | None") -> None:
    """The answer has come, or None as none did."""
    print("66 + 1 =", reply.sum if reply else "nobody answers")
    context.close()


asking = node.timer(0.1, ask)
Executor(context).spin()
