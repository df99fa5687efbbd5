"""What leaves, what waits, and what is lost and told, with a socket and a loop that do what they are told."""

import errno
import socket
from collections.abc import Callable
from typing import Any

import pytest

from muros.rtps import Locator, udp4
from muros.rtps.net import Interface, NetworkCounters, NetworkSettings, _outlets
from muros.rtps.net._outlets import ROUTES, Notice, Sender

HERE = udp4("10.0.0.1", 7411)
GROUP = udp4("239.255.0.1", 7400)


class Socket:
    """Notes what is sent; raises the errors it is given first."""

    def __init__(self) -> None:
        self.sent: list[tuple[bytes, tuple[str, int]]] = []
        self.errors: list[int] = []
        self.full = False
        self.closed = False

    def sendto(self, datagram: bytes, address: tuple[str, int]) -> int:
        if self.full:
            raise BlockingIOError(errno.EAGAIN, "full")
        if self.errors:
            raise OSError(error := self.errors.pop(0), f"error {error}")
        self.sent.append((datagram, address))
        return len(datagram)

    def close(self) -> None:
        self.closed = True


class Loop:
    """Runs what waits for a socket or the time when a test says so."""

    def __init__(self) -> None:
        self.writers: dict[Any, Callable[[], object]] = {}
        self.later: list[Callable[[], object]] = []

    def is_closed(self) -> bool:
        return False

    def add_writer(self, sock: Any, call: Callable[[], object]) -> None:
        self.writers[sock] = call

    def remove_writer(self, sock: Any) -> None:
        self.writers.pop(sock, None)

    def call_later(self, delay: float, call: Callable[[], object]) -> Any:
        assert 0 < delay <= 0.01
        self.later.append(call)

        class Handle:
            def cancel(handle) -> None:  # noqa: N805
                if call in self.later:
                    self.later.remove(call)

        return Handle()


class Rig:
    """A sender on such a socket, and what it told."""

    def __init__(self, queue: int = 1000) -> None:
        loop: Any = Loop()
        sock: Any = Socket()
        self.loop = loop
        self.socket = sock
        self.counters = NetworkCounters()
        self.told: list[tuple[str, str, int]] = []
        self.sender = Sender(NetworkSettings(send_queue=queue), self.counters, self._tell)
        self.sender.open(self.loop, self.socket)
        self.notices: list[Notice] = []

    def _tell(self, notice: Notice, subject: str, n: int) -> None:
        self.notices.append(notice)
        self.told.append((notice.code, subject, n))

    def send(self, *datagrams: bytes, to: Locator = HERE) -> None:
        for datagram in datagrams:
            self.sender.transmit(datagram, to)

    @property
    def sent(self) -> list[bytes]:
        return [datagram for datagram, _ in self.socket.sent]


def test_unicast_goes_where_the_locator_says() -> None:
    rig = Rig()
    rig.send(b"one", b"two")
    assert rig.socket.sent == [(b"one", ("10.0.0.1", 7411)), (b"two", ("10.0.0.1", 7411))]
    assert (rig.counters.sent, rig.counters.sent_bytes, rig.told) == (2, 6, [])


@pytest.mark.parametrize(
    "nowhere",
    [
        Locator(1, 0, bytes(12) + b"\x0a\0\0\1"),
        Locator(1, 65536, bytes(12) + b"\x0a\0\0\1"),
        Locator(1, 2**32 - 1, bytes(12) + b"\x0a\0\0\1"),
        Locator(1, 7411, bytes(16)),
        Locator(1, 7411, bytes(12) + b"\xff\xff\xff\xff"),
        Locator(1, 7411, b""),
        Locator(2, 7411, bytes(15) + b"\1"),
        Locator(0x01000000, 7411, bytes(16)),
        Locator(-1, 0, bytes(16)),
        GROUP,
    ],
)
def test_what_leads_nowhere_harms_nobody(nowhere: Locator) -> None:
    rig = Rig()
    rig.send(b"one", to=nowhere)
    assert (rig.socket.sent, rig.counters.sent, rig.told) == ([], 0, [])


def test_a_full_socket_keeps_the_order_and_a_bound() -> None:
    rig = Rig(queue=10)
    rig.socket.full = True
    rig.send(b"aaaa", b"bbbb", b"cccc")
    assert rig.told == [("dds-send-queue-full", "10.0.0.1:7411", 1)]
    assert rig.counters.lost == {"dds-send-queue-full": 1}
    rig.loop.writers[rig.socket]()  # still full
    rig.socket.full = False
    rig.send(b"dd")
    assert rig.sent == []  # not before those that wait
    rig.loop.writers[rig.socket]()
    assert rig.sent == [b"aaaa", b"bbbb", b"dd"]
    assert rig.loop.writers == {}
    rig.send(b"ee")
    assert rig.sent[-1] == b"ee"
    assert rig.counters.sent == 4


def test_one_larger_than_the_queue_may_wait_alone() -> None:
    rig = Rig(queue=10)
    rig.socket.full = True
    rig.send(bytes(100), b"b")
    rig.socket.full = False
    rig.loop.writers[rig.socket]()
    assert rig.sent == [bytes(100)]


def test_a_full_device_is_tried_again_by_the_clock() -> None:
    rig = Rig()
    rig.socket.errors = [errno.ENOBUFS, errno.ENOBUFS]
    rig.send(b"one", b"two")
    assert (rig.sent, len(rig.loop.later)) == ([], 1)
    rig.loop.later.pop()()
    assert (rig.sent, len(rig.loop.later)) == ([], 1)
    rig.loop.later.pop()()
    assert (rig.sent, rig.loop.later, rig.told) == ([b"one", b"two"], [], [])


@pytest.mark.parametrize(
    ("number", "code"),
    [
        (errno.ENETUNREACH, "dds-unreachable"),
        (errno.EHOSTUNREACH, "dds-unreachable"),
        (errno.ENETDOWN, "dds-unreachable"),
        (errno.EPERM, "dds-send-forbidden"),
        (errno.EMSGSIZE, "dds-datagram-too-large"),
        (errno.EINVAL, "dds-bound-to-host"),
        (errno.EIO, "dds-send-refused"),
    ],
)
def test_errors_are_told_not_raised(number: int, code: str) -> None:
    rig = Rig()
    rig.socket.errors = [number]
    rig.send(b"one", b"two")
    assert rig.told == [(code, "10.0.0.1:7411", 1)]
    assert rig.counters.lost == {code: 1}
    assert rig.sent == [b"two"]
    assert rig.notices[0].why
    assert rig.notices[0].remedy.endswith(".")


def test_an_error_while_others_wait_loses_only_its_own() -> None:
    rig = Rig()
    rig.socket.full = True
    rig.send(b"one", b"two", b"three")
    rig.socket.full = False
    rig.socket.errors = [errno.ENETUNREACH]
    rig.loop.writers[rig.socket]()
    assert rig.sent == [b"two", b"three"]
    assert rig.told == [("dds-unreachable", "10.0.0.1:7411", 1)]


def test_closing_sends_what_it_can_and_counts_the_rest() -> None:
    rig = Rig()
    rig.socket.full = True
    rig.send(b"one", b"two")
    rig.sender.close()
    assert rig.counters.lost == {"dds-send-queue-full": 2}
    assert rig.loop.writers == {}
    assert not rig.socket.closed  # it is the owner's
    rig.send(b"late")
    assert rig.sent == []

    rig = Rig()
    rig.socket.full = True
    rig.send(b"one", b"two")
    rig.socket.full = False
    rig.sender.close()
    assert rig.sent == [b"one", b"two"]


def test_multicast_leaves_through_every_interface(monkeypatch: pytest.MonkeyPatch) -> None:
    made: dict[str, Any] = {}

    def make(interface: Interface, hops: int) -> Socket:
        if interface.name == "gone":
            raise OSError(errno.ENODEV, "no such device")
        assert interface.name not in made
        made[interface.name] = Socket()
        return made[interface.name]  # type: ignore[no-any-return]

    monkeypatch.setattr(_outlets, "multicast_sender", make)
    eth, wlan, gone, tun = (
        Interface(name, number, (f"10.0.0.{number}",), loopback=False, multicast=name != "tun")
        for number, name in enumerate(("eth", "wlan", "gone", "tun"), 1)
    )
    rig = Rig()
    rig.sender.set_interfaces(rig.loop, [eth, wlan, gone, tun])
    rig.send(b"one", to=GROUP)
    assert made.keys() == {"eth", "wlan"}
    assert made["eth"].sent == made["wlan"].sent == [(b"one", ("239.255.0.1", 7400))]
    assert rig.counters.sent == 2
    assert rig.sent == []

    rig.sender.set_interfaces(rig.loop, [wlan])
    rig.send(b"two", to=GROUP)
    assert made["eth"].closed
    assert len(made["wlan"].sent) == 2

    rig.sender.close()
    assert made["wlan"].closed


def test_many_locators_do_not_grow_the_memory() -> None:
    rig = Rig()
    for port in range(1, ROUTES + 100):
        rig.send(b"x", to=udp4("10.0.0.2", port))
    assert len(rig.sender._routes) <= ROUTES
    assert len(rig.sent) == ROUTES + 99


def test_a_real_socket_that_is_too_small_for_the_datagram() -> None:
    rig = Rig()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        rig.sender.open(rig.loop, sock)
        rig.send(bytes(70000), to=udp4("127.0.0.1", 9))
    assert rig.told == [("dds-datagram-too-large", "127.0.0.1:9", 1)]
    assert "70000 bytes" in rig.notices[0].why
