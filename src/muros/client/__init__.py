"""A device's link to an agent: transports, the session, ping, time synchronisation, discovery.

Names are imported when they are first used, so that a board loads only what its program needs. Hosts have a session
that checks more and says more.
"""

from muros.compat import borrow, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client.custom import Custom as Custom
    from muros.client.discovery import discover as discover
    from muros.client.hosts import Session as Session
    from muros.client.link import CONNECTED as CONNECTED
    from muros.client.link import CONNECTING as CONNECTING
    from muros.client.link import LOST as LOST
    from muros.client.link import WAITING as WAITING
    from muros.client.presence import ping as ping
    from muros.client.qos import Qos as Qos
    from muros.client.serial import Serial as Serial
    from muros.client.tcp import Tcp as Tcp
    from muros.client.timesync import TimeSync as TimeSync
    from muros.client.uart import Uart as Uart
    from muros.client.udp import Udp as Udp


def __getattr__(name: str) -> object:
    return borrow("muros.exports").find("client", name)
