"""How a session is made: its settings, its streams, its buffers. Boards borrow this."""

from array import array

from muros.client.chance import draw
from muros.compat import MPY, const
from muros.xrce.beginning import begin
from muros.xrce.inputs import make as make_input
from muros.xrce.outputs import make as make_output

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client._types import Transport
    from muros.client.session import Session

_STREAM_RELIABLE = const(0x80)
_FIRST_REQUEST = const(10)
_OPTIONS = (
    "creation=binary reference=participant_profile properties=1 hard_liveliness=0 queue=0 largest=0 heartbeat=100 "
    "retry=1000 creation_timeout=1000 keepalive=1000 ping_timeout=300 ping_attempts=3"
)


def start(
    self: "Session",
    transport: "Transport",
    client_key: "int | bytes | None",
    session_id: int,
    mtu: int,
    history: int,
    options: "dict[str, Any]",
) -> None:
    """Sets up a session; arguments as for ``Session``."""
    if client_key is None:
        client_key = draw(3) + bytes((draw(1)[0] | 1,))
    elif isinstance(client_key, int):
        client_key = bytes([client_key >> shift & 255 for shift in (24, 16, 8, 0)])
    if len(client_key) != 4 or client_key == b"\0\0\0\0":
        raise ValueError("client_key must be 4 bytes or an integer from 1 to 0xFFFFFFFF")
    mtu = (mtu or transport.mtu) - 4
    settings: "dict[str, Any]" = {}
    for setting in _OPTIONS.split():
        name, value = setting.split("=")
        settings[name] = int(value) if value.isdigit() else value
    for name in options:
        if name not in settings:
            raise TypeError("Session has no option " + name)
        settings[name] = options[name]
    # what lasts comes before what is made on the way
    begin(self, session_id, client_key, transport.send, self.take, 0)
    self.reliable = make_output(_STREAM_RELIABLE, mtu, self.head, history, settings.pop("heartbeat"))
    self.outputs[_STREAM_RELIABLE] = self.reliable
    self.inputs[_STREAM_RELIABLE] = make_input(_STREAM_RELIABLE, mtu, history)
    self.transport = transport
    self._deliver = self.deliver  # taking a method from its object costs a board memory each time
    self.mtu = mtu
    self.request = _FIRST_REQUEST
    self.login = True
    self.up = False
    self.state = self._heard = self._tries = self._ping = self.pending = self.waiting = 0
    self._due = self.trouble = None
    self.drops = array("I", bytearray(20))
    self.entities = []
    self.objects = {}
    self.counts = array("H", bytearray(18))
    for name in ("queue", "largest", "keepalive", "ping_timeout", "ping_attempts"):
        setattr(self, name, settings.pop(name))
    self.largest = self.largest or mtu * history * (1 if MPY else 64)
    reference = settings.pop("reference")
    creation = settings.pop("creation")
    settings["create"] = None
    if creation != "binary":
        from muros.xrce import create_text

        settings["create"] = create_text.Xml() if creation == "xml" else create_text.Reference(reference)
    settings["key"] = client_key
    settings["attempt"] = b""
    settings["suspected"] = settings["late"] = settings["laps"] = 0
    self.notes = settings
