"""A UART of a board to an agent, framed as on any serial line (see ``muros.xrce.serial``)."""

from machine import UART

from muros.client.line import Line
from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

_MTU = const(256)
_CHUNK = const(64)


class Uart(Line):
    """UART ``number`` at ``baud``, on its default pins or on ``tx`` and ``rx``.

    ``source`` and ``destination`` are the addresses on the line: a client's is 1, the agent's 0.
    """

    def __init__(
        self,
        number: int,
        baud: int = 115200,
        mtu: int = _MTU,
        source: int = 1,
        destination: int = 0,
        tx: "Any" = None,
        rx: "Any" = None,
    ) -> None:
        super().__init__(mtu, source, destination, _CHUNK)
        if tx is None:
            uart = UART(number, baud, rxbuf=2 * mtu, timeout=0)
        else:
            uart = UART(number, baud, rxbuf=2 * mtu, timeout=0, tx=tx, rx=rx)
        self._attach(uart, uart.readinto, uart.write)

    def open(self) -> bool:
        """A UART is always there."""
        return True

    def close(self) -> None:
        """Nothing to do: the UART stays ours."""
