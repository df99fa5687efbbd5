"""Which space a context stands on: one of its own making, or the one that a URL names."""

from __future__ import annotations

import asyncio
import atexit
import os
from contextlib import suppress
from importlib import import_module
from typing import Final

from muros.rclc.errors import RclError
from muros.space._door import ClosedError, Space, SpaceError, UnknownEngineError
from muros.space._registry import open_space
from muros.space.rclc._ground import Ground
from muros.space.rclc._middleware import SpaceMiddleware
from muros.space.rclc._serving import server

__all__ = ["open_way"]

LARGEST_DOMAIN: Final = 232
"""The ports of a larger one do not exist (DDSI-RTPS 2.3, 9.6.1.1)."""

_ELSEWHERE: Final = "Make the context in the thread of that loop, or give it a space of its own"

_grounds: Final[dict[object, Ground]] = {}
"""By URL with the domain, or by the identity of a space that was given."""


def open_way(way: str | Space, domain: int | None = None) -> SpaceMiddleware:
    """What carries a context whose way is a URL (`dds:`, `dds:42`, `local:`) or a space.

    All contexts of a process that name the same engine and domain stand on one space. `domain` None means that of the
    URL, else that of the space. ValueError for a URL that names nothing, or two domains at once; RclError for a space
    that is closed, that is served by another asyncio loop, or that cannot be had here. A space given in an asyncio
    program is served by the program's loop, so that an agent there can share it.
    """
    serving = server()
    with serving.lock:
        ground = _of_url(way, domain) if isinstance(way, str) else _grounds.get(id(way))
        if ground is None:
            assert not isinstance(way, str)
            ground = _grounds[id(way)] = _prepare(way, id(way), owned=False)
        elif not ground.served and ground.loop is not asyncio._get_running_loop():
            raise RclError(f"the space is attached to another event loop. {_ELSEWHERE}")
        return SpaceMiddleware(ground, ground.space.domain if domain is None else domain)


def _of_url(url: str, domain: int | None) -> Ground:
    """The ground of a URL, made if there is none yet."""
    wrong = import_module("muros.rclc.host.checks").WrongValueError
    engine, _, rest = url.partition(":")
    if rest.isascii() and rest.isdigit():
        if int(rest) > LARGEST_DOMAIN:
            raise wrong(f"{url!r}: a domain is from 0 to {LARGEST_DOMAIN}")
        if domain is not None and domain != int(rest):
            raise wrong(f"{url!r} with domain_id={domain}: name the domain once")
    elif not rest and domain is not None:
        rest = str(domain)
    try:
        space = open_space(f"{engine}:{rest}" if rest else url)
    except UnknownEngineError as error:
        raise wrong(f"{error}. Through an agent: Context(Udp('127.0.0.1', 8888))") from None
    except SpaceError as error:
        raise wrong(str(error)) from None
    key = f"{engine}:{space.domain}" if not rest or rest.isdigit() else url
    ground = _grounds.get(key)
    if ground is None:
        ground = _grounds[key] = _prepare(space, key, owned=True)
    else:
        space.close()  # it was never in use
    return ground


def _prepare(space: Space, key: object, *, owned: bool) -> Ground:
    """A ground for a space: served by us, or if it was given by the asyncio loop of its program."""
    serving = server()
    running = None if owned else asyncio._get_running_loop()

    def forget() -> None:
        _grounds.pop(key, None)

    serving.use()  # the loop must outlive a failure here
    try:
        for loop in filter(None, (running, serving.loop)):
            try:
                space.attach(loop)
            except ClosedError as error:
                raise RclError(str(error)) from None
            except SpaceError as error:
                reason = str(error)
                continue
            return Ground(space, serving, loop, forget, owned=owned)
    finally:
        serving.release()
    if owned:
        space.close()
        raise RclError(reason)
    raise RclError(f"{reason.rstrip('.')}. {_ELSEWHERE}")


def _goodbye() -> None:
    """Close what is open still, so that nothing of us stays in the graph."""
    for ground in list(_grounds.values()):
        for context in list(ground.contexts):
            with suppress(Exception):  # the program is over: there is nobody left to tell
                context.close()


atexit.register(_goodbye)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_grounds.clear)
