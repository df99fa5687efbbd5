"""What a user's writer or reader watches over: its deadline, and which of several writers is heard."""

from collections.abc import Callable
from typing import Final

from muros.rtps._agenda import Agenda, Timed
from muros.rtps._endpoint import NEVER
from muros.rtps._values import Guid

__all__ = ["Deadlines", "Instances", "Owners"]


class Deadlines(Timed):
    """Tells when no sample comes in time (DDS 1.4, 2.2.3.7), for each instance from its first sample on.

    limit: instances watched; the one that was silent longest makes way for a new one. on_miss: told the total so
    far and the instance. A miss is told once in each period.
    """

    __slots__ = ("_agenda", "_due", "_limit", "_on_miss", "_period", "total")

    def __init__(
        self, period: int, limit: int, agenda: Agenda, on_miss: Callable[[int, bytes], object]
    ) -> None:
        super().__init__()
        self._period = max(1, period)
        self._limit = limit
        self._agenda = agenda
        self._on_miss = on_miss
        self._due: dict[bytes, int] = {}  # in the order in which they end
        self.total = 0

    def __len__(self) -> int:
        return len(self._due)

    def touch(self, instance: bytes, now: int) -> None:
        """A sample has come."""
        due = self._due
        if due.pop(instance, None) is None and len(due) >= self._limit:
            del due[next(iter(due))]
        due[instance] = now + self._period
        if self.wake_at == NEVER:
            self._agenda.at(self, now + self._period)

    def end(self, instance: bytes) -> None:
        """The instance has ended: nothing more is due."""
        self._due.pop(instance, None)

    def stop(self) -> None:
        """Nothing is due until samples come again."""
        self._due.clear()

    def wake(self, now: int) -> int:
        due = self._due
        missed = []
        for instance, at in due.items():
            if at > now:
                break
            missed.append((instance, at))
        for instance, at in missed:
            periods = 1 + (now - at) // self._period
            del due[instance]
            due[instance] = at + periods * self._period
            self.total += periods
            self._on_miss(self.total, instance)
        return next(iter(due.values()), NEVER)


class Instances:
    """The instances of a topic with a key that are alive, at most `most` (DDS 1.4, 2.2.3.19: RESOURCE_LIMITS)."""

    __slots__ = ("_alive", "most")

    def __init__(self, most: int) -> None:
        self.most: Final = most
        self._alive: dict[bytes, None] = {}

    def __len__(self) -> int:
        return len(self._alive)

    def admits(self, instance: bytes) -> bool:
        """Whether there is room for a sample of this one, which lives from now on."""
        if instance not in self._alive:
            if len(self._alive) >= self.most:
                return False
            self._alive[instance] = None
        return True

    def end(self, instance: bytes) -> None:
        """It has ended."""
        self._alive.pop(instance, None)


class Owners:
    """Which of the writers of a reader with exclusive ownership is heard (DDS 1.4, 2.2.3.9.2).

    Of each instance that is the strongest that writes it; of those equally strong, the one with the lowest GUID.
    limit: instances remembered, the oldest make way.
    """

    __slots__ = ("_limit", "_owners", "_ranks")

    def __init__(self, limit: int) -> None:
        self._limit: Final = limit
        self._ranks: dict[Guid, tuple[int, int]] = {}
        self._owners: dict[bytes, Guid] = {}

    def __len__(self) -> int:
        return len(self._owners)

    def add(self, writer: Guid, strength: int) -> None:
        """A writer is matched, or its strength has changed."""
        self._ranks[writer] = (strength, -int.from_bytes(writer, "big"))

    def drop(self, writer: Guid) -> None:
        """It is matched no more."""
        self.release(writer)
        self._ranks.pop(writer, None)

    def release(self, writer: Guid) -> None:
        """It is not alive: others may own what it owned, until it writes again."""
        for instance in [instance for instance, owner in self._owners.items() if owner == writer]:
            del self._owners[instance]

    def free(self, instance: bytes) -> None:
        """Nobody owns this instance any more."""
        self._owners.pop(instance, None)

    def admits(self, writer: Guid, instance: bytes) -> bool:
        """Whether a sample of this writer is heard; if so, it owns the instance from now on."""
        owners = self._owners
        owner = owners.get(instance)
        if owner == writer:
            return True
        rank = self._ranks.get(writer)
        if rank is None:
            return False
        if owner is not None:
            if self._ranks[owner] > rank:
                return False
        elif len(owners) >= self._limit:
            del owners[next(iter(owners))]
        owners[instance] = writer
        return True
