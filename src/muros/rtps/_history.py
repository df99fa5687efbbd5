"""What a writer keeps of the samples it has written (the HistoryCache of DDSI-RTPS 2.3, 8.2.2).

Sequence numbers only grow, so a dictionary holds the samples in their order, and the lowest one held is a number
that only moves up: finding, adding and dropping cost the same however much is kept. Of each instance (one for
all samples of a topic without a key) the last `depth` samples are kept, or all of them. Their numbers stand in plain
lists: most are short, and there may be thousands.
"""

from collections import Counter
from collections.abc import Iterator

from muros.rtps._endpoint import NEVER
from muros.rtps._values import EntityId, GuidPrefix

__all__ = ["History", "Sample"]


class Sample:
    """One written sample. `pieces` together are its payload, which begins with the four bytes of its encapsulation."""

    __slots__ = (
        "expires",
        "inline_qos",
        "instance",
        "key",
        "last",
        "pieces",
        "sequence",
        "size",
        "stamp",
        "to",
    )

    def __init__(
        self,
        sequence: int,
        pieces: tuple[bytes, ...],
        stamp: bytes = b"",
        inline_qos: bytes = b"",
        key: bool = False,
        instance: bytes = b"",
        last: bool = False,
        expires: int = NEVER,
    ) -> None:
        self.sequence = sequence
        self.pieces = pieces
        self.size = sum(map(len, pieces)) if len(pieces) > 1 else len(pieces[0])
        """Bytes of the payload."""
        self.stamp = stamp
        """The INFO_TS submessage that says when it was written."""
        self.inline_qos = inline_qos
        self.key = key
        """The payload is only the key (an instance is disposed or unregistered)."""
        self.instance = instance
        """Names the instance among those of its writer."""
        self.last = last
        """Nothing follows in this instance: it is forgotten once everybody knows."""
        self.expires = expires
        """When the sample's lifespan ends, on the clock of `now`."""
        self.to: tuple[GuidPrefix, EntityId] | None = None
        """The only reader it is for; None = all."""

    @property
    def payload(self) -> bytes:
        """In one piece."""
        if len(self.pieces) > 1:
            self.pieces = (b"".join(self.pieces),)
        return self.pieces[0]

    def is_for(self, reader: tuple[GuidPrefix, EntityId]) -> bool:
        """Whether the reader shall get it."""
        return self.to is None or self.to == reader


class History:
    """Samples by sequence number. `depth`: samples kept of each instance, None for all."""

    __slots__ = ("_counts", "_ending", "_first", "_instances", "_samples", "depth")

    def __init__(self, depth: int | None) -> None:
        if depth is not None and depth < 1:
            raise ValueError(f"history depth is {depth}; it must be at least 1, or None to keep all")
        self.depth = depth
        self._samples: dict[int, Sample] = {}
        self._instances: dict[bytes, list[int]] = {}  # with a depth, else ...
        self._counts: Counter[bytes] = Counter()  # ... of instances that have a name
        self._ending: list[Sample] = []
        self._first = 1

    def __len__(self) -> int:
        return len(self._samples)

    def __iter__(self) -> Iterator[Sample]:
        """The samples held, oldest first."""
        return iter(self._samples.values())

    @property
    def ends(self) -> bool:
        """Whether an instance ends in what is held."""
        return bool(self._ending)

    def get(self, sequence: int) -> Sample | None:
        """The sample with this number, None if it is not held (any more)."""
        return self._samples.get(sequence)

    def first(self) -> int | None:
        """The lowest sequence number held."""
        samples = self._samples
        if not samples:
            return None
        first = self._first
        while first not in samples:
            first += 1
        self._first = first
        return first

    def add(self, sample: Sample) -> None:
        """Keep `sample`, whose sequence number must be higher than all before; may push its instance's oldest out."""
        if not self._samples:
            self._first = sample.sequence
        self._samples[sample.sequence] = sample
        if self.depth is not None:
            numbers = self._instances.get(sample.instance)
            if numbers is None:
                numbers = self._instances[sample.instance] = []
            numbers.append(sample.sequence)
            if len(numbers) > self.depth:
                self._samples.pop(numbers.pop(0), None)
        elif sample.instance:
            self._counts[sample.instance] += 1
        if sample.last:
            self._ending.append(sample)

    def count(self, instance: bytes) -> int:
        """Samples held of an instance."""
        if self.depth is not None:
            return len(self._instances.get(instance, ()))
        if not instance:
            return len(self._samples) - self._counts.total()
        return self._counts[instance]

    def drop_one(self, instance: bytes, to: int) -> None:
        """Forget the oldest sample of an instance, if it is one of those up to the number `to`."""
        oldest = next((sample for sample in self._samples.values() if sample.instance == instance), None)
        if oldest is not None and oldest.sequence <= to:
            self._remove(oldest)

    def drop_to(self, sequence: int) -> None:
        """Forget all samples up to and including `sequence`."""
        while (first := self.first()) is not None and first <= sequence:
            self._remove(self._samples[first])

    def end_to(self, sequence: int) -> None:
        """Everybody knows the samples up to `sequence`: forget the instances that end there."""
        ending = self._ending
        while ending and ending[0].sequence <= sequence:
            end = ending.pop(0)
            if end.sequence in self._samples:
                self._end(end)

    def expire(self, now: int) -> int:
        """Forget samples whose lifespan is over; returns when to ask again (`NEVER`: nothing expires).

        All lifespans of one writer are equal, so the oldest sample is the first to go.
        """
        while (first := self.first()) is not None:
            sample = self._samples[first]
            if sample.expires > now:
                return sample.expires
            self._remove(sample)
        return NEVER

    def _remove(self, sample: Sample) -> None:
        del self._samples[sample.sequence]
        numbers = self._instances.get(sample.instance)
        if numbers is not None:
            numbers.remove(sample.sequence)  # the oldest of its instance: found at once
            if not numbers:
                del self._instances[sample.instance]
        elif sample.instance:
            self._counts[sample.instance] -= 1
            if not self._counts[sample.instance]:
                del self._counts[sample.instance]

    def _end(self, end: Sample) -> None:
        """Forget what is held of an instance up to its end."""
        if self.depth is None:
            held = [
                s for s in self._samples.values() if s.instance == end.instance and s.sequence <= end.sequence
            ]
        else:
            numbers = self._instances[end.instance]
            held = [self._samples[number] for number in numbers if number <= end.sequence]
        for sample in held:
            self._remove(sample)
