"""TCP: connections that come, go, are too many, or do not read."""

from __future__ import annotations

import asyncio
import errno
import json
import socket
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.links import LengthFraming, LinkError, TcpLink
from muros.xrce.framing import tcp_frame
from tests.links.rigs import TcpClient, TcpRig, Watcher

VECTORS = Path(__file__).parents[1] / "vectors" / "xrce"


class TestTcp:
    def test_a_connection_that_closes_is_told(self, tmp_path: Path) -> None:
        async def main() -> None:
            rig = TcpRig(tmp_path)
            events = Watcher()
            rig.link.open(events)
            client = await rig.client()
            await client.send(b"hello")
            await events.until(lambda: events.messages)
            address = events.messages[0][1]
            assert rig.link.peers == [address]
            client.close()
            await events.until(lambda: events.gone)
            assert events.gone == [(address, "connection closed by the far end")]
            assert rig.link.peers == []
            assert rig.link.send(b"too late", address) is False
            assert rig.link.counters.dropped == {"no-such-peer": 1}
            rig.close()

        asyncio.run(main())

    def test_a_connection_that_breaks_is_told(self, tmp_path: Path) -> None:
        async def main() -> None:
            rig = TcpRig(tmp_path)
            events = Watcher()
            rig.link.open(events)
            client = await rig.client()
            await client.send(b"hello")
            await events.until(lambda: events.messages)
            client.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
            client.close()
            await events.until(lambda: events.gone)
            assert events.gone[0][1] == "connection lost (Connection reset by peer)"
            rig.close()

        asyncio.run(main())

    def test_a_write_to_a_broken_connection_ends_it_after_send_returned(self, tmp_path: Path) -> None:
        async def main() -> None:
            rig = TcpRig(tmp_path)
            events = Watcher()
            rig.link.open(events)
            client = await rig.client()
            await client.send(b"hello")
            await events.until(lambda: events.messages)
            address = events.messages[0][1]
            rig.link._connections[address].sock.shutdown(socket.SHUT_WR)
            assert rig.link.send(b"into a pipe that is broken", address) is False
            assert not events.gone
            await events.until(lambda: events.gone)
            assert "Broken pipe" in events.gone[0][1]
            rig.close()

        asyncio.run(main())

    def test_too_many_are_refused_counted_and_told(self, tmp_path: Path) -> None:
        async def main() -> None:
            rig = TcpRig(tmp_path, connections=2)
            events = Watcher(echo=True)
            rig.link.open(events)
            clients = [await rig.client() for _ in range(3)]
            for client in clients[:2]:
                await client.send(b"hello")
                assert await client.receive() == b"hello"
            with pytest.raises(ConnectionError):
                await clients[2].receive()
            assert rig.link.counters.dropped == {"too-many-connections": 1}
            assert "2 clients are connected" in events.problems[0][2]
            clients[0].close()
            await events.until(lambda: events.gone)
            late = await rig.client()
            await late.send(b"hello")
            assert await late.receive() == b"hello"
            rig.close()

        asyncio.run(main())

    def test_one_that_does_not_read_harms_nobody(self, tmp_path: Path) -> None:
        async def main() -> None:
            rig = TcpRig(tmp_path, queue_bytes=100_000)
            events = Watcher()
            rig.link.open(events)
            slow, quick = await rig.client(), await rig.client()
            await slow.send(b"slow")
            await quick.send(b"quick")
            await events.until(lambda: len(events.messages) == 2)
            addresses = dict(events.messages)
            n = 0
            while rig.link.send(n.to_bytes(4, "big") * 5000, addresses[b"slow"]):
                n += 1
                assert n < 10_000, "the queue has no end"
            channel = rig.link._connections[addresses[b"slow"]].channel
            assert 80_000 <= channel.queued <= 100_000
            assert rig.link.counters.dropped == {"queue-full": 1}
            assert rig.link.send(b"for the quick one", addresses[b"quick"])
            assert await quick.receive() == b"for the quick one"
            for number in range(n):  # what was accepted arrives whole and in order once it reads
                assert await slow.receive() == number.to_bytes(4, "big") * 5000
            assert rig.link.send(b"again", addresses[b"slow"])
            assert await slow.receive() == b"again"
            rig.close()

        asyncio.run(main())

    def test_length_and_message_leave_together_without_delay(self, tmp_path: Path) -> None:
        async def main() -> None:
            rig = TcpRig(tmp_path)
            events = Watcher()
            rig.link.open(events)
            client = await rig.client()
            await client.send(b"hello")
            await events.until(lambda: events.messages)
            (connection,) = rig.link._connections.values()
            assert connection.sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
            assert connection.sock.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
            assert connection.sock.getsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE) == 10
            rig.link.send(b"both", events.messages[0][1])
            assert await client.loop.sock_recv(client.sock, 100) == b"\x04\x00both"
            rig.close()

        asyncio.run(main())

    def test_no_descriptors_left_is_a_pause_not_a_spin(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("muros.links._tcp._FULL_PAUSE_S", 0.01)
        tries = 0

        def exhausted(listener: socket.socket) -> Any:
            nonlocal tries
            tries += 1
            raise OSError(errno.EMFILE, "Too many open files")

        async def main() -> None:
            rig = TcpRig(tmp_path)
            events = Watcher(echo=True)
            rig.link.open(events)
            with monkeypatch.context() as patch:
                patch.setattr(socket.socket, "accept", exhausted)
                client = await rig.client()
                await events.until(lambda: events.problems)
                assert events.codes() == ["cannot-accept"]
                assert tries == 1
            await client.send(b"hello")
            assert await client.receive() == b"hello"
            rig.close()

        asyncio.run(main())

    def test_the_same_peer_through_another_address_replaces_itself(self, tmp_path: Path) -> None:
        async def main() -> None:
            link, events = TcpLink(0), Watcher(echo=True)
            link.open(events)
            clients: list[TcpClient] = []
            for host in ("127.0.0.1", "127.0.0.2"):  # different at this end, the same at the other
                sock = socket.socket()
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                sock.setblocking(False)
                sock.bind(clients[0].sock.getsockname() if clients else ("127.0.0.3", 0))
                await asyncio.get_running_loop().sock_connect(sock, (host, link.port))
                clients.append(TcpClient(sock))
                await clients[-1].send(b"hello")
                assert await clients[-1].receive() == b"hello"
            assert events.gone == [(clients[0].sock.getsockname(), "connection replaced by a new one")]
            with pytest.raises(ConnectionError):
                await clients[0].receive()
            await clients[1].send(b"still here")
            assert await clients[1].receive() == b"still here"
            link.close()
            for client in clients:
                client.close()

        asyncio.run(main())

    def test_one_that_breaks_while_data_waits_for_it_is_told(self, tmp_path: Path) -> None:
        async def main() -> None:
            rig = TcpRig(tmp_path, queue_bytes=100_000)
            events = Watcher()
            rig.link.open(events)
            client = await rig.client()
            await client.send(b"hello")
            await events.until(lambda: events.messages)
            address = events.messages[0][1]
            while rig.link.send(bytes(20_000), address):
                pass
            client.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
            client.close()
            await events.until(lambda: events.gone)
            assert rig.link.peers == []
            rig.close()

        asyncio.run(main())

    def test_the_port_taken(self) -> None:
        async def main() -> None:
            with socket.socket() as other:
                other.bind(("127.0.0.1", 0))
                other.listen()
                with pytest.raises(LinkError, match=r"tcp4 127.0.0.1:\d+: address in use by .* \(pid \d+\)"):
                    TcpLink(other.getsockname()[1], "127.0.0.1").open(Watcher())

        asyncio.run(main())

    def test_a_port_left_a_moment_ago_is_free(self, tmp_path: Path) -> None:
        async def main() -> None:
            rig = TcpRig(tmp_path)
            for _ in range(2):
                events = Watcher(echo=True)
                rig.link.open(events)
                client = await rig.client()
                await client.send(b"hello")
                assert await client.receive() == b"hello"
                rig.link.close()  # our side closes first: the pair of ports stays in TIME_WAIT
                with pytest.raises(ConnectionError):
                    await client.receive()
            rig.close()

        asyncio.run(main())


class TestLengthFraming:
    @pytest.mark.parametrize("name", ["tcp_pubsub", "ced_tcp_fragments"])
    def test_recorded_sessions(self, name: str) -> None:
        packets = json.loads((VECTORS / f"{name}.json").read_text())["packets"]
        for direction in ("c>a", "a>c"):
            framing = LengthFraming()
            mine = [packet for packet in packets if packet["dir"] == direction]
            stream = b"".join(bytes.fromhex(packet["frame_hex"]) for packet in mine)
            expected = [bytes.fromhex(packet["hex"]) for packet in mine]
            assert len(expected) > 1
            assert [message for message, _ in framing.feed_untrusted(stream)] == expected
            assert b"".join(framing.frame(message, 0) for message in expected) == stream
            assert framing.errors() == {"bad-length": 0}

    @given(
        st.lists(st.binary(min_size=1, max_size=300), max_size=5),
        st.binary(max_size=50),
        st.integers(0, 10**9),
    )
    def test_pieces_make_no_difference(self, messages: list[bytes], rest: bytes, seed: int) -> None:
        stream = b"".join(map(tcp_frame, messages)) + rest
        whole, bytewise = LengthFraming(200), LengthFraming(200)
        at_once = whole.feed_untrusted(stream)
        one_by_one = [found for byte in stream for found in bytewise.feed_untrusted(bytes([byte]))]
        assert at_once == one_by_one
        assert whole.errors() == bytewise.errors()
        assert [message for message, _ in at_once][: len(messages)] == [
            m for m in messages if len(m) <= 200
        ] or rest
