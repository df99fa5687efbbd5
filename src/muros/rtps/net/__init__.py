"""The network under `muros.rtps`: sockets, interfaces and the settings of ROS 2, on an asyncio loop.

    network = Network(NetworkSettings.from_environment())
    participant = network.core.participant(prefix, name="talker", now=network.clock())
    network.open(asyncio.get_running_loop())
    ...
    network.poke()  # after every call of the core
    ...
    network.close()

`Network` has one pair of unicast ports for all participants of the process in the domain, and hears the domain's
multicast on every interface that is meant; interfaces may come and go.
"""

from muros.rtps.net._environment import NetworkError, NetworkSettings, Range
from muros.rtps.net._interfaces import Interface
from muros.rtps.net._network import Network
from muros.rtps.net._outlets import NetworkCounters

__all__ = ["Interface", "Network", "NetworkCounters", "NetworkError", "NetworkSettings", "Range"]
