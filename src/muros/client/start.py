"""How a session is made: its settings, its streams, its buffers. Boards borrow this."""

from muros.client.chance import draw
from muros.compat import MPY, const
from muros.xrce.beginning import begin, make_input, make_output

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client._types import Transport
    from muros.client.session import Session

_STREAM_RELIABLE = const(0x80)
_FIRST_REQUEST = const(10)
_LOGIN = const(1)  # how we are away, see ``link``


def start(
    self: "Session",
    transport: "Transport",
    client_key: "int | bytes | None" = None,
    session_id: int = 0x81,
    mtu: int = 0,
    history: int = 4,
    *,
    creation: str = "binary",
    reference: str = "participant_profile",
    properties: bool = True,
    hard_liveliness: int = 0,
    queue: int = 0,
    largest: int = 0,
    heartbeat: int = 100,
    retry: int = 1000,
    creation_timeout: int = 1000,
    keepalive: int = 1000,
    ping_timeout: int = 300,
    ping_attempts: int = 3,
) -> None:
    """Sets up a session; arguments as for ``Session``."""
    if client_key is None:
        client_key = draw() | 1
    if isinstance(client_key, int):
        client_key = client_key.to_bytes(4, "big")
    if len(client_key) != 4 or client_key == bytes(4):
        raise ValueError("client_key must be 4 bytes or an integer from 1 to 0xFFFFFFFF")
    mtu = (mtu or transport.mtu) - 4
    # what lasts comes before what is made on the way
    begin(self, session_id, client_key, transport.send, largest or mtu * history * (1 if MPY else 64))
    self.reliable = make_output(_STREAM_RELIABLE, mtu, self.head, history, heartbeat)
    self.outputs[_STREAM_RELIABLE] = self.reliable
    self.inputs[_STREAM_RELIABLE] = make_input(_STREAM_RELIABLE, mtu, history)
    self.transport = transport
    self._deliver = self.deliver  # taking a method from its object costs a board memory each time
    self.request = _FIRST_REQUEST - 1
    self.away = _LOGIN
    self.up = False
    self.state = self._tries = self._ping = self.attempt = self.pending = self.laps = 0
    self.drops = [0] * 5
    self.entities = []
    self.objects = {}
    self.asked = {}
    self.counts = [0] * 9
    self.key = client_key
    self.queue = queue
    self.keepalive = keepalive
    self.ping_timeout = ping_timeout
    self.ping_attempts = ping_attempts
    self.retry = retry
    self.creation_timeout = creation_timeout
    if not properties:
        self.properties = False
    if hard_liveliness:
        self.hard_liveliness = hard_liveliness
    if creation != "binary":
        from muros.xrce import create_text

        self.create = create_text.Xml() if creation == "xml" else create_text.Reference(reference)
