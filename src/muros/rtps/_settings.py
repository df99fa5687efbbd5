"""The bounds and times of writers and readers. All times are in ns, all sizes in bytes."""

from dataclasses import dataclass
from typing import Final

from muros.rtps._endpoint import MILLISECOND, SECOND

__all__ = ["READER_DEFAULTS", "WRITER_DEFAULTS", "ReaderSettings", "WriterSettings"]


@dataclass(frozen=True, slots=True)
class WriterSettings:
    """Bounds and times of writers; one value serves many of them. Times are in ns, sizes in bytes."""

    limit: int = 5000
    """Samples held while they wait for acknowledgement by a writer that keeps all (and for late readers)."""
    limit_of_one: int = 0
    """Of them, samples of one instance of a topic with a key; 0 = as many as of all."""
    strict: bool = False
    """Whether `limit` also holds for a writer that keeps the last samples of each instance: it then refuses those of
    an instance for which no room is left."""
    fragment_size: int = 65000
    """Larger samples are sent in fragments of this size; small samples are sent again together up to it.

    One UDP datagram of it with its headers has to pass: 65000 on one machine and where IP fragments well,
    1300 on networks that lose fragments. At most 65000.
    """
    heartbeat_period: int = 20 * MILLISECOND
    """A sample not acknowledged for this long is asked after; the pause doubles while there is no progress."""
    heartbeat_slowest: int = SECOND
    """The longest pause."""
    hold_off: int = 10 * MILLISECOND
    """What was sent again to a reader is not sent once more to it within this time."""
    window: int = 1 << 20
    """Bytes that may be on their way to reliable readers, at most; fewer while any of them get lost."""
    together: int = 0
    """Readers are served together: what several at one place miss goes to all of them at once, by a `tick` that is
    due at once, or for patient ones (`WriterCore.match`) at the next multiple of this time. 0 = each by itself. Only
    for writers whose readers all want what is kept, such as those of discovery."""
    burst: int = 256 * 1024
    """Bytes of repairs and of fragments that are not within the window, sent in one go."""
    pace: int = MILLISECOND
    """Time in which `burst` is allowed again."""
    patience: int = 10 * SECOND
    """A reader that acknowledges nothing for this long, and makes the writer refuse samples, is set aside."""

    def __post_init__(self) -> None:
        for name in (
            "limit",
            "fragment_size",
            "heartbeat_period",
            "heartbeat_slowest",
            "window",
            "burst",
            "pace",
            "patience",
        ):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least 1")
        for name in ("limit_of_one", "hold_off", "together"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must not be negative")
        if self.fragment_size > 65000:
            raise ValueError(f"fragment_size is {self.fragment_size}; it must be at most 65000")


WRITER_DEFAULTS: Final = WriterSettings()


@dataclass(frozen=True, slots=True)
class ReaderSettings:
    """Bounds and times of readers; one value serves many of them. Times are in ns, sizes in bytes."""

    window: int = 1024
    """Samples of one writer may come early by this many numbers."""
    limit: int = 0
    """Samples of all writers that wait, because they came early or were refused; 0 = as memory and window allow. What
    comes beyond it is rejected, and asked for again."""
    limit_of_one: int = 0
    """Of them, samples of one instance, 0 = as many as of all."""
    memory: int = 64 << 20
    """Bytes held for one writer: samples that came early, and those being put together. No larger one can come."""
    response_delay: int = 0
    """A heartbeat is answered after this time, together with those that follow it."""
    together: int = 0
    """Heartbeats of patient writers (`ReaderCore.match_writer`) are answered at the next multiple of this time, as
    all readers do, so that the answers may share datagrams; 0 = as others."""
    hold_off: int = 10 * MILLISECOND
    """What is missing is asked for when it has been overtaken by this time, and again after this time, or when some
    of it has come; the pause doubles while nothing comes."""
    slowest: int = SECOND
    """The longest such pause."""
    asks: int = 16
    """How often in a row it is asked for without a heartbeat and without success."""
    hello_period: int = 100 * MILLISECOND
    """A writer of which nothing is known is asked again after this time; the pause doubles."""
    hellos: int = 8
    """How often it is asked."""
    assembly_time: int = 3 * SECOND
    """Fragments of a best-effort sample are dropped when the rest has not come after this time."""

    def __post_init__(self) -> None:
        for name in ("window", "memory", "hold_off", "slowest", "hello_period", "hellos", "assembly_time"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least 1")
        for name in ("response_delay", "together", "asks", "limit", "limit_of_one"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must not be negative")


READER_DEFAULTS: Final = ReaderSettings()
