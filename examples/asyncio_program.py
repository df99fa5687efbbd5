"""An executor beside the other tasks of an asyncio program. For computers.

    python asyncio_program.py local:

prints

    a task counts 1
    heard 1
    a task counts 2
    heard 2
"""

import asyncio

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import Int32


async def main() -> None:
    """Spins, and counts in a task."""
    context = open_context()
    node = context.node("asyncio_program")
    publisher = node.publisher(Int32, "count")
    heard: asyncio.Queue[int] = asyncio.Queue()
    node.subscription(Int32, "count", lambda message: heard.put_nowait(message.data))
    spinning = asyncio.create_task(Executor(context).spin_async())
    for number in range(1, 4):
        await asyncio.sleep(0.2)
        print("a task counts", number)
        publisher.publish(Int32(data=number))
        print("heard", await heard.get())
    spinning.cancel()
    context.close()


asyncio.run(main())
