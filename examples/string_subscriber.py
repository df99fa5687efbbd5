"""Hears text.

    python string_subscriber.py dds:                 # then: muros topic pub /chatter std_msgs/msg/String '{data: hi}'

prints

    I have heard: "hi"
"""

from way import open_context

from muros.rclc import Executor

from std_msgs.msg import String

context = open_context()
node = context.node("string_subscriber")
node.subscription(String, "chatter", lambda message: print('I have heard: "' + message.data + '"'))
Executor(context).spin()
