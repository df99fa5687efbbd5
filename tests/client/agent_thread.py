"""The real agent on a thread of its own, for clients that run in real time."""

import asyncio
import threading
from typing import Any

from muros.agent import Agent
from muros.links import Link

PATIENCE = 10.0
"""Seconds until something that must come has come."""


class RunningAgent:
    """An agent on a thread of its own, with one link."""

    def __init__(self, *links: Link, space: str = "local:", **options: Any) -> None:
        self.links = links
        self._space = space
        self.failure: BaseException | None = None
        self._up = threading.Event()
        self._options = options
        self._thread = threading.Thread(target=lambda: asyncio.run(self._main()), daemon=True)
        self._thread.start()
        assert self._up.wait(PATIENCE)
        if self.failure:
            raise self.failure

    async def _main(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._agent = Agent(self._space, **self._options)
        for link in self.links:
            self._agent.add_link(link)
        try:
            await self._agent.start()
        except BaseException as error:
            self.failure = error
            return
        finally:
            self._up.set()
        assert self._agent._closed is not None
        await self._agent._closed.wait()

    def stop(self) -> None:
        """Stops it."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._agent.close)
            self._thread.join(PATIENCE)
