"""CAN FD: the codec of frames, and an interface that goes down. The kernel needs no CAN for these."""

from __future__ import annotations

import asyncio
import errno
import socket
import struct
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.links import CanLink, LinkError
from muros.links._can import can_frame_bytes, parse_can_frame_untrusted
from tests.links.rigs import BusLink, CanRig, Watcher


class TestFrames:
    def test_a_frame_as_the_kernel_has_it(self) -> None:
        frame = can_frame_bytes(0x1ABCDEF0, b"hello")
        assert frame == struct.pack("=IBBBB", 0x9ABCDEF0, 6, 0, 0, 0) + b"\x05hello" + bytes(58)
        assert parse_can_frame_untrusted(frame) == (0x1ABCDEF0, b"hello")

    @given(st.integers(0, 0x1FFFFFFF), st.binary(min_size=1, max_size=63))
    def test_there_and_back(self, identifier: int, message: bytes) -> None:
        frame = can_frame_bytes(identifier, message)
        assert len(frame) == 72
        assert parse_can_frame_untrusted(frame) == (identifier, message)

    @given(st.binary(max_size=80) | st.binary(min_size=72, max_size=72) | st.binary(min_size=16, max_size=16))
    def test_any_bytes(self, frame: bytes) -> None:
        found = parse_can_frame_untrusted(frame)
        if found is not None:
            assert 0 <= found[0] <= 0x1FFFFFFF
            assert 1 <= len(found[1]) <= 63
            assert found[1] in frame

    def test_padded_to_a_length_that_can_has(self) -> None:
        frame = bytearray(can_frame_bytes(1, b"123456789"))  # 10 bytes travel as 12
        frame[4] = 12
        assert parse_can_frame_untrusted(bytes(frame)) == (1, b"123456789")

    @pytest.mark.parametrize("flags", [0, 0xC0000000, 0xA0000000], ids=["standard", "remote", "error"])
    def test_frames_that_carry_no_message(self, flags: int) -> None:
        frame = struct.pack("=IBBxx64s", flags | 5, 6, 0, b"\x05hello")
        assert parse_can_frame_untrusted(frame) is None

    def test_too_long(self) -> None:
        with pytest.raises(ValueError, match="64 B does not fit a CAN FD frame"):
            can_frame_bytes(1, bytes(64))


class TestCanLink:
    def test_a_system_without_can_says_what_to_load(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def none(*_: Any) -> socket.socket:
            raise OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol")

        async def main() -> None:
            monkeypatch.setattr("muros.links._can.socket.socket", none)
            with pytest.raises(
                LinkError, match=r"canfd can0: this system has no CAN\. .*modprobe can can_raw vcan"
            ):
                CanLink("can0").open(Watcher())

        asyncio.run(main())

    @pytest.mark.parametrize(
        ("flags", "mtu", "words"),
        [
            (None, None, r"no such interface\. Choose one of: vcan7"),
            ("0x40080", "72", r"the interface is down\. Bring it up: sudo ip link set can0 up type can"),
            ("0x40081", "16", r"carries classic CAN only\. Set it up for CAN FD: .* fd on"),
        ],
    )
    def test_an_interface_that_does_not_fit(
        self, flags: str | None, mtu: str | None, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (tmp_path / "vcan7").mkdir()
        (tmp_path / "vcan7" / "type").write_text("280\n")
        if flags is not None and mtu is not None:
            (tmp_path / "can0").mkdir()
            (tmp_path / "can0" / "flags").write_text(flags + "\n")
            (tmp_path / "can0" / "mtu").write_text(mtu + "\n")
        real = socket.socket
        monkeypatch.setattr("muros.links._can._NETWORK", tmp_path)

        async def main() -> None:
            with monkeypatch.context() as patch:
                patch.setattr(
                    "muros.links._can.socket.socket", lambda *_: real(socket.AF_INET, socket.SOCK_DGRAM)
                )
                with pytest.raises(LinkError, match=words):
                    CanLink("can0").open(Watcher())

        asyncio.run(main())

    def test_an_interface_that_goes_down_is_waited_for(self, tmp_path: Path) -> None:
        class Fragile(BusLink):
            down = False
            tries = 0

            def _receive(self, sock: socket.socket) -> Any:
                if self.down:
                    raise OSError(errno.ENETDOWN, "Network is down")
                return super()._receive(sock)

            def _bind(self) -> socket.socket:
                self.tries += 1
                if self.down and self.tries < 5:
                    raise LinkError("canfd can0", "the interface is down", "Bring it up.")
                self.down = False
                if self.bus is not None:
                    self.bus.close()
                return super()._bind()

        async def main() -> None:
            rig = CanRig(tmp_path)
            rig.link = link = Fragile()
            events = Watcher(echo=True)
            link.open(events)
            client = await rig.client()
            await client.send(b"hello")
            assert await client.receive() == b"hello"
            assert rig.link.describe(events.messages[0][1]) == "can0#1ABC0000"
            link.down = True
            await client.send(b"wake up")
            await events.until(lambda: events.down)
            assert events.down == ["can0: Network is down"]
            assert link.send(b"too late", 5) is False
            await events.until(lambda: len(events.up) == 2)
            assert link.tries == 5
            await client.send(b"again")
            assert await client.receive() == b"again"
            rig.close()

        asyncio.run(main())
