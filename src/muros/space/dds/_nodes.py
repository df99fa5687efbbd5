"""Nodes: telling others of ours, and hearing of theirs, on `ros_discovery_info`.

Every participant that is a node has a writer of this topic; changes are gathered for a moment before they are told.
One reader is enough for all participants of a domain: that of the one that keeps the books.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from muros._distros import OLD_DISTROS
from muros.rtps import LocalReader, ReaderSettings, Received, WriterSettings
from muros.space._graph import Appeared, Assigned, Vanished
from muros.space._participant import READER_KIND, WRITER_KIND
from muros.space._timers import Timer
from muros.space._values import GID_SIZE
from muros.space.dds._discovery_info import (
    GID_SIZE_OLD,
    INFO_QOS,
    INFO_TOPIC,
    DiscoveryInfo,
    InvalidDiscoveryInfo,
    told_by,
)
from muros.space.dds._endpoints import encapsulated
from muros.space.dds._wire_qos import to_wire

if TYPE_CHECKING:
    from muros.space.dds._domain import DdsDomain
    from muros.space.dds._participant import DdsParticipant

__all__ = ["Nodes"]

GATHERED: Final = 10_000_000
"""ns in which changes of nodes are gathered before others are told."""

NUMBER: Final = 0xFFFFFF
"""Number of the endpoints that carry `ros_discovery_info`; no other endpoint gets that far."""

WRITER: Final = NUMBER << 8 | WRITER_KIND
READER: Final = NUMBER << 8 | READER_KIND

INFO_WRITER: Final = WriterSettings(heartbeat_period=50_000_000, together=5_000_000)
INFO_READER: Final = ReaderSettings(together=10_000_000)
"""Where processes of many nodes meet, what they tell each other shares datagrams."""


class Nodes:
    """The nodes of a domain."""

    def __init__(self, home: DdsDomain, ros_distro: str | None) -> None:
        self._home = home
        self._decided = ros_distro is not None
        self._gid_size = GID_SIZE_OLD if ros_distro in OLD_DISTROS else GID_SIZE
        self._sizes_seen: set[int] = set()
        self._changed: dict[DdsParticipant, None] = {}
        self._timer: Timer | None = None
        self._reader: LocalReader | None = None

    def join(self, participant: DdsParticipant) -> None:
        """A participant of ours has come: tell of it, if it is a node."""
        home = self._home
        if not participant.name:
            if participant.told is not None:
                participant.told.close(home.now())
                participant.told = None
            return
        if participant.told is None:
            participant.told = participant.rtps.writer(
                *INFO_TOPIC,
                to_wire(INFO_QOS, home.core.limits),
                now=home.now(),
                settings=INFO_WRITER,
                entity=WRITER,
                last=home.recall(participant.gid[:12] + WRITER.to_bytes(4, "big")),
            )
        self.changed(participant)

    def leave(self, participant: DdsParticipant, *, lingers: bool) -> None:
        """A participant of ours goes: tell that it is no node any more, if that is not clear from its going."""
        self._changed.pop(participant, None)
        if participant.told is not None:
            if lingers:
                self._write(participant)
            self._home.remember(participant, participant.told.guid, participant.told.last)

    def listen(self, participant: DdsParticipant) -> None:
        """Hear of others' nodes, through this participant of ours."""
        home = self._home
        qos = to_wire(INFO_QOS, home.core.limits)
        self._reader = participant.rtps.reader(
            *INFO_TOPIC, qos, self._hear, now=home.now(), entity=READER, settings=INFO_READER
        )

    def listen_no_more(self) -> None:
        """The participant that listened goes."""
        if self._reader is not None:
            self._reader.close(self._home.now())
            self._reader = None

    def changed(self, participant: DdsParticipant) -> None:
        """The endpoints of a node are others than before: tell everybody soon."""
        if participant.told is None:
            return
        self._changed[participant] = None
        if self._timer is None:
            timers = self._home.core.timers
            self._timer = timers.at(timers.now() + GATHERED, self._tell)

    def _tell(self) -> None:
        """Write what has changed."""
        self._timer = None
        home = self._home
        changed, self._changed = self._changed, {}
        for participant in changed:
            if not participant.closed:
                self._write(participant)
        home.poke()

    def _write(self, participant: DdsParticipant) -> None:
        """Tell of one node as it is now."""
        if participant.told is not None:
            payload = encapsulated(told_by(participant).body(self._gid_size))
            participant.told.write(payload, self._home.now(), source_time=self._home.core.clock())

    def _hear(self, received: Received) -> bool:
        """Somebody tells of its nodes."""
        home = self._home
        remote = home.remotes.get(received.writer[:12])
        payload = received.payload
        if remote is None or len(payload) < 4:
            return True
        try:
            info, size = DiscoveryInfo.parse_untrusted(payload[4:], payload[0] << 8 | payload[1])
        except InvalidDiscoveryInfo as error:
            home.core.report(
                "discovery-info-unreadable",
                who=remote.bare.owner,
                what="the nodes of {n} participant{s} are not known",
                why=str(error),
                remedy="Nothing, if it is no ROS 2; else look at what it writes on ros_discovery_info",
            )
            return True
        before = remote.infos
        moved = remote.set_nodes(info.nodes)
        after = remote.infos
        home.tell_all(Vanished, tuple(each for each in before if each not in after))
        home.tell_all(Appeared, tuple(each for each in after if each not in before))
        if home.core.watchers:
            for endpoint in moved:
                home.core.tell(Assigned(home.shown(endpoint)))
        if info.nodes:
            self._adapt(size)
        home.core.settle()
        return True

    def _adapt(self, size: int) -> None:
        """Tell of our nodes as others do."""
        if size in self._sizes_seen:
            return
        self._sizes_seen.add(size)
        home = self._home
        if len(self._sizes_seen) == 1 and not self._decided and size != self._gid_size:
            self._gid_size = size
            for participant in home.participants.values():
                self.changed(participant)
        elif len(self._sizes_seen) > 1:
            home.core.report(
                "mixed-distros",
                who=f"domain {home.number}",
                what=f"nodes are not seen by everybody in domain {home.number}",
                why="some tell of their nodes as ROS 2 Humble and older do, and some as newer ones do",
                remedy="Say with ros_distro who shall see the nodes of this process",
            )
