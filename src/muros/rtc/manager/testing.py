"""For tests of components: a manager that meets nobody by chance.

    def test_it_doubles() -> None:
        with running(Doubler) as component:
            activate(component)
            ...

It listens on this machine only, on a port that is free, has no name service and writes no log.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TypeVar

from muros.rtc.codes import ReturnCode, RtcError
from muros.rtc.component import Component
from muros.rtc.manager._defaults import DEFAULTS, host_properties
from muros.rtc.manager._manager import Manager
from muros.rtc.manager._settings import Settings
from muros.rtc.properties import Properties

__all__ = ["activate", "running", "running_manager"]

C = TypeVar("C", bound=Component)

ALONE: Mapping[str, str] = {
    "corba.endpoints": "127.0.0.1:",
    "corba.master_manager": "127.0.0.1:1",
    "naming.enable": "NO",
    "logger.enable": "NO",
    "manager.shutdown_auto": "NO",
    "manager.shutdown_on_nortcs": "NO",
    "manager.corba_servant": "NO",
}
"""The settings that keep a manager to itself."""


@contextmanager
def running_manager(settings: Mapping[str, str] | None = None) -> Iterator[Manager]:
    """A manager that runs until the block ends; `settings` win over those that keep it to itself."""
    properties = Properties({**host_properties(), **ALONE, **(settings or {})}, defaults=DEFAULTS)
    with Manager(Settings(properties, None)) as manager:
        manager.start()
        yield manager


@contextmanager
def running(kind: type[C], properties: Mapping[str, str] | None = None) -> Iterator[C]:
    """An instance of a component, initialized and inactive; the block's end is its end.

    `properties` are as in a request to a manager: `{"conf.default.gain": "2"}`. RtcError where it cannot be made.
    """
    with running_manager() as manager:
        manager.register(kind)
        asked = "&".join(f"{key}={text}" for key, text in (properties or {}).items())
        name = kind.spec()["implementation_id"]
        component = manager.create_component(f"{name}?{asked}" if asked else name)
        assert isinstance(component, kind)
        yield component


def activate(component: Component) -> None:
    """Make a component active in all its own contexts. RtcError where it does not become so."""
    for context in component.owned_contexts:
        code = context.activate_component(component.participation)
        if code is not ReturnCode.RTC_OK:
            raise RtcError(f"{component.instance_name} does not become active: {code.name}")
