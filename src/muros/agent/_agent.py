"""The agent in an asyncio program: its core, its links and one timer.

agent = Agent("dds:")
agent.add_link(UdpLink(8888))
agent.on_event(lambda event: print(event.text()))
agent.on_finding(lambda finding: print(finding.format()))
await agent.run()
"""

import asyncio
import time
from collections.abc import Collection
from dataclasses import replace
from typing import Any

from muros.agent._core import AgentCore, Port
from muros.agent._limits import Limits
from muros.agent._messages import Locator
from muros.agent.events import Event, LinkDown, LinkUp
from muros.agent.profiles import NamedReferences, References
from muros.findings import Findings
from muros.links import Address, Link
from muros.links.serving import LinkDoor, LinkServer, now_ms
from muros.space import Space, open_space

__all__ = ["Agent"]


class Agent(LinkServer[Event, "_AgentDoor"]):
    """A DDS-XRCE agent. Everything it does happens on the thread of the loop that runs it.

    ``space``: a URL (``"dds:"``, the ROS 2 graph; ``"local:"``, only this process) or a space to share with others.
    ``references`` gives a meaning to what clients create by reference; the default is the convention of names.
    ``domain`` is meant by clients that ask for domain 255; None: that of the space. ``limits`` are those of the agent;
    single ``fields`` of `Limits` may be given by name instead.
    """

    def __init__(
        self,
        space: str | Space = "dds:",
        *,
        references: References | None = None,
        findings: Findings | None = None,
        domain: int | None = None,
        limits: Limits | None = None,
        **fields: Any,
    ) -> None:
        self._owns_space = isinstance(space, str)
        if isinstance(space, str):
            findings = findings or Findings()
            space = open_space(space, findings=findings)
        self.space = space
        self.core = AgentCore(
            space,
            references or NamedReferences(),
            findings or space.findings,
            limits=replace(limits or Limits(), **fields),
            wall=time.time_ns,
            default_domain=domain,
        )
        super().__init__(self.core, "agent")

    def add_link(self, link: Link, *, announces: Collection[Link] | None = None) -> Link:
        """Adds a link; it opens when the agent runs, or now if it does. Raises LinkError if it cannot open then.

        ``announces``: the links that a discovery link tells of; None: all that have a place in the network.
        """
        door = _AgentDoor(self, link, announces)
        try:
            self._add(link, door)
        except BaseException:
            self.core.detach(door.port, now_ms())
            raise
        return link

    def remove_link(self, link: Link) -> None:
        """Closes a link; its clients go."""
        door = self._remove(link)
        link.close()
        self.core.detach(door.port, now_ms())

    def locators(self, announced: Collection[Link] | None = None) -> list[Locator]:
        """Where clients that ask for an agent are told to find it: at the ``announced`` links, None for all."""
        return [
            Locator(locator.packed, locator.port)
            for link in self.links
            if not link.discovery_only and (announced is None or link in announced)
            for locator in link.locators()
        ]

    def _attach(self, loop: asyncio.AbstractEventLoop) -> None:
        self.space.attach(loop)

    def _clear(self) -> None:
        for session in list(self.core.clients.values()):
            self.core.remove(session, "the agent stops")
        self.core.graph.close()

    def _release(self) -> None:
        if self._owns_space:
            self.space.close()


class _AgentDoor(LinkDoor):
    def __init__(self, agent: Agent, link: Link, announces: Collection[Link] | None) -> None:
        self._core = agent.core
        self.port: Port = agent.core.attach(
            link,
            discovery_only=link.discovery_only,
            locators=(lambda: agent.locators(announces)) if link.discovery_only else None,
        )
        super().__init__(self.port, agent.core)

    def on_up(self, link: Link, detail: str) -> None:
        """The link or a port of it has become usable."""
        self._core.tell(LinkUp(link.name, detail))

    def on_down(self, link: Link, reason: str) -> None:
        """The link or a port of it has gone."""
        self._core.tell(LinkDown(link.name, reason))

    def on_gone(self, link: Link, address: Address, reason: str) -> None:
        """A peer cannot be reached any more."""
        self._core.gone(self.port, address, reason, now_ms())
