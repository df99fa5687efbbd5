"""ROS 1 graphs, with client code of our own: the master's and the nodes' XML-RPC, topics and services over TCPROS.

A :class:`Ros1Node` is a node among the rospy and roscpp nodes of a master; messages are ROS 1 bytes. What is wrong with
a name, a master or another node raises :class:`Ros1Error`, or is reported where it happens by itself. Everything runs
in one asyncio event loop.
"""

from muros.ros1._errors import Ros1Error
from muros.ros1._names import MASTER_URI, master_uri, own_host, resolve
from muros.ros1._node import Ros1Node
from muros.ros1._parameters import ParameterTree
from muros.ros1._services import Request, ServiceClient, ServiceServer, ServiceType
from muros.ros1._topics import ANY, Publication, Subscription, TopicType
from muros.ros1._wire import Blocks, WireError, block, header, header_untrusted
from muros.ros1._xmlrpc import ApiError, ApiServer, UnreachableError, call

__all__ = [
    "ANY",
    "MASTER_URI",
    "ApiError",
    "ApiServer",
    "Blocks",
    "ParameterTree",
    "Publication",
    "Request",
    "Ros1Error",
    "Ros1Node",
    "ServiceClient",
    "ServiceServer",
    "ServiceType",
    "Subscription",
    "TopicType",
    "UnreachableError",
    "WireError",
    "block",
    "call",
    "header",
    "header_untrusted",
    "master_uri",
    "own_host",
    "resolve",
]
