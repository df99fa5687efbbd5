"""Plays a board with rosserial firmware: four LEDs that others switch, a battery, and a service that tests the buzzer.

    muros rosserial --tcp --bind 127.0.0.1
    python rosserial_board.py 127.0.0.1
    muros topic pub -1 /led_out std_msgs/msg/Byte '{data: 4}'

prints

    connected
    LEDs: 0100

It may talk to a server of ROS 1 as well, and over a serial port: `python rosserial_board.py /dev/ttyS0`. On boards
the classes of messages are files, see docs/rosserial.md.
"""

import sys
from contextlib import suppress
from typing import Any

from muros.rosserial.node_handle import NodeHandle
from muros.rosserial.serial import Serial
from muros.rosserial.tcp import Tcp
from muros.rosserial.types import message, service

Byte = message("std_msgs/Byte")
Float32 = message("std_msgs/Float32")
Trigger = service("std_srvs/Trigger")

host, _, port = sys.argv[1].partition(":")
line = Serial(host) if "/" in host else Tcp(host, int(port or 11411))
node = NodeHandle(line)


def switch(leds: Any) -> None:
    """Each bit is a LED."""
    print(f"LEDs: {leds.data & 15:04b}")


def buzz(request: Any) -> Any:
    """The answer to a call."""
    print("buzz")
    return Trigger.Response(True, "loud and clear")


battery = node.advertise("battery", Float32)
node.subscribe("led_out", Byte, switch)
node.advertise_service("buzzer", Trigger, buzz)

connected, published = False, 0
with suppress(KeyboardInterrupt):
    while True:
        if node.spin_once(20) != connected:
            connected = not connected
            print("connected" if connected else "not connected")
        seconds = node.now()[0]
        if connected and seconds > published:
            battery.publish(Float32(12.5))
            published = seconds
