"""What `muros doctor --rosserial DEVICE` looks at: the port, the rate, the protocol, and everything the board names."""

from __future__ import annotations

import os
import select
import struct
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Final, Protocol

from muros import interfaces
from muros.cli._diagnosis import Result, fine, note, wrong
from muros.interfaces import InterfaceError
from muros.links import LinkError
from muros.links._terminal import AbsentError, change_baud, close_terminal, open_terminal, serial_ports
from muros.rosserial.messages import (
    MessageError,
    TopicInfo,
    log_untrusted,
    parameter_request_untrusted,
    topic_info_untrusted,
    write_time,
)
from muros.rosserial.packets import ANY_VERSION, VERSION_GROOVY, Decoder, frame
from muros.rosserial.server import BAUD, BAUDS, judge

__all__ = ["Line", "board_checks"]

PROBE: Final = bytes.fromhex("fffe0000ff0000ff00ffff00000000ff00")
"""Asks boards of either protocol version for their topics, in one burst."""

FIRST_WAIT: Final = 3.5
"""Seconds for a first answer: many boards start anew when their port is opened, and their boot loader waits."""
WAIT: Final = 0.7
"""Seconds for an answer at another rate."""
TOPICS: Final = 0.4
"""Silence after which a board has named everything, in seconds; there is no end mark."""
LISTEN: Final = 1.0
"""Seconds of listening to what the board does then."""
SAMPLE: Final = 80
"""Bytes kept of what is no frame."""
SLOW_FRAME: Final = 0.020
"""ros_lib on a UART drops a frame that takes longer, in seconds."""
BITS: Final = 10

_ENDPOINTS: Final = {
    0: "publishes",
    1: "subscribes",
    2: "serves",
    3: "serves",
    4: "calls",
    5: "calls",
}
_LEVELS: Final = ("debug", "info", "warning", "error", "fatal")


class Line(Protocol):
    """A serial line. ``rate`` is False where a baud rate has no meaning, as on USB of the board's own."""

    rate: bool

    def set_baud(self, baud: int) -> None: ...

    def write(self, data: bytes) -> None: ...

    def read(self, timeout: float) -> bytes: ...

    def close(self) -> None: ...


def board_checks(
    device: str,
    baud: int | None = None,
    open_line: Callable[[str, int], Line] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[Result]:
    """All of them, one after the other. ``baud`` None: the usual ones are tried."""
    try:
        line = (open_line or Terminal)(device, baud or BAUD)
    except AbsentError:
        ports = serial_ports()
        there = f"there are {', '.join(ports)}" if ports else "no serial port is plugged in"
        yield wrong(f"{device} is not there", f"Plug the board in, or name its port: {there}")
        return
    except LinkError as error:
        yield wrong(f"{error.where}: {error.why}", error.remedy)
        return
    try:
        yield fine(f"{device} can be opened")
        yield from _Examination(device, line, clock).results(baud)
    except OSError as error:
        yield wrong(
            f"{device} is gone: {error.strerror or error}", "Check plug and cable, and the board's supply"
        )
    finally:
        line.close()


class Terminal:
    """A serial port of this host."""

    def __init__(self, device: str, baud: int) -> None:
        self._device = device
        self._fd = open_terminal(device, baud)
        self.rate = not os.path.realpath(device).startswith(
            ("/dev/ttyACM", "/dev/ttyGS", "/dev/rfcomm", "/dev/pts/")
        )

    def set_baud(self, baud: int) -> None:
        """Speaks at another rate from now on. Raises LinkError for one that the port has not."""
        change_baud(self._device, self._fd, baud)

    def write(self, data: bytes) -> None:
        """Sends bytes, if the line takes them."""
        if select.select([], [self._fd], [], 1.0)[1]:
            os.write(self._fd, data)

    def read(self, timeout: float) -> bytes:
        """What comes within ``timeout`` seconds, or nothing. Raises OSError when the port is gone."""
        if not select.select([self._fd], [], [], timeout)[0]:
            return b""
        data = os.read(self._fd, 4096)
        if not data:
            raise OSError(5, "the port is gone")
        return data

    def close(self) -> None:
        """Gives the port back."""
        close_terminal(self._fd)


class _Examination:
    """One board at a line."""

    def __init__(self, device: str, line: Line, clock: Callable[[], float]) -> None:
        self._device = device
        self._line = line
        self._clock = clock
        self._decoder = Decoder(0xFFFF, self._take, ANY_VERSION)
        self._infos: dict[tuple[int, int], TopicInfo] = {}
        self._logs: list[tuple[int, str]] = []
        self._parameters: list[str] = []
        self._messages: dict[int, int] = {}
        self._time_requests = 0
        self._received = 0
        self._sample = b""

    def results(self, baud: int | None) -> Iterator[Result]:
        """What there is to say."""
        rates = (baud,) if baud else tuple(BAUDS) if self._line.rate else (BAUD,)
        spoken = self._find_rate(rates)
        if not spoken:
            yield self._no_answer(rates)
            return
        self._gather()
        at = f" at {spoken} baud" if self._line.rate else ""
        version = "0xFF: Groovy or older" if self._decoder.heard == VERSION_GROOVY else "0xFE: Hydro or newer"
        yield fine(f"the board answers{at}, protocol version {version}")
        if baud is None and self._line.rate and spoken != BAUD:
            yield note(
                f"it speaks at {spoken} baud, not at rosserial's usual {BAUD}", f"muros rosserial -b {spoken}"
            )
        yield from self._protocol()
        yield from self._topics(spoken if self._line.rate else 0)
        yield from self._behaviour()

    def _find_rate(self, rates: Sequence[int]) -> int:
        """The rate at which good frames come, 0 if there is none."""
        for number, rate in enumerate(rates):
            if number or self._line.rate:
                try:
                    self._line.set_baud(rate)
                except LinkError:
                    continue  # not every port has every rate
            self._decoder.reset()
            end = self._clock() + (WAIT if number else FIRST_WAIT)
            while self._clock() < end:
                self._line.write(PROBE)
                self._listen(min(1.0, end - self._clock()), lambda: self._decoder.frames > 0)
                if self._decoder.frames:
                    return rate
        return 0

    def _gather(self) -> None:
        """Everything the board names, and what it does by itself for a while."""
        seen = -1
        while seen != self._decoder.frames:
            seen = self._decoder.frames
            self._listen(TOPICS, lambda: False)
        if not self._infos:  # what answered may have been the end of something else
            self._line.write(frame(0, b"", self._decoder.heard))
            self._listen(2 * TOPICS, lambda: bool(self._infos))
        self._listen(LISTEN, lambda: False)
        self._line.write(frame(11, b"", self._decoder.heard))  # and it need not publish to nobody

    def _listen(self, wait: float, enough: Callable[[], bool]) -> None:
        end = self._clock() + wait
        while (left := end - self._clock()) > 0 and not enough():
            data = self._line.read(min(left, 0.1))
            now = int(self._clock() * 1000)
            if data:
                self._received += len(data)
                before = self._decoder.frames
                self._decoder.feed(data, len(data), now)
                if self._decoder.frames == before:
                    self._sample = (self._sample + data)[-SAMPLE:]
            else:
                self._decoder.tick(now)

    def _take(self, topic_id: int, buf: bytearray, off: int, n: int) -> None:
        try:
            if topic_id in _ENDPOINTS:
                info = topic_info_untrusted(buf, off, n)
                self._infos[topic_id, info.topic_id] = info
            elif topic_id == 10:
                self._time_requests += 1
                stamp = bytearray(8)
                seconds, nanoseconds = divmod(time.time_ns(), 1_000_000_000)
                write_time(stamp, 0, seconds, nanoseconds)
                self._line.write(frame(10, stamp, self._decoder.heard))
            elif topic_id == 7:
                level, text = log_untrusted(buf, off, n)
                self._logs.append((level, text.decode("utf-8", "replace")))
            elif topic_id == 6:
                self._parameters.append(parameter_request_untrusted(buf, off, n))
                self._line.write(frame(6, struct.pack("<III", 0, 0, 0), self._decoder.heard))
            else:
                self._messages[topic_id] = self._messages.get(topic_id, 0) + 1
        except MessageError:
            self._decoder.bad_checksum += 1

    # ---- what it means ----

    def _no_answer(self, rates: Sequence[int]) -> Result:
        bad = self._decoder.bad_checksum + self._decoder.bad_length + self._decoder.cut
        rate = rates[0] if len(rates) == 1 and self._line.rate else 0
        why, remedy = judge(self._received, self._sample, bad, 0, rate)
        tried = f" at {', '.join(map(str, rates))} baud" if len(rates) > 1 else ""
        return wrong(f"no rosserial board answers{tried}: {why}", remedy)

    def _protocol(self) -> Iterator[Result]:
        if not self._time_requests:
            yield note(
                "it does not ask for the time, as ros_lib does",
                "rosserial_python cuts such boards off every 15 s; muros rosserial does not mind",
            )
        damaged = self._decoder.bad_checksum + self._decoder.bad_length + self._decoder.cut
        if damaged:
            yield wrong(
                f"{damaged} of {damaged + self._decoder.frames} frames are damaged",
                "Check cable, ground and level; lower the rate; print nothing on this port",
            )
        elif self._decoder.garbage:
            yield note(
                f"{self._decoder.garbage} B stand between its frames: {self._sample[:40]!r}",
                "Print nothing on this port",
            )

    def _topics(self, baud: int) -> Iterator[Result]:
        if not self._infos:
            yield wrong(
                "it names no topics",
                "Advertise and subscribe in setup(), and call nh.spinOnce() in loop()",
            )
        for (endpoint, _), info in sorted(self._infos.items(), key=lambda item: item[0]):
            if endpoint not in (3, 5):  # the second half of a service
                yield self._topic(endpoint, info, baud)
        limit = int(baud * SLOW_FRAME / BITS) - 8
        taken = [info.buffer_size for (endpoint, _), info in self._infos.items() if endpoint in (1, 3, 5)]
        if baud and taken and limit < max(taken):
            yield note(
                f"at {baud} baud ros_lib drops what is longer than {limit} B on its way to the board",
                "Raise the rate for longer messages; boards with USB of their own are not concerned",
            )

    def _topic(self, endpoint: int, info: TopicInfo, baud: int) -> Result:
        what = f"{_ENDPOINTS[endpoint]} {info.topic_name} [{info.message_type}], buffer {info.buffer_size} B"
        half = {2: "_Response", 4: "_Request"}.get(endpoint, "")
        try:
            converter = interfaces.converter(info.message_type + half, info.md5sum)
        except InterfaceError as error:
            return wrong(
                f"{what}: {error}", "Give the folder of its definition: muros rosserial --types FOLDER"
            )
        size = converter.ros1_size
        room = info.buffer_size - (8 if endpoint in (0, 2, 4) else 0)
        least = size or converter.least_size
        if least > room:
            return wrong(
                f"{what}: a message has {'' if size else 'at least '}{least} B and {room} B fit",
                "Give NodeHandle_ larger buffers",
            )
        if endpoint == 1 and baud and (size or 0) + 8 > baud * SLOW_FRAME / BITS:
            return wrong(
                f"{what}: its {size} B take longer than 20 ms at {baud} baud, and ros_lib drops what does",
                "Raise the rate, or use a smaller type",
            )
        if converter.drift:
            return note(f"{what}: {converter.drift}", "It is converted; new firmware would not need that")
        return fine(what)

    def _behaviour(self) -> Iterator[Result]:
        for name in dict.fromkeys(self._parameters):
            yield note(
                f"it asks for parameter {name}",
                f"muros rosserial --params FILE with {name.strip('~/')} in it",
            )
        if self._messages:
            known = {topic_id for _, topic_id in self._infos}
            unknown = sorted(set(self._messages) - known)
            if unknown:
                yield wrong(
                    f"it sends on ids it does not name: {unknown}", "Let it name its topics when it is asked"
                )
            count = sum(self._messages.values())
            yield fine(f"{count} message{'' if count == 1 else 's'} came meanwhile")
        for level, text in self._logs[:10]:
            say = wrong if level >= 3 else note
            yield say(
                f"it says ({_LEVELS[min(level, 4)]}): {text}", "Look at the firmware" if level >= 3 else ""
            )
