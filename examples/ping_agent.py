"""Asks now and then whether the agent is there, and tells how the connection fares.

    python ping_agent.py udp:192.168.1.10:8888

prints

    state CONNECTED
    the agent answers
"""

from way import open_context

from muros.rclc import Executor

context = open_context()
context.on_state(lambda state: print("state", state))
context.node("ping_agent")
executor = Executor(context)
while context.running:
    executor.spin_some(0.5)
    print("the agent answers" if context.ping(0.5) else "the agent does not answer")
