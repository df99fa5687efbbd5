"""A device's link to an agent: transports, the session, ping, time synchronisation, discovery.

Names are imported when they are first used, so that a board loads only what its program needs. Hosts have a session
that checks more and says more.
"""

from muros.compat import MPY, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client.custom import Custom as Custom
    from muros.client.discovery import discover as discover
    from muros.client.link import CONNECTED as CONNECTED
    from muros.client.link import CONNECTING as CONNECTING
    from muros.client.link import LOST as LOST
    from muros.client.link import WAITING as WAITING
    from muros.client.presence import ping as ping
    from muros.client.qos import Qos as Qos
    from muros.client.serial import Serial as Serial
    from muros.client.session import Session as Session
    from muros.client.tcp import Tcp as Tcp
    from muros.client.timesync import TimeSync as TimeSync
    from muros.client.uart import Uart as Uart
    from muros.client.udp import Udp as Udp

_MODULES = (
    "Custom custom discover discovery CONNECTED link CONNECTING link LOST link WAITING link ping presence Qos qos "
    "Serial serial Session session Tcp tcp TimeSync timesync Uart uart Udp udp"
)
if not MPY:
    _MODULES = _MODULES.replace("session", "hosts")
    __all__ = [name for name in _MODULES.split()[::2] if name != "Uart"]


def __getattr__(name: str) -> object:
    words = _MODULES.split()
    for i in range(0, len(words), 2):
        if words[i] == name:
            module = __import__("muros.client." + words[i + 1], None, None, (name,))
            return getattr(module, name)
    raise AttributeError(name)
