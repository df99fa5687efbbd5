"""Which engine a space's URL means."""

import time
from collections.abc import Callable
from importlib import import_module
from typing import Final, Protocol

from muros.findings import Findings
from muros.space._door import Space, UnknownEngineError

__all__ = ["EngineFactory", "open_space", "register_engine"]


class EngineFactory(Protocol):
    """Makes a space. `rest` is what follows the colon of the URL, `options` are the engine's own."""

    def __call__(
        self, rest: str, *, findings: Findings | None, clock: Callable[[], int], **options: object
    ) -> Space: ...


_ENGINES: Final[dict[str, str | EngineFactory]] = {
    "local": "muros.space.local:open_local",
    "dds": "muros.space.dds:open_dds",
    "cyclonedds": "muros.space.cyclone:open_cyclone",
}
"""Engines by name; as text "module:factory" they are imported when first used."""


def open_space(
    url: str = "local:",
    *,
    findings: Findings | None = None,
    clock: Callable[[], int] = time.time_ns,
    **options: object,
) -> Space:
    """Open the space that `url` names: `local:`, or `local:42` to make 42 the domain of who names none.

    Every call opens a space of its own; who wants to meet shares the space. `findings` is where the space
    reports (default: its own). `clock` gives nanoseconds. For `local:`, `options` are `resource_limit` (samples,
    5000), `max_blocking_time` (ns, 100 ms), `request_wait` (ns, 5 s) and `callbacks` (in one go, 1000).

    UnknownEngineError names the engines there are. SpaceError, ValueError, TypeError: the rest of the URL or an
    option makes no sense.
    """
    name, colon, rest = url.partition(":")
    engine = _ENGINES.get(name) if colon else None
    if engine is None:
        known = ", ".join(f"{known}:" for known in _ENGINES)
        raise UnknownEngineError(f"{url!r} names no data space engine (known: {known})")
    if isinstance(engine, str):
        module, _, attribute = engine.partition(":")
        factory: EngineFactory = getattr(import_module(module), attribute)
    else:
        factory = engine
    return factory(rest, findings=findings, clock=clock, **options)


def register_engine(name: str, factory: EngineFactory) -> None:
    """Make `factory` the engine of URLs that begin with `name` and a colon. ValueError if the name is taken."""
    if not name or ":" in name:
        raise ValueError(f"{name!r} is no name for an engine; take one word without a colon")
    if name in _ENGINES:
        raise ValueError(f"there is an engine {name!r} already")
    _ENGINES[name] = factory
