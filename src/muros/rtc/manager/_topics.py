"""Ports that find each other by a topic: `publish_topic`, `subscribe_topic` and `rendezvous_point` of rtc.conf.

A port with a topic has a name in the naming service below the topic's context, of a kind that says what it is:

| port | key | name |
| --- | --- | --- |
| OutPort | `publish_topic` | `dataports.port_cxt/TOPIC.topic_cxt/INSTANCE.PORT.outport` |
| InPort | `subscribe_topic` | `dataports.port_cxt/TOPIC.topic_cxt/INSTANCE.PORT.inport` |
| service port | `rendezvous_point` | `svcports.port_cxt/TOPIC.topic_cxt/INSTANCE.PORT.svc` |

Each port is connected with all of the other kind in its topics: when its component comes, and at each update of names.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Final

from muros.rtc.codes import PortType, ReturnCode, RtcError
from muros.rtc.component import Component
from muros.rtc.manager._world import World
from muros.rtc.ports import Port
from muros.rtc.profiles import ConnectorProfile
from muros.rtc.properties import split_list
from muros.rtc.reports import Reporter

__all__ = ["Topics"]


@dataclass(frozen=True, slots=True)
class _Kind:
    """How ports of one kind meet others."""

    key: str
    context: str
    own: str
    """The kind of their names."""
    others: str
    """The kind of the names of those that they look for."""


KINDS: Final = {
    PortType.DATA_OUT: _Kind("publish_topic", "dataports", "outport", "inport"),
    PortType.DATA_IN: _Kind("subscribe_topic", "dataports", "inport", "outport"),
    PortType.SERVICE: _Kind("rendezvous_point", "svcports", "svc", "svc"),
}

CONNECTION: Final = {
    "dataport.dataflow_type": "push",
    "dataport.interface_type": "corba_cdr",
    "dataport.subscription_type": "new",
}
"""What data ports that meet in a topic agree on, where their configuration says nothing else."""


class Topics:
    """The topics of the ports of a process."""

    def __init__(self, world: World, reporter: Reporter) -> None:
        self._world = world
        self._reporter = reporter
        self._lock = threading.Lock()
        self._names: dict[Port, tuple[str, ...]] = {}

    def join(self, component: Component) -> None:
        """Name the ports of a new component that have topics, and connect them with those that are there."""
        for port in component.ports:
            if not isinstance(port, Port) or port.owner is not component:
                continue  # a composite shows ports of its members, maybe of other processes: they are not its own
            kind = KINDS[port.port_type]
            contexts = _contexts(port, kind)
            if not contexts:
                continue
            names = tuple(f"{context}/{port.full_name}.{kind.own}" for context in contexts)
            with self._lock:
                self._names[port] = names
            self._world.bind(names, self._world.port_reference(port))
            self._connect(port)

    def leave(self, component: Component) -> None:
        """Take the names of a component's ports back."""
        with self._lock:
            gone = [port for port in self._names if port.owner is component]
            names = [name for port in gone for name in self._names.pop(port)]
        self._world.unbind(names)

    def update(self) -> None:
        """Connect with those that have come meanwhile."""
        with self._lock:
            ports = tuple(self._names)
        for port in ports:
            self._connect(port)

    def _connect(self, port: Port) -> None:
        kind = KINDS[port.port_type]
        for context in _contexts(port, kind):
            for name, peer in self._world.ports_in(context, kind.others):
                connected = {other for connector in port.connectors for other in connector.ports}
                if peer in connected:
                    continue
                properties = {} if port.port_type is PortType.SERVICE else CONNECTION
                own = {f"dataport.{key}": text for key, text in port.configuration.items() if key in _CHOSEN}
                pair = (peer, port) if port.port_type is PortType.DATA_IN else (port, peer)
                profile = ConnectorProfile(f"{port.full_name}_{name}", "", pair, {**properties, **own})
                try:
                    code, _ = port.connect(profile)
                except RtcError as error:
                    self._tell(port, name, str(error))
                    continue
                if code not in (ReturnCode.RTC_OK, ReturnCode.PRECONDITION_NOT_MET):  # both may try at once
                    self._tell(port, name, code.name)

    def _tell(self, port: Port, name: str, why: str) -> None:
        self._reporter.report(
            "topic-not-connected",
            who=port.full_name,
            what=f"{port.full_name} could not be connected with {name}, which has the same topic",
            why=why,
            subject=name,
        )


_CHOSEN: Final = frozenset(["dataflow_type", "interface_type", "subscription_type"])


def _contexts(port: Port, kind: _Kind) -> list[str]:
    topics = split_list(port.configuration.get(kind.key, ""))
    return [f"{kind.context}.port_cxt/{topic}.topic_cxt" for topic in topics]
