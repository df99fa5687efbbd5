"""The agent in an asyncio program: its core, its links and one timer.

agent = Agent("dds:")
agent.add_link(UdpLink(8888))
agent.on_event(lambda event: print(event.text()))
agent.on_finding(lambda finding: print(finding.format()))
await agent.run()
"""

import asyncio
import time
from collections.abc import Callable, Collection, Hashable
from dataclasses import replace
from typing import Any

from muros.agent._core import AgentCore, Port
from muros.agent._limits import Limits
from muros.agent._messages import Locator
from muros.agent.events import Event, LinkDown, LinkUp
from muros.agent.profiles import NamedReferences, References
from muros.findings import Finding, Findings
from muros.links import Link
from muros.space import Space, open_space

__all__ = ["Agent"]

_NS_PER_MS = 1_000_000


class Agent:
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
        if isinstance(space, str):
            self.findings = findings or Findings()
            self.space = open_space(space, findings=self.findings)
            self._owns_space = True
        else:
            self.findings = findings or space.findings
            self.space = space
            self._owns_space = False
        self.core = AgentCore(
            self.space,
            references or NamedReferences(),
            self.findings,
            limits=replace(limits or Limits(), **fields),
            wall=time.time_ns,
            default_domain=domain,
        )
        self.core.on_event = self._tell
        self.core.on_wake = self._arm
        self.links: list[Link] = []
        self._adapters: dict[Link, _LinkAdapter] = {}
        self._watchers: list[Callable[[Event], object]] = []
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._timer_at = 0
        self._closed: asyncio.Event | None = None
        self._ended = False

    def add_link(self, link: Link, *, announces: Collection[Link] | None = None) -> Link:
        """Adds a link; it opens when the agent runs, or now if it does. Raises LinkError if it cannot open then.

        ``announces``: the links that a discovery link tells of; None: all that have a place in the network.
        """
        adapter = _LinkAdapter(self, link, announces)
        if self._loop is not None:
            try:
                link.open(adapter)
            except BaseException:
                self.core.detach(adapter.port, _now())
                raise
        self.links.append(link)
        self._adapters[link] = adapter
        return link

    def remove_link(self, link: Link) -> None:
        """Closes a link; its clients go."""
        self.links.remove(link)
        adapter = self._adapters.pop(link)
        link.close()
        self.core.detach(adapter.port, _now())

    def on_event(self, callback: Callable[[Event], object]) -> Callable[[], None]:
        """Calls ``callback`` with every event from now on; returns a function that ends it."""
        self._watchers.append(callback)
        return lambda: self._watchers.remove(callback)

    def on_finding(self, callback: Callable[[Finding], object]) -> Callable[[], None]:
        """Calls ``callback`` with every new finding and with summaries; returns a function that ends it."""
        return self.findings.on_finding(callback)

    async def start(self) -> None:
        """Opens the links and serves in the background. Raises LinkError; no link is open then, and one may try again.

        Raises RuntimeError for an agent that serves already or was closed: make a new one.
        """
        if self._loop is not None or self._ended:
            raise RuntimeError(
                "this agent was closed: make a new one" if self._ended else "this agent runs already"
            )
        self._loop = asyncio.get_running_loop()
        self._closed = asyncio.Event()
        try:
            self.space.attach(self._loop)
            for link in self.links:
                link.open(self._adapters[link])
        except BaseException:
            self._stop()
            raise
        self._arm(_now())

    async def run(self) -> None:
        """Opens the links and serves until `close` is called or the task is cancelled. Raises LinkError."""
        await self.start()
        assert self._closed is not None
        try:
            await self._closed.wait()
        finally:
            self.close()

    def close(self) -> None:
        """Closes every link and removes every client, for good. Closing twice is harmless."""
        if self._ended:
            return
        self._ended = True
        self._stop()
        for session in list(self.core.clients.values()):
            self.core.remove(session, "the agent stops")
        self.core.graph.close()
        self.findings.flush()
        if self._owns_space:
            self.space.close()
        if self._closed is not None:
            self._closed.set()

    def _stop(self) -> None:
        self._loop = None
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        for link in self.links:
            link.close()

    def locators(self, announced: Collection[Link] | None = None) -> list[Locator]:
        """Where clients that ask for an agent are told to find it: at the ``announced`` links, None for all."""
        return [
            Locator(locator.packed, locator.port)
            for link in self.links
            if not link.discovery_only and (announced is None or link in announced)
            for locator in link.locators()
        ]

    def _tell(self, event: Event) -> None:
        for callback in list(self._watchers):
            try:
                callback(event)
            except Exception as error:  # whoever watches must not harm those who are watched
                self.core.report(
                    "watcher-failed",
                    who=getattr(callback, "__qualname__", repr(callback)),
                    what="{n} event{s} not taken by a watcher of the agent",
                    why=f"it raised {type(error).__name__}: {error}",
                    remedy="Mend the callback given to on_event.",
                )

    def _arm(self, tick: int) -> None:
        """Sees to a call of `_tick` at ``tick`` (ms) at the latest."""
        if self._loop is None or (self._timer is not None and self._timer_at <= tick):
            return
        if self._timer is not None:
            self._timer.cancel()
        self._timer_at = tick
        self._timer = self._loop.call_later(max(0, tick - _now()) / 1000, self._tick)

    def _tick(self) -> None:
        self._timer = None
        now = _now()
        waits = []
        due = self.core.tick(now)
        if due is not None:
            waits.append(due)
        seconds = time.time()
        findings_due = self.findings.tick(seconds)
        if findings_due is not None:
            waits.append(now + max(0, int((findings_due - seconds) * 1000)) + 1)
        if waits:
            self._arm(min(waits))


class _LinkAdapter:
    """What one link tells the agent: the events of a link, turned into calls of the core."""

    def __init__(self, agent: Agent, link: Link, announces: Collection[Link] | None) -> None:
        self._agent = agent
        self.port: Port = agent.core.attach(
            link,
            discovery_only=link.discovery_only,
            locators=(lambda: agent.locators(announces)) if link.discovery_only else None,
        )

    def on_message(self, link: Link, data: bytes, address: Hashable) -> None:
        """A whole message came."""
        self.port.receive(data, address, time.monotonic_ns() // _NS_PER_MS)

    def on_up(self, link: Link, detail: str) -> None:
        """The link or a port of it has become usable."""
        self._agent._tell(LinkUp(link.name, detail))

    def on_down(self, link: Link, reason: str) -> None:
        """The link or a port of it has gone."""
        self._agent._tell(LinkDown(link.name, reason))

    def on_gone(self, link: Link, address: Hashable, reason: str) -> None:
        """A peer cannot be reached any more."""
        self._agent.core.gone(self.port, address, reason, _now())

    def on_problem(self, link: Link, code: str, what: str, why: str, remedy: str, n: int) -> None:
        """Something was dropped, refused or does not work."""
        self._agent.core.report(code, who=link.name, what=what, why=why, remedy=remedy, n=n)


def _now() -> int:
    return time.monotonic_ns() // _NS_PER_MS
