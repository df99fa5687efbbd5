"""Submessages for one place, gathered."""

from typing import Any

from muros.rtps._gather import Gather
from muros.rtps._wire import Heartbeat, heartbeat, message, parse_untrusted

A, B = b"participantA", b"participantB"


class Outbox:
    def __init__(self) -> None:
        self.sent: list[tuple[Any, list[tuple[bytes | None, int]]]] = []
        self.gather = Gather(self)

    def __call__(self, submessages: list[bytes], destination: bytes | None, place: Any) -> None:
        assert destination is None
        events = parse_untrusted(message(b"somebodyhere", *submessages)).submessages
        beats = [event for event in events if isinstance(event, Heartbeat)]
        assert len(beats) == len(events)
        self.sent.append((place, [(beat.destination, beat.last) for beat in beats]))


def beat(number: int) -> list[bytes]:
    return [heartbeat(0, 0x103, 1, number, number)]


def test_each_submessage_keeps_its_destination_and_its_order() -> None:
    outbox = Outbox()
    gather = outbox.gather
    gather(beat(1), A, "here")
    gather(beat(2) + beat(3), B, "here")
    gather(beat(4), None, "there")
    gather(beat(5), None, "here")
    gather(beat(6), A, "here")
    assert outbox.sent == []
    gather.flush()
    assert outbox.sent == [
        ("here", [(A, 1), (B, 2), (B, 3), (None, 5), (A, 6)]),
        ("there", [(None, 4)]),
    ]
    gather.flush()
    assert len(outbox.sent) == 2


def test_what_fills_a_datagram_leaves() -> None:
    outbox = Outbox()
    for number in range(1, 101):
        outbox.gather(beat(number), A, "here")
    outbox.gather.flush()
    assert 3 <= len(outbox.sent) <= 5
    assert [last for _, beats in outbox.sent for _, last in beats] == list(range(1, 101))


def test_what_is_larger_than_a_datagram_goes_alone() -> None:
    outbox = Outbox()
    outbox.gather(beat(1), A, "here")
    outbox.gather([piece for number in range(2, 60) for piece in beat(number)], A, "here")
    outbox.gather(beat(60), A, "here")
    outbox.gather.flush()
    assert [len(beats) for _, beats in outbox.sent] == [1, 58, 1]
