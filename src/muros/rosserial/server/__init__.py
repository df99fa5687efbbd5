"""The rosserial server: boards with rosserial firmware are nodes of the ROS 2 graph, through any line.

`Server` runs in an asyncio program; `ServerCore` is the same without I/O. `World` is the door to where boards shall be.
"""

from muros.rosserial.server._core import Identity, Port, ServerCore
from muros.rosserial.server._diagnosis import judge
from muros.rosserial.server._door import (
    BodyError,
    Caller,
    NamedService,
    Node,
    Publisher,
    RefusedError,
    Subscriber,
    World,
)
from muros.rosserial.server._door import Server as Answerer
from muros.rosserial.server._limits import Limits
from muros.rosserial.server._lines import BAUD, BAUDS, TCP_PORT, RawFraming, serial_line, tcp_line
from muros.rosserial.server._parameters import flat
from muros.rosserial.server._ros1_world import Ros1World
from muros.rosserial.server._server import NODE_NAME, Server
from muros.rosserial.server._space_world import SpaceWorld
from muros.rosserial.server.events import (
    BoardBack,
    BoardGone,
    BoardHeard,
    BoardLog,
    BoardLost,
    BoardReady,
    BoardReset,
    BufferKnown,
    EndpointSetUp,
    Event,
    LineDown,
    LineUp,
)

__all__ = [
    "BAUD",
    "BAUDS",
    "NODE_NAME",
    "TCP_PORT",
    "Answerer",
    "BoardBack",
    "BoardGone",
    "BoardHeard",
    "BoardLog",
    "BoardLost",
    "BoardReady",
    "BoardReset",
    "BodyError",
    "BufferKnown",
    "Caller",
    "EndpointSetUp",
    "Event",
    "Identity",
    "Limits",
    "LineDown",
    "LineUp",
    "NamedService",
    "Node",
    "Port",
    "Publisher",
    "RawFraming",
    "RefusedError",
    "Ros1World",
    "Server",
    "ServerCore",
    "SpaceWorld",
    "Subscriber",
    "World",
    "flat",
    "judge",
    "serial_line",
    "tcp_line",
]
