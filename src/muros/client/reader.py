"""Readers: they ask the agent for samples with READ_DATA and hand on what comes (DDS-XRCE 1.0, 7.8.5.4)."""

from muros.client.entities import Endpoint
from muros.compat import const
from muros.xrce.create import read_data

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client._types import OnData
    from muros.client.entities import Participant
    from muros.client.qos import AnyQos
    from muros.client.session import Session
    from muros.xrce._types import Buffer

_KIND_DATAREADER = const(6)
_QOS_RELIABLE = const(0x01)
_STREAM_BEST_EFFORT = const(0x01)
_STREAM_RELIABLE = const(0x80)

UNLIMITED = const(0xFFFF)


class Reader(Endpoint):
    """Reads samples; reliable or best effort by its QoS. ``limits`` is what ``read`` asked for."""

    kind = _KIND_DATAREADER
    reads = 1
    limits: "tuple[int, int, int, int] | None" = None

    def __init__(
        self,
        session: "Session",
        node: "Participant",
        name: str,
        type_name: str,
        qos: "AnyQos",
        on_data: "OnData | None",
    ) -> None:
        self.on_data = on_data
        super().__init__(session, node, name, type_name, qos)
        session.objects[self.object_id(2)] = self

    def read(
        self, samples: int = UNLIMITED, seconds: int = 0, bytes_per_second: int = 0, pace: int = 0
    ) -> None:
        """Asks again: for at most ``samples``, for at most so long, at most so fast; 0 means without that limit.

        ``pace`` is the least time between samples in ms. ``samples`` 0 ends the reading. A new reading replaces the
        one before.
        """
        self.limits = (samples, seconds, bytes_per_second, pace)
        session = self.session
        if self.todo == 0 and self.status == 0:
            session.pending += 1
            self.request = session.requests(self.steps + 1)  # the last of them is for the READ_DATA
            self.todo = 1 << self.steps

    def reading(self) -> bytes:
        """The read specification."""
        stream_id = _STREAM_RELIABLE if self.qos.flags & _QOS_RELIABLE else _STREAM_BEST_EFFORT
        samples, seconds, rate, pace = self.limits or (UNLIMITED, 0, 0, 0)
        return read_data(stream_id, samples, seconds, rate, pace)

    def deliver(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes a sample of the agent."""
        if self.on_data is not None:
            self.on_data(buf, off, n)
