"""The rosserial server in an asyncio program: its core, its lines and one timer.

server = Server("dds:")
server.add_serial("/dev/ttyACM0", 57600)
server.add_tcp(11411)
server.on_event(lambda event: print(event.text()))
server.on_finding(lambda finding: print(finding.format()))
await server.run()
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from muros.findings import Findings
from muros.links import Address, LineAddress, Link, LinkError
from muros.links.serving import LinkDoor, LinkServer, now_ms
from muros.rosserial.server._board import Board
from muros.rosserial.server._core import ServerCore
from muros.rosserial.server._door import RefusedError, World
from muros.rosserial.server._limits import Limits
from muros.rosserial.server._lines import BAUD, BAUDS, TCP_PORT, identify, serial_line, tcp_line
from muros.rosserial.server._space_world import SpaceWorld
from muros.rosserial.server._worlds import Worlds
from muros.rosserial.server.events import Event, LineDown
from muros.space import Space, open_space

__all__ = ["NODE_NAME", "Server"]

NODE_NAME = "/serial_node"
"""What boards are called when nothing else is said, as the node of the ROS 1 servers was."""

_GOODBYE_S = 0.05
"""How long lines are kept open for the last frames to leave."""


class Server(LinkServer[Event, "_BoardDoor"]):
    """A rosserial server. Everything it does happens on the thread of the loop that runs it.

    ``space``: a URL (``"dds:"``, the ROS 2 graph; ``"local:"``, only this process), a space to share with others, or
    None if boards shall only be in ``worlds``, which are such places besides and before the space. Boards are called
    ``node_name`` and their line's name, where their link gives them no name. ``remap`` gives topics and services of the
    space other names. ``parameters(node)`` gives the first parameters of the node with that full name.
    ``limits`` are those of the server; single ``fields`` of `Limits` may be given by name instead.
    """

    def __init__(
        self,
        space: str | Space | None = "dds:",
        *,
        worlds: Sequence[World] = (),
        findings: Findings | None = None,
        domain: int | None = None,
        node_name: str = NODE_NAME,
        remap: Mapping[str, str] | None = None,
        parameters: Callable[[str], Mapping[str, Any]] | None = None,
        limits: Limits | None = None,
        **fields: Any,
    ) -> None:
        self._owns_space = isinstance(space, str)
        if isinstance(space, str):
            findings = findings or Findings()
            space = open_space(space, findings=findings)
        self.space = space
        findings = findings or (Findings() if space is None else space.findings)
        self.node_name = "/" + node_name.strip("/")
        made = replace(limits or Limits(), **fields)
        self._in_space: SpaceWorld | None = None
        places = list(worlds)
        if space is not None:
            self._in_space = SpaceWorld(
                space,
                wall=time.time_ns,
                later=self._later,
                remap=remap,
                parameters=parameters,
                depth=made.depth,
                domain=domain,
            )
            places.append(self._in_space)
        if not places:
            raise ValueError("a rosserial server needs a space or a world for its boards")
        world = places[0] if len(places) == 1 else Worlds(places, self._refused_somewhere)
        self.core = ServerCore(world, findings, limits=made, wall=time.time_ns, clock=now_ms)
        super().__init__(self.core, "server")
        self.core.on_unanswered = self._next_baud
        self._finding_baud: set[Link] = set()
        self._told = False

    def add_serial(
        self, devices: str | Sequence[str], baud: int | None = BAUD, *, name: str | None = None
    ) -> Link:
        """Adds serial ports, by path, by-id name or pattern; ``baud`` None: the rate is found out. See `add_link`."""
        return self.add_link(serial_line(devices, baud or BAUD), name=name, find_baud=baud is None)

    def add_tcp(self, port: int = TCP_PORT, host: str | None = None, *, name: str | None = None) -> Link:
        """Adds a port where boards dial in; see `add_link`."""
        return self.add_link(tcp_line(port, host), name=name)

    def add_link(self, link: Link, *, name: str | None = None, find_baud: bool = False) -> Link:
        """Adds a link without framing (`RawFraming`); it opens when the server runs, or now if it does.

        ``name`` is the full name of the board's node; without one boards are called after their lines. With
        ``find_baud`` other rates are tried on serial lines whose boards do not answer. Raises LinkError if it cannot
        open now.
        """
        if find_baud:
            self._finding_baud.add(link)
        door = _BoardDoor(self, link, name)
        link.on_peer = door.on_peer
        link.on_room = door.on_room
        self._add(link, door)
        return link

    def remove_link(self, link: Link) -> None:
        """Closes a link; its boards count as lost."""
        door = self._remove(link)
        for board in door.port.boards.values():
            board.stop()
        link.close()
        self.core.detach(door.port, now_ms())

    async def stop(self) -> None:
        """Tells every board that nobody listens any more, waits until that has left, and closes."""
        if not self._ended and self._loop is not None:
            self.core.stop()
            self._told = True
            with suppress(asyncio.CancelledError):
                await asyncio.sleep(_GOODBYE_S)
        self.close()

    def _attach(self, loop: asyncio.AbstractEventLoop) -> None:
        if self._in_space is not None:
            self._in_space.warm()
        if self.space is not None:
            self.space.attach(loop)

    def _take_leave(self) -> None:
        if not self._told:
            self.core.stop()

    def _clear(self) -> None:
        self.core.close("the server stops")
        if self._in_space is not None:
            self._in_space.close()

    def _release(self) -> None:
        if self._owns_space and self.space is not None:
            self.space.close()

    def _next_baud(self, board: Board) -> bool:
        """Tries another rate with a board that does not answer, if its line has none of its own."""
        link, address = board.output.link, board.output.address
        if link not in self._finding_baud or not isinstance(address, LineAddress):
            return False
        serial: Any = link
        baud = serial.baud_of(address.device)
        at = BAUDS.index(baud) + 1 if baud in BAUDS else 0
        for other in (*BAUDS[at:], *BAUDS[:at]):
            with suppress(LinkError):  # this port may not have all of them
                serial.set_baud(address.device, other)
                break
        board.set_baud(self._doors[serial].port.identify(address).baud)
        return True

    def _refused_somewhere(self, owner: str, what: str, error: RefusedError) -> None:
        self.core.report(
            "refused-in-one-world",
            who=owner,
            subject=what,
            what=f"{what} of {owner} is in one graph and not in another",
            why=error.why,
            remedy=error.remedy,
        )

    def _later(self, call: Callable[[], object]) -> None:
        if self._loop is not None:
            self._loop.call_soon(call)


class _BoardDoor(LinkDoor):
    def __init__(self, server: Server, link: Link, name: str | None) -> None:
        self._core = server.core
        alone = name is not None
        full = "/" + (name or server.node_name).strip("/")
        self.port = server.core.attach(link, lambda address: identify(link, address, full, alone))
        super().__init__(self.port, server.core)

    def on_peer(self, address: Hashable) -> None:
        """Somebody can be spoken to."""
        self.port.up(address, now_ms())

    def on_room(self, address: Hashable) -> None:
        """What waited for a peer has left."""
        self.port.room(address, now_ms())

    def on_up(self, link: Link, detail: str) -> None:
        """The link or a port of it has become usable: `on_peer` says who is there."""

    def on_down(self, link: Link, reason: str) -> None:
        """The link or a port of it has gone."""
        self._core.tell(LineDown(link.name, reason))

    def on_gone(self, link: Link, address: Address, reason: str) -> None:
        """A peer cannot be reached any more."""
        self.port.down(address, reason, now_ms())
