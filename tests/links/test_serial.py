"""Serial lines and pseudoterminals: ports that come and go, are busy, forbidden, stuck or noisy."""

from __future__ import annotations

import asyncio
import errno
import json
import os
import random
import termios
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.links import (
    BAUD_RATES,
    LineAddress,
    LinkError,
    PseudoterminalLink,
    SerialFraming,
    SerialLink,
    devices_from_file,
)
from muros.links._terminal import close_terminal, open_terminal
from muros.xrce.framing import serial_frame
from tests.links.rigs import Device, FarEnd, LineClient, Watcher

VECTORS = Path(__file__).parents[1] / "vectors" / "xrce"
RETRY_S = 0.001


def run(body: Callable[[], Awaitable[None]]) -> None:
    async def main() -> None:
        await body()

    asyncio.run(main())


class TestSerialPort:
    def test_absent_plugged_in_pulled_and_back(self, tmp_path: Path) -> None:
        path = tmp_path / "ttyUSB0"

        async def body() -> None:
            events = Watcher(echo=True)
            link = SerialLink(str(path), 921600, retry=RETRY_S)
            link.open(events)
            assert events.codes() == ["port-absent"]
            assert "as soon as it appears" in events.problems[0][3]
            assert link.ports == []
            for turn in (1, 2, 3):
                device = Device(path)
                await events.until(lambda turn=turn: len(events.up) == turn)  # type: ignore[misc]
                assert events.up[-1] == f"{path} at 921600"
                far = FarEnd(os.dup(device.master))
                client = LineClient(far, 7)
                await client.send(b"hello")
                assert await client.receive() == b"hello"
                address = LineAddress(str(path), 7)
                assert events.messages[-1] == (b"hello", address)
                assert link.describe(address) == f"{path}#7"
                far.close()
                device.pull()
                await events.until(lambda turn=turn: len(events.down) == turn)  # type: ignore[misc]
                reason = f"cable pulled: {path} is gone"
                assert events.down[-1] == reason
                assert events.gone[-1] == (address, reason)
                assert link.send(b"too late", address) is False
            assert link.counters.dropped == {"port-gone": 3}
            assert events.codes() == ["port-absent", *["port-gone"] * 3]
            link.close()

        run(body)

    def test_a_far_end_that_hangs_up_while_the_device_stays(self, tmp_path: Path) -> None:
        async def body() -> None:
            device = Device(tmp_path / "ttyS0")
            events = Watcher()
            link = SerialLink(str(device.path), retry=RETRY_S)
            link.open(events)
            os.close(device.slave)
            os.close(device.master)
            (tmp_path / "real").write_text("")
            device.path.unlink()
            device.path.symlink_to(tmp_path / "real")
            await events.until(lambda: events.down)
            assert events.down[0].startswith(f"{device.path} hung up (")
            await events.until(lambda: events.problems)  # what is there now is no terminal; that is said once
            assert events.codes() == ["port-unusable"]
            assert "is not a serial port" in events.problems[0][2]
            link.close()

        run(body)

    def test_a_port_in_use_says_by_whom(self, tmp_path: Path) -> None:
        async def body() -> None:
            device = Device(tmp_path / "ttyACM0")
            first, second = SerialLink(str(device.path)), SerialLink(str(device.path))
            first.open(Watcher())
            own = Path("/proc/self/comm").read_text().strip()
            with pytest.raises(LinkError) as caught:
                second.open(Watcher())
            expected = (
                f"{device.path}: in use by {own} (pid {os.getpid()}). Stop the program that has it open."
            )
            assert str(caught.value) == expected
            assert not second.is_open
            first.close()
            second.open(Watcher())
            second.close()
            device.pull()

        run(body)

    def test_permission_denied_names_the_group(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        device = tmp_path / "ttyUSB0"
        device.write_text("")

        def forbidden(path: str, *_: Any) -> int:
            raise PermissionError(errno.EACCES, "Permission denied", path)

        class Group:
            gr_gid = 12345
            gr_name = "dialout"

        monkeypatch.setattr("muros.links._terminal.os.open", forbidden)
        monkeypatch.setattr("muros.links._terminal.grp.getgrgid", lambda gid: Group)

        async def body() -> None:
            with pytest.raises(LinkError) as caught:
                SerialLink(str(device)).open(Watcher())
            assert str(caught.value) == (
                f"{device}: permission denied. You are not in group dialout: "
                "sudo usermod -aG dialout $USER, then log in again."
            )
            Group.gr_gid = os.getgid()
            with pytest.raises(LinkError, match=f"Its mode forbids it: see ls -l {device}"):
                SerialLink(str(device)).open(Watcher())

        run(body)

    def test_a_rule_that_grants_the_port_late_is_waited_for(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        real = os.open
        forbidden = 3

        def open_(path: str, *rest: Any) -> int:
            nonlocal forbidden
            if str(path).endswith("ttyUSB0") and os.path.exists(path) and forbidden:
                forbidden -= 1
                raise PermissionError(errno.EACCES, "Permission denied", path)
            return real(path, *rest)

        monkeypatch.setattr("muros.links._terminal.os.open", open_)

        async def body() -> None:
            events = Watcher()
            link = SerialLink(str(tmp_path / "ttyUSB0"), retry=RETRY_S)
            link.open(events)
            device = Device(tmp_path / "ttyUSB0")
            await events.until(lambda: events.up)
            assert events.codes() == ["port-absent", "port-unusable"]  # each once, however often it was tried
            assert forbidden == 0
            link.close()
            device.pull()

        run(body)

    @pytest.mark.parametrize(
        ("baud", "nearest"),
        [
            (250000, "230400 or 460800"),
            (1, "50"),
            (0, "50"),
            (5_000_000, "4000000"),
            (115201, "115200 or 230400"),
        ],
    )
    def test_an_unknown_baud_rate_names_the_nearest(self, baud: int, nearest: str, tmp_path: Path) -> None:
        async def body() -> None:
            with pytest.raises(LinkError, match=rf"{baud} is not a baud rate .*\. Nearest: {nearest}\.$"):
                SerialLink(str(tmp_path / "none"), baud).open(Watcher())

        run(body)

    def test_a_driver_that_refuses_the_rate(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        device = Device(tmp_path / "ttyUSB0")
        real = termios.tcsetattr

        def slower(fd: int, when: int, settings: list[Any]) -> None:
            settings[4:6] = [termios.B115200] * 2
            real(fd, when, settings)

        monkeypatch.setattr("muros.links._terminal.termios.tcsetattr", slower)
        with pytest.raises(LinkError, match="its driver refuses 4000000 baud"):
            open_terminal(str(device.path), 4000000)
        device.pull()

    def test_every_baud_rate_of_upstream_agents_is_known(self) -> None:
        upstream = (
            "50 75 110 134 150 200 300 600 1200 1800 2400 4800 9600 19200 38400 57600 115200 230400 460800 500000"
            " 576000 921600 1000000 1152000 1500000 2000000 2500000 3000000 3500000 4000000"
        )
        assert sorted(BAUD_RATES) == [int(word) for word in upstream.split()]

    def test_a_file_is_no_serial_port(self, tmp_path: Path) -> None:
        (tmp_path / "notes").write_text("hello")

        async def body() -> None:
            with pytest.raises(LinkError, match="notes: is not a serial port"):
                SerialLink(str(tmp_path / "notes")).open(Watcher())
            with pytest.raises(LinkError, match="Is a directory"):
                SerialLink(str(tmp_path)).open(Watcher())
            with pytest.raises(LinkError, match="no device is named"):
                SerialLink([]).open(Watcher())

        run(body)

    def test_the_line_is_raw_and_all_of_a_byte_passes(self, tmp_path: Path) -> None:
        device = Device(tmp_path / "ttyUSB0")
        fd = open_terminal(str(device.path), 57600)
        settings = termios.tcgetattr(fd)
        assert settings[0] == settings[1] == settings[3] == 0
        assert settings[2] & termios.CSIZE == termios.CS8
        assert not settings[2] & (termios.PARENB | termios.CSTOPB | termios.CRTSCTS)
        assert settings[4] == settings[5] == termios.B57600
        every = bytes(range(256))
        os.write(device.master, every)
        assert os.read(fd, 1000) == every
        close_terminal(fd)
        device.pull()

    def test_several_ports_and_patterns(self, tmp_path: Path) -> None:
        async def body() -> None:
            events = Watcher()
            link = SerialLink([str(tmp_path / "ttyS1"), str(tmp_path / "ttyACM*")], retry=RETRY_S)
            assert link.name == f"multiserial {tmp_path}/ttyS1 {tmp_path}/ttyACM* at 115200"
            devices = [Device(tmp_path / "ttyS1"), Device(tmp_path / "ttyACM0")]
            link.open(events)
            assert link.ports == [str(device.path) for device in devices]
            devices.append(Device(tmp_path / "ttyACM3"))
            (tmp_path / "ttyACM4").symlink_to(tmp_path / "ttyACM3")  # another name of a port that is open
            await events.until(lambda: len(events.up) == 3)
            for number, device in enumerate(devices):
                os.write(device.master, serial_frame(b"from %d" % number, 1, 0))
            await events.until(lambda: len(events.messages) == 3)
            assert dict(events.messages) == {
                b"from %d" % number: LineAddress(str(device.path), 1) for number, device in enumerate(devices)
            }
            assert not events.problems
            (tmp_path / "ttyACM4").unlink()
            for device in devices:
                device.pull()
            await events.until(lambda: len(events.down) == 3)
            assert link.ports == []
            link.close()

        run(body)

    def test_a_pattern_that_nothing_matches_is_told_once(self, tmp_path: Path) -> None:
        async def body() -> None:
            events = Watcher()
            link = SerialLink(str(tmp_path / "ttyACM*"), retry=RETRY_S)
            link.open(events)
            assert events.codes() == ["port-absent"]
            device = Device(tmp_path / "ttyACM5")
            await events.until(lambda: events.up)
            assert events.codes() == ["port-absent"]
            link.close()
            device.pull()

        run(body)

    def test_clients_share_a_line_by_address(self, tmp_path: Path) -> None:
        async def body() -> None:
            device = Device(tmp_path / "rs485")
            events = Watcher()
            link = SerialLink(str(device.path))
            link.open(events)
            os.write(
                device.master, serial_frame(b"a", 1, 0) + serial_frame(b"b", 2, 0) + serial_frame(b"x", 2, 9)
            )
            await events.until(lambda: len(events.messages) == 2)
            assert [address for _, address in events.messages] == [
                LineAddress(str(device.path), 1),
                LineAddress(str(device.path), 2),
            ]
            assert link.counters.framing["wrong-address"] == 1
            assert not events.problems  # what others say to each other is no noise
            assert link.send(b"answer", events.messages[1][1])
            assert os.read(device.master, 100) == serial_frame(b"answer", 0, 2)
            link.close()
            device.pull()

        run(body)

    def test_a_stuck_port_drops_and_never_blocks(self, tmp_path: Path) -> None:
        async def body() -> None:
            device = Device(tmp_path / "ttyUSB0")
            events = Watcher()
            link = SerialLink(str(device.path), queue_bytes=2000)
            link.open(events)
            address = LineAddress(str(device.path), 1)
            n = 0
            while link.send(b"%03d" % n * 100, address):
                n += 1
                assert n < 1000, "the queue has no end"
            assert link.counters.dropped == {"queue-full": 1}
            assert events.codes() == ["queue-full"]
            assert 1600 < link._ports[str(device.path)].channel.queued <= 2000
            client = LineClient(far := FarEnd(os.dup(device.master)), 1)
            for number in range(n):  # whole frames only were dropped: what was accepted arrives
                assert await client.receive() == b"%03d" % number * 100
            assert link.send(b"again", address)
            assert await client.receive() == b"again"
            far.close()
            link.close()
            device.pull()

        run(body)

    def test_noise_is_told_with_the_likely_cause(self, tmp_path: Path) -> None:
        async def body() -> None:
            device = Device(tmp_path / "ttyUSB0")
            events = Watcher()
            link = SerialLink(str(device.path), 57600)
            link.open(events)
            frame = bytearray(serial_frame(b"message", 1, 0))
            frame[8] ^= 1
            os.write(device.master, bytes(frame) * 3)
            await events.until(lambda: link.counters.framing["bad-crc"] == 3)
            assert sum(problem[4] for problem in events.problems) == 3
            code, what, why, remedy, _ = events.problems[0]
            assert code == "line-noise"
            assert str(device.path) in what
            assert "wrong baud rate" in why
            assert "57600" in remedy
            link.close()
            device.pull()

        run(body)

    def test_nothing_but_garbage_is_told_but_boot_messages_are_not(self, tmp_path: Path) -> None:
        async def body() -> None:
            device = Device(tmp_path / "ttyUSB0")
            events = Watcher()
            link = SerialLink(str(device.path))
            link.open(events)
            boot = b"rst:0x1 (POWERON_RESET),boot:0x13\r\n" * 20
            os.write(device.master, boot + serial_frame(b"hello", 1, 0))
            await events.until(lambda: events.messages)
            assert link.counters.framing["garbage"] == len(boot)
            assert not events.problems
            far = FarEnd(device.master)
            await far.write(b"\0" * 10_000)
            await events.until(lambda: events.problems)
            assert events.codes()[0] == "line-garbage"
            assert "B without one good frame on" in events.problems[0][1]
            link.close()
            far.loop.remove_reader(far.fd)
            device.pull()

        run(body)


class TestPseudoterminal:
    def test_the_far_end_may_come_go_and_come_back(self, tmp_path: Path) -> None:
        async def body() -> None:
            events = Watcher(echo=True)
            link = PseudoterminalLink()
            link.open(events)
            assert link.device is not None
            assert link.name == f"pseudoterminal {link.device}"
            for _ in range(3):
                far = FarEnd(os.open(link.device, os.O_RDWR | os.O_NOCTTY))
                client = LineClient(far, 1)
                await client.send(b"hello")
                assert await client.receive() == b"hello"
                far.close()
            assert not events.down
            device = link.device
            link.close()
            assert link.device is None
            assert not os.path.exists(device)

        run(body)

    def test_the_symlink_is_ours_from_open_to_close(self, tmp_path: Path) -> None:
        async def body() -> None:
            path = tmp_path / "board"
            path.symlink_to("/dev/pts/left-over")
            link = PseudoterminalLink(str(path))
            link.open(Watcher())
            assert os.readlink(path) == link.device
            assert link.name == f"pseudoterminal {path} {link.device}"
            link.close()
            assert not path.is_symlink()
            link.open(Watcher())
            path.unlink()
            path.symlink_to("/dev/pts/somebody-else")
            link.close()
            assert os.readlink(path) == "/dev/pts/somebody-else"

        run(body)

    def test_a_file_in_its_place_is_not_replaced(self, tmp_path: Path) -> None:
        async def body() -> None:
            (tmp_path / "board").write_text("precious")
            with pytest.raises(LinkError, match=r"board: File exists\. Choose another path"):
                PseudoterminalLink(str(tmp_path / "board")).open(Watcher())
            assert (tmp_path / "board").read_text() == "precious"

        run(body)

    def test_none_left(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def none() -> tuple[int, int]:
            raise OSError(errno.ENOSPC, "No space left on device")

        async def body() -> None:
            monkeypatch.setattr("muros.links._pty.os.openpty", none)
            with pytest.raises(LinkError, match=r"pseudoterminal: No space left on device\. See /proc"):
                PseudoterminalLink().open(Watcher())

        run(body)


class TestSerialFraming:
    @pytest.mark.parametrize("name", ["serial_pubsub", "serial_fragments", "ced_serial_session_key_escapes"])
    def test_recorded_sessions(self, name: str) -> None:
        packets = json.loads((VECTORS / f"{name}.json").read_text())["packets"]
        for direction, local, peer in (("c>a", 0, 1), ("a>c", 1, 0)):
            framing = SerialFraming(local)
            mine = [packet for packet in packets if packet["dir"] == direction]
            stream = b"".join(bytes.fromhex(packet["frame_hex"]) for packet in mine)
            expected = [(bytes.fromhex(packet["hex"]), peer) for packet in mine]
            assert expected
            assert framing.feed_untrusted(stream) == expected
            assert not any(framing.errors().values())
            sender = SerialFraming(peer)
            assert b"".join(sender.frame(message, local) for message, _ in expected) == stream

    @given(
        st.lists(st.binary(max_size=80) | st.builds(lambda m: serial_frame(m, 3, 0), st.binary(max_size=80))),
        st.integers(0, 2**32),
    )
    def test_any_bytes_in_any_pieces(self, parts: list[bytes], seed: int) -> None:
        stream = b"".join(parts)
        whole, pieces = SerialFraming(0, 64), SerialFraming(0, 64)
        cuts = random.Random(seed)
        found, at = [], 0
        while at < len(stream):
            size = cuts.randint(1, 20)
            found += pieces.feed_untrusted(stream[at : at + size])
            at += size
        assert whole.feed_untrusted(stream) == found
        assert whole.errors() == pieces.errors()
        assert all(len(message) <= 64 for message, _ in found)


class TestDevicesFromFile:
    def test_first_line_or_all(self, tmp_path: Path) -> None:
        path = tmp_path / "devices"
        path.write_text("/dev/ttyUSB0 \n\n/dev/ttyACM1\n")
        assert devices_from_file(str(path)) == ["/dev/ttyUSB0"]
        assert devices_from_file(str(path), several=True) == ["/dev/ttyUSB0", "/dev/ttyACM1"]

    def test_none(self, tmp_path: Path) -> None:
        path = tmp_path / "devices"
        with pytest.raises(LinkError, match="No such file"):
            devices_from_file(str(path))
        path.write_bytes(b"\n\xff")
        with pytest.raises(LinkError, match="names no device"):
            devices_from_file(str(path))
