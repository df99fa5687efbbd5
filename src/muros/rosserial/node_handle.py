"""What a board's program uses: NodeHandle, as in ros_lib, over any port.

    from muros.rosserial.node_handle import NodeHandle
    from muros.rosserial.tcp import Tcp

    node = NodeHandle(Tcp("192.168.1.10"))
    chatter = node.advertise("chatter", String)
    node.subscribe("led_out", Byte, lambda message: set_leds(message.data))
    while True:
        node.spin_once(10)
        chatter.publish(String("hello"))

Types are classes with ``TYPE``, ``MD5``, ``size()``, ``write(buf, off)`` and ``read(buf, off, end)``. On hosts
``muros.rosserial.types.message("std_msgs/String")`` makes them; ``muros interface generate --ros1`` writes them for
boards.
"""

from muros.compat import const, sleep_ms, ticks_add, ticks_diff, ticks_ms
from muros.rosserial.device import Device
from muros.rosserial.messages import MessageError

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any, Protocol

    from muros.xrce._types import Buffer

    class Port(Protocol):
        """A line: ``open`` may be called until it is True, and again after an OSError of ``receive``."""

        def open(self) -> bool: ...

        def close(self) -> None: ...

        def wait(self, timeout: int) -> None: ...

        def send(self, buf: Buffer, off: int, n: int) -> object: ...

        def receive(self, feed: "Callable[[Buffer, int], object]") -> object: ...


_BUFFER = const(512)
_SUBSCRIBERS = const(25)
_VERSION_HYDRO = const(0xFE)
_RETRY = const(1000)  # ms between attempts to open the port
_PATIENCE = const(1000)  # ms that answers are waited for
_STEP = const(20)  # ms that a wait for an answer sleeps at most

_ID_SERVICE_SERVER = const(2)
_ID_SERVICE_CLIENT = const(4)

DEBUG, INFO, WARN, ERROR, FATAL = range(5)


class NodeHandle:
    """A node on the board. ``port`` is a line to a host (``serial.Serial``, ``tcp.Tcp``, ``uart.Uart``) that may come
    and go; sizes and ``version`` as in ``Device``, which is ``device``.

    Everything happens inside ``spin_once``, which therefore has to be called often. Callbacks may publish, not spin.
    """

    def __init__(
        self,
        port: "Port",
        input_size: int = _BUFFER,
        output_size: int = _BUFFER,
        max_subscribers: int = _SUBSCRIBERS,
        version: int = _VERSION_HYDRO,
    ) -> None:
        self.device = Device(self._send, input_size, output_size, max_subscribers, version)
        self._port = port
        self._open = False
        self._spinning = False
        self._retry = ticks_ms()

    @property
    def connected(self) -> bool:
        """Whether a host has asked for the topics and still answers."""
        return self.device.connected

    def advertise(self, topic: str, kind: "Any") -> "Publisher":
        """A publisher of messages of a class."""
        return Publisher(self.device, self.device.publisher(topic, kind.TYPE, kind.MD5))

    def subscribe(self, topic: str, kind: "Any", callback: "Callable[[Any], object]") -> None:
        """Calls ``callback(message)`` for each message of a class."""
        self.device.subscriber(
            topic, kind.TYPE, kind.MD5, lambda buf, off, n: callback(parse(kind, buf, off, n))
        )

    def advertise_service(self, name: str, kind: "Any", answer: "Callable[[Any], Any]") -> None:
        """Offers a service: ``answer(request)`` returns the response."""
        device = self.device
        sends = device.publisher(name, kind.TYPE, kind.Response.MD5, _ID_SERVICE_SERVER)

        def on_request(buf: bytearray, off: int, n: int) -> None:
            device.publish(sends, answer(parse(kind.Request, buf, off, n)))

        device.subscriber(name, kind.TYPE, kind.Request.MD5, on_request, _ID_SERVICE_SERVER + 1)

    def service_client(self, name: str, kind: "Any") -> "ServiceClient":
        """A client of the host's service."""
        return ServiceClient(self, name, kind)

    def get_param(self, name: str, kind: "Any" = float, timeout: int = _PATIENCE) -> "list[Any] | None":
        """The values of a parameter of the host: a list of ``int`` (also for bool), ``float`` or ``str``.

        None if the host does not answer within ``timeout`` ms, or has no such value.
        """
        self.device.request_parameter(name.encode())
        self._spin_until(lambda: self.device.values is not None, timeout)
        values = self.device.values
        if values is None:
            self.log(WARN, "Failed to get param: timeout expired")
            return None
        if kind is str:
            return [text.decode() for text in values.strings] or None
        return (values.floats if kind is float else values.ints) or None

    def now(self) -> "tuple[int, int]":
        """Seconds and nanoseconds of the host's clock; from 0 on until the host has told the time."""
        return self.device.time(ticks_ms())

    def log(self, level: int, text: str) -> None:
        """Sends a line to the host's log; levels are DEBUG, INFO, WARN, ERROR and FATAL."""
        self.device.log(level, text.encode())

    def logdebug(self, text: str) -> None:
        """A line for developers."""
        self.log(DEBUG, text)

    def loginfo(self, text: str) -> None:
        """A line for everybody."""
        self.log(INFO, text)

    def logwarn(self, text: str) -> None:
        """A line about what is not as it should be."""
        self.log(WARN, text)

    def logerror(self, text: str) -> None:
        """A line about what failed."""
        self.log(ERROR, text)

    def logfatal(self, text: str) -> None:
        """A line about what cannot go on."""
        self.log(FATAL, text)

    def spin_once(self, timeout: int = 0) -> bool:
        """Takes what has come, or waits for it at most ``timeout`` ms; returns ``connected``.

        Opens the port when it is not open. RuntimeError when called from a callback.
        """
        if self._spinning:
            raise RuntimeError("spin_once() and what waits for an answer cannot be called from a callback")
        self._spinning = True
        try:
            self._spin(timeout)
        finally:
            self._spinning = False
        return self.device.connected

    def close(self) -> None:
        """Closes the port; ``spin_once`` opens it again."""
        self._port.close()
        self._open = False
        self.device.lost()

    # ---- the port ----

    def _spin(self, timeout: int) -> None:
        if not self._open and not self._opened():
            sleep_ms(min(timeout, _STEP))
            return
        due = self.device.tick(ticks_ms())
        if timeout:
            self._port.wait(min(timeout, due))
        try:
            self._port.receive(self._feed)
        except OSError:
            self._gone()
            return
        self.device.tick(ticks_ms())

    def _opened(self) -> bool:
        if ticks_diff(ticks_ms(), self._retry) >= 0:
            try:
                self._open = self._port.open()
            except OSError:
                self._gone()
        return self._open

    def _gone(self) -> None:
        self.close()
        self._retry = ticks_add(ticks_ms(), _RETRY)

    def _feed(self, data: "Buffer", n: int) -> None:
        self.device.feed(data, n, ticks_ms())

    def _send(self, buf: "Buffer", off: int, n: int) -> None:
        if self._open:
            self._port.send(buf, off, n)

    def _spin_until(self, done: "Callable[[], bool]", timeout: int) -> bool:
        end = ticks_add(ticks_ms(), timeout)
        while not done():
            left = ticks_diff(end, ticks_ms())
            if left <= 0:
                return False
            self.spin_once(min(left, _STEP))
        return True


class Publisher:
    """Sends messages on one topic."""

    def __init__(self, device: Device, topic_id: int) -> None:
        self._device = device
        self.id = topic_id

    def publish(self, message: "Any") -> int:
        """Sends a message; returns the bytes of its frame, 0 while not connected, -1 if the buffer is too small."""
        return self._device.publish(self.id, message)


class ServiceClient:
    """Calls one service of the host, one call at a time."""

    def __init__(self, node: NodeHandle, name: str, kind: "Any") -> None:
        self._node = node
        self._kind = kind
        self._waiting = False
        self._response: "Any" = None
        device = node.device
        self._id = device.publisher(name, kind.TYPE, kind.Request.MD5, _ID_SERVICE_CLIENT)
        device.subscriber(name, kind.TYPE, kind.Response.MD5, self._on_response, _ID_SERVICE_CLIENT + 1)

    def call(self, request: "Any", timeout: int = _PATIENCE) -> "Any":
        """The response, None if none comes within ``timeout`` ms or there is no host. Not for callbacks."""
        self._response = None
        if self._node.device.publish(self._id, request) <= 0:
            return None
        self._waiting = True
        self._node._spin_until(lambda: self._response is not None, timeout)
        self._waiting = False
        return self._response

    def _on_response(self, buf: bytearray, off: int, n: int) -> None:
        if self._waiting:  # the protocol does not number calls: what comes late answers nobody
            self._response = parse(self._kind.Response, buf, off, n)


def parse(kind: "Any", buf: "Buffer", off: int, n: int) -> "Any":
    """The message of a class in ``buf[off:off + n]``; MessageError if it is none."""
    message = kind()
    end = message.read(buf, off, off + n)
    if end != off + n:
        raise MessageError(str(off + n - end) + " bytes left over")
    return message
