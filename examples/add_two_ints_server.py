"""Serves a sum.

    python add_two_ints_server.py dds:               # then: muros service call /add_two_ints \\
                                                     #   example_interfaces/srv/AddTwoInts '{a: 24, b: 42}'

prints

    Service request value: 24 + 42
"""

from way import open_context

from muros.rclc import Executor

from example_interfaces.srv import AddTwoInts


def add(request: "AddTwoInts.Request") -> "AddTwoInts.Response":
    """Answers a request."""
    print("Service request value:", request.a, "+", request.b)
    return AddTwoInts.Response(sum=request.a + request.b)


context = open_context()
context.node("add_two_ints_server").service(AddTwoInts, "add_two_ints", add)
Executor(context).spin()
