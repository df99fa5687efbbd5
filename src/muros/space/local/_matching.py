"""Who meets whom on one topic, and what is said when two do not fit."""

from __future__ import annotations

from functools import partial

from muros.space import _reports
from muros.space._core import Core
from muros.space._endpoint import EngineEndpoint, without
from muros.space._graph import Incompatible, Matched, Unmatched
from muros.space._qos import Mismatch, mismatches
from muros.space.local._reader import LocalReader
from muros.space.local._writer import LocalWriter

__all__ = ["TopicRecord", "reasons_against"]


class TopicRecord:
    """The writers and readers of one topic name in one domain. The tuples are replaced, never changed."""

    __slots__ = ("name", "readers", "writers")

    def __init__(self, name: str) -> None:
        self.name = name
        self.writers: tuple[LocalWriter, ...] = ()
        self.readers: tuple[LocalReader, ...] = ()

    def join(self, endpoint: EngineEndpoint) -> None:
        """`endpoint` comes: it meets everybody on the other side."""
        if isinstance(endpoint, LocalWriter):
            self.writers += (endpoint,)
            for reader in self.readers:
                _meet(endpoint, reader)
        elif isinstance(endpoint, LocalReader):
            self.readers += (endpoint,)
            for writer in self.writers:
                _meet(writer, endpoint)

    def leave(self, endpoint: EngineEndpoint) -> None:
        """`endpoint` goes: those it was matched with lose it."""
        core = endpoint.core
        if isinstance(endpoint, LocalWriter):
            self.writers = without(self.writers, endpoint)
            for reader in endpoint.all_readers():
                endpoint.disconnect(reader)
                _tell_unmatched(core, endpoint, reader)
        elif isinstance(endpoint, LocalReader):
            self.readers = without(self.readers, endpoint)
            for writer in self.writers:
                if writer.reaches(endpoint):
                    writer.disconnect(endpoint)
                    _tell_unmatched(core, writer, endpoint)

    @property
    def empty(self) -> bool:
        """Whether nobody is left."""
        return not self.writers and not self.readers


def reasons_against(writer: LocalWriter, reader: LocalReader) -> tuple[Mismatch, ...]:
    """Why the two do not fit; empty if they do."""
    types = (writer.topic.type_name, reader.topic.type_name)
    if types[0] != types[1] and all(types):  # who was made by a name alone says no type and meets any
        return (_reports.types_differ(*types),)
    return mismatches(writer.qos, reader.qos)


def _meet(writer: LocalWriter, reader: LocalReader) -> None:
    core = writer.core
    reasons = reasons_against(writer, reader)
    if reasons:
        told = partial(_reports.mismatched, core, reader.owner, writer.owner, reader.topic.name, reasons)
        core.notices.append(told)
        if core.watchers:
            core.tell(Incompatible(writer.info(), reader.info(), tuple(str(reason) for reason in reasons)))
        return
    writer.connect(reader)
    if core.watchers:
        core.tell(Matched(writer.info(), reader.info()))


def _tell_unmatched(core: Core, writer: LocalWriter, reader: LocalReader) -> None:
    if reader.deadline is not None and not reader.writers:
        reader.deadline.stop()
    if core.watchers:
        core.tell(Unmatched(writer.info(), reader.info()))
