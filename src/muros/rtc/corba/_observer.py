"""Observers over CORBA: objects of editors and tools that a component calls with what becomes of it.

They come in by SDO's Configuration.add_service_profile. What they are told, and when, is `muros.rtc.observers`' and
`muros.rtc.status`' business.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, Final

from omniORB import CORBA

from muros.rtc.codes import RtcError
from muros.rtc.corba._conversion import texts_of
from muros.rtc.corba._lost import quick_answer
from muros.rtc.corba._stubs import RTC, OpenRTM
from muros.rtc.observers import Dialect, Observer, ObserverOptions, StatusKind
from muros.rtc.properties import split_list
from muros.rtc.status import watch

if TYPE_CHECKING:
    from muros.rtc.component import Component

__all__ = ["Observers"]

MAX_OBSERVERS: Final = 100
"""Observers of one component: each has a thread."""

_INTERFACES: Final = {
    Dialect.OPENRTM: (OpenRTM.ComponentObserver, OpenRTM.StatusKind),
    Dialect.RTC: (RTC.ComponentObserver, RTC.StatusKind),
}


class Observers:
    """The observers of one component, by the ids of their service profiles. Any thread may call."""

    def __init__(self, component: Component) -> None:
        self._component = component
        self._lock = threading.Lock()
        self._observers: dict[str, Observer] = {}
        self._closed = False

    def add(self, profile: Any) -> bool:
        """Tell an observer from now on; one of the same id is replaced.

        False for what is no observer, does not answer, is not enabled (`sdo.service.consumer.enabled_services`), or
        asks for what cannot be; and beyond MAX_OBSERVERS.
        """
        observer = self._made(profile)
        if observer is None:
            return False
        with self._lock:
            before = self._observers.pop(profile.id, None)
            refused = self._closed or len(self._observers) >= MAX_OBSERVERS
            if not refused:
                self._observers[profile.id] = observer
        if before is not None:
            before.close()
        if refused:
            observer.close()
            return False
        watch(self._component, observer)
        return True

    def remove(self, id_: str) -> bool:
        """Tell an observer no longer. False where there is none of this id."""
        with self._lock:
            observer = self._observers.pop(id_, None)
        if observer is None:
            return False
        observer.close()
        return True

    def close(self) -> None:
        """Tell nobody any more."""
        with self._lock:
            self._closed = True
            observers, self._observers = tuple(self._observers.values()), {}
        for observer in observers:
            observer.close()

    def _made(self, profile: Any) -> Observer | None:
        properties = self._component.properties
        enabled = split_list(properties.get("sdo.service.consumer.enabled_services", "ALL"))
        try:
            dialect = Dialect(profile.interface_type)
            if "ALL" not in enabled and dialect.value not in enabled:
                return None
            interface, kinds = _INTERFACES[dialect]
            with quick_answer():
                reference = profile.service._narrow(interface) if profile.service is not None else None
            options = ObserverOptions.from_properties(texts_of(profile.properties), dialect)
        except (CORBA.Exception, RtcError, ValueError):
            return None
        if reference is None:
            return None
        items = {str(item): item for item in kinds._items}

        def send(kind: StatusKind, hint: str) -> None:
            with quick_answer():
                reference.update_status(items[kind.value], hint)

        return Observer(
            send,
            options,
            dialect,
            who=f"an observer of {self._component.instance_name}",
            on_gone=lambda: self.remove(profile.id),
            report=self._component.reporter.take,
        )
