"""NodeHandle on every runtime, with a host in the same program. See also ``tests/rosserial_client``."""

from struct import pack_into

from muros.compat import const, ticks_add, ticks_ms
from muros.rosserial.device import Device
from muros.rosserial.fields import (
    Message,
    exactly,
    need,
    read_count,
    read_text,
    text_size,
    write_count,
    write_text,
)
from muros.rosserial.messages import (
    MessageError,
    TopicInfo,
    Values,
    parameter_request_untrusted,
    topic_info_untrusted,
    write_time,
)
from muros.rosserial.node_handle import WARN, NodeHandle, parse
from muros.rosserial.packets import Decoder, frame
from tests.board.harness import allocates, raises

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.xrce._types import Buffer


class Words(Message):
    """A string, then any number of strings."""

    TYPE = "test_msgs/Words"
    MD5 = "0123456789abcdef0123456789abcdef"

    def __init__(self, first: "str | bytes" = "", rest: "list[str | bytes] | None" = None) -> None:
        self.first = first
        self.rest = rest or []

    def size(self) -> int:
        n = text_size(self.first) + 4
        for text in self.rest:
            n += text_size(text)
        return n

    def write(self, buf: bytearray, off: int) -> int:
        off = write_text(buf, off, self.first)
        off = write_count(buf, off, len(self.rest))
        for text in self.rest:
            off = write_text(buf, off, text)
        return off

    def read(self, buf: "Buffer", off: int, end: int) -> int:
        self.first, off = read_text(buf, off, end)
        n, off = read_count(buf, off, end, 4)
        self.rest = []
        for _ in range(n):
            text, off = read_text(buf, off, end)
            self.rest.append(text)
        return off


class Ask:
    """A service of words."""

    TYPE = "test_msgs/Ask"
    Request = Words
    Response = Words


class Host:
    """A host on the other end of a line in memory; as a port it is the board's."""

    def __init__(self) -> None:
        self.there = True
        self.opened = 0
        self.infos: "dict[str, list[tuple[int, TopicInfo]]]" = {}
        self.got: "list[tuple[int, bytes]]" = []
        self.parameters: "dict[str, Values]" = {}
        self.answer: "Callable[[bytes], bytes] | None" = None
        self._line: "list[bytes]" = []
        self._decoder = Decoder(1024, self._take)
        self.node = NodeHandle(self, 256, 256)

    def put(self, topic_id: int, payload: bytes = b"") -> None:
        """Sends a frame to the board."""
        self._line.append(frame(topic_id, payload))

    def words(self, name: str, half: int, message: Words) -> None:
        """Sends words to an endpoint of the board."""
        buf = bytearray(message.size())
        message.write(buf, 0)
        for endpoint, info in self.infos[name]:
            if endpoint == half:
                self.put(info.topic_id, bytes(buf))

    def connect(self) -> None:
        """Asks the board for its topics."""
        self.put(0)
        assert self.node.spin_once()

    # ---- as a port ----

    def open(self) -> bool:
        if not self.there:
            raise OSError(19)
        self.opened += 1
        return True

    def close(self) -> None:
        self._line.clear()

    def wait(self, timeout: int) -> None:
        pass

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        self._decoder.feed(bytes(buf[off : off + n]), n, 0)

    def receive(self, feed: "Callable[[Buffer, int], object]") -> None:
        if not self.there:
            raise OSError(19)
        while self._line:
            data = self._line.pop(0)
            feed(data, len(data))

    # ---- as a host ----

    def _take(self, topic_id: int, buf: "Buffer", off: int, n: int) -> None:
        payload = bytes(buf[off : off + n])
        if topic_id == 10:
            stamp = bytearray(8)
            write_time(stamp, 0, 1000, 5)
            self.put(10, bytes(stamp))
        elif topic_id < 6:
            info = topic_info_untrusted(payload, 0, n)
            self.infos.setdefault(info.topic_name, []).append((topic_id, info))
        elif topic_id == 6:
            values = self.parameters.get(parameter_request_untrusted(payload, 0, n))
            if values is not None:
                out = bytearray(values.size())
                values.write(out, 0)
                self.put(6, bytes(out))
        else:
            self.got.append((topic_id, payload))
            if self.answer is not None:
                for infos in self.infos.values():
                    if infos[0][0] == 4 and infos[0][1].topic_id == topic_id:
                        self.put(infos[1][1].topic_id, self.answer(payload))


def test_topics_both_ways() -> None:
    host = Host()
    heard: "list[Words]" = []
    node = host.node
    talks = node.advertise("talks", Words)
    node.subscribe("hears", Words, heard.append)
    assert talks.publish(Words("early")) == 0
    assert not node.spin_once()
    host.connect()
    assert [infos[0][0] for infos in host.infos.values()] in ([0, 1], [1, 0])
    info = host.infos["hears"][0][1]
    assert (info.topic_id, info.message_type, info.md5sum, info.buffer_size) == (
        100,
        Words.TYPE,
        Words.MD5,
        256,
    )
    assert talks.publish(Words("hello", ["a", "bc"])) == 8 + 9 + 4 + 11
    read = parse(Words, host.got[0][1], 0, len(host.got[0][1]))
    assert (read.first, read.rest) == ("hello", ["a", "bc"])
    host.words("hears", 1, Words("back", ["x"]))
    node.spin_once()
    assert (heard[0].first, heard[0].rest) == ("back", ["x"])
    assert talks.publish(Words("x" * 300)) == -1
    assert node.device.too_large == 1


def test_messages_that_are_none() -> None:
    host = Host()
    heard: "list[Words]" = []
    host.node.subscribe("hears", Words, heard.append)
    host.connect()
    for payload in (b"", b"\x05\0\0\0ab", b"\0\0\0\0\xff\xff\xff\xff", b"\0\0\0\0\0\0\0\0\0"):
        host.put(100, payload)
    host.node.spin_once()
    assert heard == []
    assert host.node.device.malformed == 4
    host.put(100, b"\x01\0\0\0\xff\0\0\0\0")
    host.node.spin_once()
    assert heard[0].first == b"\xff"  # no UTF-8: as it came


def test_service_of_the_board() -> None:
    host = Host()
    host.node.advertise_service("ask", Ask, lambda request: Words("you said", [request.first]))
    host.connect()
    assert [endpoint for endpoint, _ in host.infos["ask"]] == [2, 3]
    host.words("ask", 3, Words("hi"))
    host.node.spin_once()
    topic_id, payload = host.got[0]
    assert topic_id == host.infos["ask"][0][1].topic_id
    assert parse(Words, payload, 0, len(payload)).rest == ["hi"]


def test_service_of_the_host() -> None:
    host = Host()
    client = host.node.service_client("ask", Ask)
    assert client.call(Words("nobody there")) is None
    host.connect()
    host.answer = lambda payload: payload
    assert client.call(Words("echo")).first == "echo"
    host.answer = None
    assert client.call(Words("lost"), 30) is None
    host.words("ask", 5, Words("late"))
    host.node.spin_once()
    host.answer = lambda payload: payload
    assert client.call(Words("next")).first == "next"


def test_parameters() -> None:
    host = Host()
    host.parameters = {
        "/n": Values([3], [3.0], [b"3"]),
        "/none": Values(),
        "~gains": Values([], [0.5, 1.5], []),
    }
    host.there = False
    assert host.node.get_param("/n", int, 30) is None  # not even a line
    host.there = True
    host.node._retry = ticks_ms()
    host.connect()
    assert host.got == []
    assert host.node.get_param("/n", int) == [3]
    assert host.node.get_param("/n") == [3.0]
    assert host.node.get_param("/n", str) == ["3"]
    assert host.node.get_param("~gains", float) == [0.5, 1.5]
    assert host.node.get_param("~gains", int) is None
    assert host.node.get_param("/none") is None
    assert host.got == []
    assert host.node.get_param("/unknown", float, 30) is None
    assert b"timeout expired" in host.got[-1][1]


def test_logs_and_time() -> None:
    host = Host()
    host.connect()
    host.node.spin_once()
    seconds, nanoseconds = host.node.now()
    assert 1000 <= seconds < 1002
    assert 0 <= nanoseconds < 1000000000
    host.node.loginfo("all well")
    host.node.log(WARN, "less well")
    assert [payload[0] for topic_id, payload in host.got if topic_id == 7] == [1, 2]
    for say in (host.node.logdebug, host.node.logwarn, host.node.logerror, host.node.logfatal):
        say("x")
    assert [payload[0] for topic_id, payload in host.got if topic_id == 7] == [1, 2, 0, 2, 3, 4]


def test_a_line_that_comes_and_goes() -> None:
    host = Host()
    host.there = False
    assert not host.node.spin_once()
    host.there = True
    assert not host.node.spin_once()  # not so soon
    assert host.opened == 0
    host.node._retry = ticks_ms()
    host.connect()
    host.there = False
    assert not host.node.spin_once()
    host.there = True
    host.node._retry = ticks_add(ticks_ms(), -1)
    host.put(0)
    assert host.node.spin_once()
    assert host.opened == 2
    host.node.close()
    assert not host.node.connected


def test_callbacks_do_not_spin() -> None:
    host = Host()
    host.node.subscribe("hears", Words, lambda message: host.node.spin_once())
    host.connect()
    host.words("hears", 1, Words("x"))
    with raises(RuntimeError):
        host.node.spin_once()
    assert host.node.spin_once()


def test_fields() -> None:
    need(3, 5, 8)
    with raises(MessageError):
        need(3, 6, 8)
    with raises(MessageError):
        exactly([1, 2], 3)
    assert exactly([1, 2], 2) == [1, 2]
    with raises(MessageError):
        read_count(b"\xff\xff\xff\x7f", 0, 4, 1)


class Number(Message):
    """An int32, as the generator writes it."""

    TYPE = "std_msgs/Int32"
    MD5 = "da5909fbe378aeaf85e547e830cc1bb7"

    def __init__(self, data: int = 0) -> None:
        self.data = data

    def size(self) -> int:
        return 4

    def write(self, buf: bytearray, off: int) -> int:
        pack_into("<i", buf, off, self.data)
        return off + 4


def test_publishing_numbers_allocates_nothing() -> None:
    sent = [0]

    def send(buf: "Buffer", off: int, n: int) -> None:
        sent[0] = n

    device = Device(send)
    number = device.publisher("number", Number.TYPE, Number.MD5)
    device.connected = True
    message = Number(-5)
    assert allocates(lambda: device.publish(number, message)) == 0
    assert sent[0] == 12
