"""What readers have missed, sent to them again (DDSI-RTPS 2.3, 8.4.9.2 and 8.3.7.10).

Each reader gets what it asked for, and it alone; a GAP for what is gone or was never meant for it; and a HEARTBEAT
behind, so that it asks for more at once. All this leaves within an allowance.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Final

from muros.rtps._constants import ENTITYID_UNKNOWN
from muros.rtps._endpoint import Place, Send
from muros.rtps._fragments import fragments_of
from muros.rtps._history import History, Sample
from muros.rtps._reader_proxy import ReaderProxy
from muros.rtps._sending import Allowance, Packet, data_of, fragment_of, gaps
from muros.rtps._values import EntityId
from muros.rtps._wire import AckNack, NackFrag, gap

__all__ = ["Repairs"]

WANTED_MOST: Final = 512
"""Samples waiting to be sent again to one reader; what it asks for beyond, it will ask for again."""

_GAP: Final = 0
"""Stands for a GAP among the numbers of samples sent again."""


class Repairs:
    """The repairs of one writer; `waiting` are the readers that want something again.

    size: bytes of a fragment and of a datagram. hold_off: what was sent again is not sent once more within it (ns).
    together: what several readers at one place miss is sent to all there at once, whether they miss it or not.
    """

    __slots__ = ("_allowance", "_entity", "_history", "_hold_off", "_send", "_size", "_together", "waiting")

    def __init__(
        self,
        entity: EntityId,
        send: Send,
        history: History,
        allowance: Allowance,
        size: int,
        hold_off: int,
        *,
        together: bool = False,
    ) -> None:
        self._entity = entity
        self._send = send
        self._history = history
        self._allowance = allowance
        self._size = size
        self._hold_off = hold_off
        self._together = together
        self.waiting: dict[ReaderProxy, None] = {}

    def want(self, proxy: ReaderProxy, event: AckNack, lowest: int, sent: int, now: int) -> tuple[bool, bool]:
        """A reader misses samples: whether it will get an answer, and whether by samples.

        lowest: the first sample that can be had. sent: the last one that has left.
        """
        if now - proxy.repaired_at >= self._hold_off:
            proxy.repaired.clear()
            proxy.repaired_at = now
        lowest = max(proxy.start, lowest)
        repaired, wanted = proxy.repaired, proxy.wanted
        before = len(wanted)
        gap_sent = False
        for number in event.missing:
            if number > sent:
                break
            if number < lowest:
                if _GAP not in repaired:
                    repaired.add(_GAP)
                    gap_sent = True
                    skip = gap(proxy.entity, self._entity, max(event.base, 1), lowest)
                    for place in proxy.places:
                        self._send([skip], proxy.prefix, place)
            elif number not in repaired and number not in wanted and len(wanted) < WANTED_MOST:
                repaired.add(number)
                wanted[number] = None
        missed = len(wanted) > before
        if missed or gap_sent:
            self.waiting[proxy] = None
        return missed or gap_sent, missed

    def want_fragments(self, proxy: ReaderProxy, event: NackFrag) -> bool:
        """A reader misses fragments of a sample; whether any will be sent again."""
        number = event.sequence
        if number in proxy.wanted or len(proxy.wanted) >= WANTED_MOST:
            return False
        sample = self._history.get(number)
        if sample is None or not sample.is_for(proxy.key):
            proxy.wanted[number] = None  # becomes a GAP
            self.waiting[proxy] = None
            return False
        total = fragments_of(sample.size, self._size)
        fragments = [fragment for fragment in event.missing if 1 <= fragment <= total]
        if fragments:
            proxy.wanted[number] = fragments
            self.waiting[proxy] = None
        return bool(fragments)

    def offer(self, proxy: ReaderProxy, lowest: int, sent: int, now: int) -> None:
        """A reader has come that has not asked yet: it wants what is kept."""
        if proxy.acked < sent:
            proxy.repaired_at = now
            for number in range(max(proxy.start, lowest), min(sent, proxy.start + WANTED_MOST) + 1):
                if self._history.get(number) is not None:
                    proxy.wanted[number] = None
                    proxy.repaired.add(number)
        self.waiting[proxy] = None

    def drop(self, proxy: ReaderProxy) -> None:
        """The reader has everything, or is gone."""
        self.waiting.pop(proxy, None)

    def run(self, now: int, heartbeat: Callable[[ReaderProxy], bytes]) -> list[ReaderProxy]:
        """Send again what the allowance has room for; returns the patient readers that a heartbeat is due to."""
        served = []
        if self._together and len(self.waiting) > 1:
            self._send_to_all(now)
        for proxy in tuple(self.waiting):
            packet = Packet(self._send, proxy.prefix, proxy.places, self._size)
            gone: list[int] = []
            while proxy.wanted and self._allowance.allows(now):
                number = next(iter(proxy.wanted))
                fragments = proxy.wanted.pop(number)
                sample = self._history.get(number)
                if sample is None or not sample.is_for(proxy.key):
                    gone.append(number)
                elif sample.size + len(sample.inline_qos) <= self._size:
                    packet.add(sample.stamp, *data_of(sample, proxy.entity, self._entity))
                    self._allowance.spend(sample.size * len(proxy.places))
                else:
                    self._send_fragments(packet, proxy, sample, fragments, now)
            for submessage in gaps(proxy.entity, self._entity, sorted(gone)):
                packet.add(submessage)
            if not proxy.wanted:
                del self.waiting[proxy]
                if proxy.patient:
                    served.append(proxy)
                else:
                    packet.add(heartbeat(proxy))
            packet.flush()
        return served

    def _send_to_all(self, now: int) -> None:
        """Send what several readers at one place miss to everybody there."""
        by_place: dict[tuple[Place, ...], list[ReaderProxy]] = {}
        for proxy in self.waiting:
            by_place.setdefault(proxy.places, []).append(proxy)
        for places, proxies in by_place.items():
            missed = Counter(number for proxy in proxies for number in proxy.wanted)
            packet = Packet(self._send, None, places, self._size)
            for number in sorted(number for number, times in missed.items() if times > 1):
                sample = self._history.get(number)
                if sample is None or sample.to is not None:
                    continue
                if sample.size + len(sample.inline_qos) > self._size:
                    continue
                if not self._allowance.allows(now):
                    break
                packet.add(sample.stamp, *data_of(sample, ENTITYID_UNKNOWN, self._entity))
                self._allowance.spend(sample.size * len(places))
                for proxy in proxies:
                    proxy.wanted.pop(number, None)
            packet.flush()

    def _send_fragments(
        self, packet: Packet, proxy: ReaderProxy, sample: Sample, fragments: Iterable[int] | None, now: int
    ) -> None:
        """Send fragments again, None = all; those beyond the allowance go back to what is wanted."""
        if fragments is None:
            fragments = range(1, fragments_of(sample.size, self._size) + 1)
        numbers = iter(fragments)
        for number in numbers:
            if not self._allowance.allows(now):
                proxy.wanted = {sample.sequence: [number, *numbers], **proxy.wanted}
                return
            packet.add(sample.stamp, fragment_of(sample, number, self._size, proxy.entity, self._entity))
            self._allowance.spend(self._size * len(proxy.places))
