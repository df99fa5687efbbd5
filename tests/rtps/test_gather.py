"""Submessages for one place, gathered."""

from muros.rtps import Locator, udp4
from muros.rtps._gather import Gather
from muros.rtps._wire import Heartbeat, heartbeat, parse_untrusted

OURS, SIBLING = b"our own  one", b"and another."
HERE, THERE = udp4("10.0.0.1", 1), udp4("10.0.0.2", 2)
A, B = b"participantA", b"participantB"


class Outbox:
    def __init__(self) -> None:
        self.sent: list[tuple[Locator, list[tuple[bytes, bytes | None, int]]]] = []
        self.sizes: list[int] = []
        self.gather = Gather(self._transmit)

    def add(
        self,
        number: int,
        destination: bytes | None,
        place: Locator,
        source: bytes = OURS,
        joint: bool = False,
    ) -> None:
        self.gather.add(source, [heartbeat(0, 0x103, 1, number, number)], destination, place, joint)

    def _transmit(self, datagram: bytes, place: Locator) -> None:
        content = parse_untrusted(datagram)
        assert content.trouble == ""
        beats = [event for event in content.submessages if isinstance(event, Heartbeat)]
        assert len(beats) == len(content.submessages)
        self.sizes.append(len(datagram))
        self.sent.append((place, [(beat.source, beat.destination, beat.last) for beat in beats]))


def test_each_submessage_keeps_its_destination_and_its_order() -> None:
    outbox = Outbox()
    for number, destination, place in (
        (1, A, HERE),
        (2, B, HERE),
        (3, B, HERE),
        (4, None, THERE),
        (5, None, HERE),
        (6, A, HERE),
    ):
        outbox.add(number, destination, place)
    assert outbox.sent == []
    outbox.gather.flush()
    assert outbox.sent == [
        (HERE, [(OURS, A, 1), (OURS, B, 2), (OURS, B, 3), (OURS, None, 5), (OURS, A, 6)]),
        (THERE, [(OURS, None, 4)]),
    ]
    outbox.gather.flush()
    assert len(outbox.sent) == 2


def test_participants_share_a_datagram_only_where_they_may() -> None:
    for joint in (True, False):
        outbox = Outbox()
        for number, source in enumerate((OURS, SIBLING, SIBLING, OURS), 1):
            outbox.add(number, A, HERE, source, joint)
        outbox.gather.flush()
        if joint:
            assert outbox.sent == [(HERE, [(OURS, A, 1), (SIBLING, A, 2), (SIBLING, A, 3), (OURS, A, 4)])]
        else:
            assert outbox.sent == [
                (HERE, [(OURS, A, 1), (OURS, A, 4)]),
                (HERE, [(SIBLING, A, 2), (SIBLING, A, 3)]),
            ]


def test_what_fills_a_datagram_leaves() -> None:
    outbox = Outbox()
    for number in range(1, 101):
        outbox.add(number, A if number % 2 else B, HERE, OURS if number % 3 else SIBLING, True)
    outbox.gather.flush()
    assert 4 <= len(outbox.sent) <= 8
    assert max(outbox.sizes) <= 1300
    assert [last for _, beats in outbox.sent for _, _, last in beats] == list(range(1, 101))


def test_what_is_larger_than_a_datagram_goes_alone() -> None:
    outbox = Outbox()
    outbox.add(1, A, HERE)
    outbox.gather.add(
        OURS, [heartbeat(0, 0x103, 1, number, number) for number in range(2, 60)], A, HERE, False
    )
    outbox.add(60, A, HERE)
    outbox.gather.flush()
    assert [len(beats) for _, beats in outbox.sent] == [1, 58, 1]
