"""What references mean: the profiles of a file, and the built-in convention of names.

A client that creates by reference sends only a name. It is looked up in the profiles file the agent was given
(`muros agent ... --refs FILE`); without one, or where it has no such name, the convention of the agent's own
middleware may give it a meaning::

    NAME__t     the topic NAME
    NAME__dw    a datawriter of the topic NAME
    NAME__dr    a datareader of the topic NAME
    anything    a participant, publisher or subscriber of that name
"""

from collections.abc import Callable, Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Final, Protocol

from muros.agent.xml import MAX_PROFILES, Description, XmlError, parse_profiles_untrusted
from muros.xrce.representation import (
    DataReaderEntity,
    DataWriterEntity,
    Durability,
    EndpointQos,
    Entity,
    Kind,
    ParticipantEntity,
    PublisherEntity,
    SubscriberEntity,
    TopicEntity,
)

NAMED_WRITER_QOS: Final = EndpointQos(depth=16, durability=Durability.TRANSIENT_LOCAL)
"""QoS of a writer made by its name alone: offers all a reader can ask for, keeps 16 samples as the reference does."""
NAMED_READER_QOS: Final = EndpointQos(reliable=False, depth=16)
"""QoS of a reader made by its name alone: asks for nothing a writer might not offer."""


class UnknownReference(LookupError):  # noqa: N818
    """Nobody knows what a reference means. The message says what was looked for and what there is."""


class ProfilesError(ValueError):
    """A profiles file cannot be used. The message is one line with the file, the line and the reason."""


class References(Protocol):
    """Whoever knows what references mean."""

    def lookup(self, kind: Kind, reference: str) -> Entity:
        """The entity of `kind` that `reference` stands for. Raises UnknownReference."""


class Profiles:
    """The profiles of a file, by kind and name."""

    def __init__(self, descriptions: Iterable[Description] = (), source: str = "") -> None:
        self.source = source
        """The file they came from; empty for none."""
        self._by_kind: dict[Kind, dict[str, Description]] = {}
        for description in descriptions:
            self._by_kind.setdefault(description.kind, {})[description.name or ""] = description

    @classmethod
    def load(cls, path: str | Path, max_bytes: int = MAX_PROFILES) -> "Profiles":
        """Read a profiles file. Raises ProfilesError, also when there is no such file."""
        try:
            with open(path, "rb") as file:
                data = file.read(max_bytes + 1)
        except OSError as error:
            raise ProfilesError(f"{path}: {(error.strerror or str(error)).lower()}") from None
        try:
            return cls(parse_profiles_untrusted(data, max_bytes), str(path))
        except XmlError as error:
            where = f"{path}:{error.line}" if error.line else str(path)
            raise ProfilesError(f"{where}: {error}") from None

    def __len__(self) -> int:
        return sum(map(len, self._by_kind.values()))

    def names(self, kind: Kind) -> tuple[str, ...]:
        """The names of the profiles of a kind, in the order of the file."""
        return tuple(self._by_kind.get(kind, ()))

    def notes(self) -> tuple[str, ...]:
        """One line for each profile with elements that have no effect here."""
        return tuple(
            f"{self.source}:{each.line}: no effect in profile {each.name!r}: {', '.join(each.ignored)}"
            for named in self._by_kind.values()
            for each in named.values()
            if each.ignored
        )

    def lookup(self, kind: Kind, reference: str) -> Entity:
        """The profile's entity; publishers and subscribers need none. Raises UnknownReference."""
        known = self._by_kind.get(kind, {})
        if reference in known:
            return known[reference].entity
        if kind in _GROUPS:
            return _GROUPS[kind](reference)
        what = f"{kind.name.lower()} profile {reference[:_SHOWN]!r}"
        if not self.source:
            raise UnknownReference(f"no {what}: the agent was given no profiles file (--refs FILE)")
        close = get_close_matches(reference[:_SHOWN], known, 1)
        hint = f"did you mean {close[0]!r}?" if close else f"it has {_listed(known)} of that kind"
        raise UnknownReference(f"no {what} in {self.source}: {hint}")


class NamedReferences:
    """The convention of names of the agent's own middleware (`ced`, `local`); it needs no file."""

    def lookup(self, kind: Kind, reference: str) -> Entity:
        """What the name itself says. Raises UnknownReference."""
        if kind is Kind.PARTICIPANT:
            return ParticipantEntity(reference)
        if kind in _GROUPS:
            return _GROUPS[kind](reference)
        suffix = _SUFFIXES.get(kind)
        if suffix is None:
            raise UnknownReference(f"a {kind.name.lower()} by reference needs a profiles file (--refs FILE)")
        name = reference.removesuffix(suffix)
        if name in (reference, ""):
            raise UnknownReference(
                f"{kind.name.lower()} reference {reference[:_SHOWN]!r} is not of the form NAME{suffix}"
            )
        if kind is Kind.TOPIC:
            return TopicEntity(name)
        if kind is Kind.DATAWRITER:
            return DataWriterEntity(topic_name=name, qos=NAMED_WRITER_QOS)
        return DataReaderEntity(topic_name=name, qos=NAMED_READER_QOS)


class ReferenceChain:
    """Several sources, asked in order; the first that knows a reference wins."""

    def __init__(self, *sources: References) -> None:
        self._sources = sources

    def lookup(self, kind: Kind, reference: str) -> Entity:
        """Raises UnknownReference with what each source said."""
        reasons = []
        for source in self._sources:
            try:
                return source.lookup(kind, reference)
            except UnknownReference as error:
                reasons.append(str(error))
        raise UnknownReference("; ".join(reasons) or f"no source of references for {reference[:_SHOWN]!r}")


_SUFFIXES: Final = {Kind.TOPIC: "__t", Kind.DATAWRITER: "__dw", Kind.DATAREADER: "__dr"}
_GROUPS: Final[dict[Kind, Callable[[str], Entity]]] = {
    Kind.PUBLISHER: PublisherEntity,
    Kind.SUBSCRIBER: SubscriberEntity,
}
_SHOWN: Final = 80
"""Most characters of a foreign reference shown in a message."""
_LISTED: Final = 5


def _listed(names: Iterable[str]) -> str:
    """The first few names in words."""
    names = list(names)
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(map(repr, names[:_LISTED])) + more or "none"
