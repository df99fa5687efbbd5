"""A topic of ROS 2 becomes values at the port of an RT component, scaled.

    muros rtc run topic_to_port.py -f topic_to_port.conf
    ros2 topic pub /speed std_msgs/msg/Float64 "{data: 1.5}"      (or: muros topic pub ...)

topic_to_port.conf connects the port `topic` to the topic; other components connect to the port `out`.
"""

from muros.rtc import Component, InPort, OutPort, Parameter, run
from RTC import TimedDouble


class TopicToPort(Component):
    """Reads a topic of ROS 2 and writes a port"""

    category = "example"
    rate = 100

    topic = InPort(TimedDouble)
    out = OutPort(TimedDouble)

    factor = Parameter(1.0)

    def on_execute(self, context: int) -> None:
        while self.topic.is_new():
            self.out.write(self.factor * self.topic.read().data)


if __name__ == "__main__":
    run(TopicToPort)
