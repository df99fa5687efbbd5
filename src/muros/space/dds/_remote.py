"""A participant of somebody else, as the graph knows it."""

from __future__ import annotations

from typing import Final

from muros.rtps import EndpointData, ParticipantData, user_values, vendor_name
from muros.space._graph import ParticipantInfo, full_name
from muros.space._participant import PARTICIPANT_ID
from muros.space.dds._dialects import Dialect
from muros.space.dds._discovery_info import NodeEntities

__all__ = ["VERSION", "Remote"]

VERSION: Final = "muros.version"
"""Property by which participants of muros tell what they are: no vendor id is assigned to it."""

VENDOR_LENGTH: Final = 64
"""Characters shown of what a participant says it is."""

_HOST: Final = ("dds.sys_info.hostname", "fastdds.physical_data.host", "__Hostname")
_PID: Final = ("dds.sys_info.process_id", "fastdds.physical_data.process", "__Pid")
"""Properties by which implementations tell where they run."""


class Remote:
    """A participant, its nodes and endpoints."""

    def __init__(self, data: ParticipantData, domain: int) -> None:
        self.data = data
        self.domain = domain
        self.dialect: Final = Dialect.of(data.vendor)
        self.endpoints: dict[bytes, EndpointData] = {}
        self._nodes: tuple[ParticipantInfo, ...] = ()
        self._node_of: dict[bytes, ParticipantInfo] = {}
        properties = dict(data.properties)
        version = properties.get(VERSION)
        vendor = vendor_name(data.vendor) if version is None else f"muros {version}"[:VENDOR_LENGTH]
        self.bare: Final = ParticipantInfo(
            gid=data.guid,
            name="",
            namespace="/",
            domain=domain,
            enclave=user_values(data.user_data).get("enclave", ""),
            owner=f"participant {data.prefix.hex()} ({vendor})",
            vendor=vendor,
            host=_first(properties, _HOST),
            pid=_first(properties, _PID),
        )
        """Itself, without nodes."""

    @classmethod
    def unknown(cls, gid: bytes, domain: int) -> ParticipantInfo:
        """What there is to say of the participant of an endpoint when there is no such participant (any more)."""
        return ParticipantInfo(
            gid[:12] + PARTICIPANT_ID, "", "/", domain, "", f"participant {gid[:12].hex()}"
        )

    @property
    def infos(self) -> tuple[ParticipantInfo, ...]:
        """Its nodes, or itself while it has none."""
        return self._nodes or (self.bare,)

    def info_of(self, gid: bytes) -> ParticipantInfo:
        """The node that has an endpoint; itself when none says so."""
        return self._node_of.get(gid, self.bare)

    def set_nodes(self, nodes: tuple[NodeEntities, ...]) -> list[EndpointData]:
        """These are its nodes now. Returns the endpoints known that belong to another node than before."""
        bare = self.bare
        infos = []
        before, self._node_of = self._node_of, {}
        for node in nodes:
            info = ParticipantInfo(
                bare.gid, node.name, node.namespace, self.domain, bare.enclave,
                full_name(node.namespace, node.name), bare.vendor, bare.host, bare.pid,
            )  # fmt: skip
            infos.append(info)
            for gid in (*node.readers, *node.writers):
                self._node_of[gid] = info
        self._nodes = tuple(infos)
        return [data for gid, data in self.endpoints.items() if before.get(gid) != self._node_of.get(gid)]


def _first(properties: dict[str, str], names: tuple[str, ...]) -> str:
    return next((properties[name] for name in names if name in properties), "")
