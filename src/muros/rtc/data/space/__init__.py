"""The interface type `space`: a data port is a topic of the data space, and so of the ROS 2 graph.

A port is connected alone: `rtcon` and editors ask it for a connection that names no other port.

    dataport.interface_type: space            (or ros2, as OpenRTM-aist's own transport is called)
    dataport.dataflow_type: push
    dataport.topic: chatter                   (default: the port's name)
    dataport.marshaling_type: ros2:std_msgs/Float32     (default: by the data type, see `_messages.TYPES`)

`_messages` says which message type carries which data type, `_transport` brings octets from ports to topics, `_hall`
is the thread that the spaces of this process live in. Nothing of it is imported before a connection asks.
"""

from muros.rtc.data.space._serializers import INTERFACE_TYPES, register_space

__all__ = ["INTERFACE_TYPES", "register_space"]
