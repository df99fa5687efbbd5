"""The parts of the ROS 1 client that need no graph: headers and blocks, names, parameters, XML-RPC."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.ros1 import (
    ApiError,
    ApiServer,
    Blocks,
    ParameterTree,
    Ros1Error,
    UnreachableError,
    WireError,
    block,
    call,
    header,
    header_untrusted,
    master_uri,
    own_host,
    resolve,
)

FIELDS = st.dictionaries(st.text(st.characters(exclude_characters="=", codec="utf-8")), st.text())


@given(FIELDS)
def test_headers_come_back(fields: dict[str, str]) -> None:
    raw = header(fields)
    blocks = Blocks()
    blocks.feed_untrusted(raw)
    body = blocks.next_untrusted()
    assert body is not None
    assert header_untrusted(body) == fields


@given(st.binary(max_size=100))
def test_foreign_headers_raise_one_exception(raw: bytes) -> None:
    try:
        fields = header_untrusted(raw)
    except WireError:
        return
    assert all(isinstance(value, str) for value in fields.values())


@given(st.lists(st.binary(max_size=20), max_size=6), st.integers(1, 9), st.sampled_from([0, 1]))
def test_blocks_whole_or_piece_by_piece(bodies: list[bytes], step: int, lead: int) -> None:
    stream = b"".join(b"\x01" * lead + block(body) for body in bodies)
    blocks = Blocks(lead=lead)
    found: list[bytes] = []
    for at in range(0, len(stream), step):
        blocks.feed_untrusted(stream[at : at + step])
        while (body := blocks.next_untrusted()) is not None:
            found.append(body)
    assert found == [b"\x01" * lead + body for body in bodies]


def test_blocks_have_a_limit() -> None:
    blocks = Blocks(limit=10)
    blocks.feed_untrusted(block(bytes(10)))
    assert blocks.next_untrusted() == bytes(10)
    with pytest.raises(WireError, match="11 bytes is announced"):
        blocks.feed_untrusted(block(bytes(11)))
    mixed = Blocks(limit=10)
    mixed.feed_untrusted(block(b"") + block(bytes(11)))
    assert mixed.next_untrusted() == b""
    with pytest.raises(WireError, match="more than 10"):
        mixed.next_untrusted()


@pytest.mark.parametrize(
    ("name", "full"),
    [
        ("chatter", "/ns/chatter"),
        ("a/b", "/ns/a/b"),
        ("/chatter", "/chatter"),
        ("~gain", "/ns/board/gain"),
        ("~/gain", "/ns/board/gain"),
        ("//a//b/", "/a/b"),
        ("old", "/new"),
    ],
)
def test_names(name: str, full: str) -> None:
    assert resolve(name, "/ns/board", {"old": "/new"}) == full


@pytest.mark.parametrize("name", ["", "1st", "a-b", "a b", "ä"])
def test_bad_names(name: str) -> None:
    with pytest.raises(Ros1Error, match="no name in ROS 1"):
        resolve(name, "/board")


def test_environment() -> None:
    assert master_uri({}) == "http://localhost:11311"
    assert master_uri({"ROS_MASTER_URI": "http://robot:1"}) == "http://robot:1"
    assert own_host("http://127.0.0.1:11311", {}) == "127.0.0.1"
    assert own_host("http://127.0.0.1:11311", {"ROS_IP": "10.0.0.1"}) == "10.0.0.1"
    assert own_host("http://127.0.0.1:11311", {"ROS_IP": "10.0.0.1", "ROS_HOSTNAME": "robot"}) == "robot"
    assert own_host("nonsense", {}) == "127.0.0.1"


def test_parameters() -> None:
    tree = ParameterTree({"a": {"b": 1}, "l": [1, 2]})
    assert (tree.get("/a/b"), tree.get("/a"), tree.get("/l"), tree.get("/x/y")) == (1, {"b": 1}, [1, 2], None)
    tree.update("/a/c/", 2.5)
    tree.update("/new/deep/", {"x": True})
    assert (tree.get("/a/c"), tree.get("/new/deep/x")) == (2.5, True)
    tree.update("/a/b/", {})
    tree.update("/l/inner/", "text")
    assert (tree.get("/a/b"), tree.get("/l/inner")) == (None, "text")
    tree.update("/", {"z": 0})
    assert (tree.get("/z"), tree.get("/a")) == (0, None)
    assert ParameterTree([]).get("/a") is None


def add(caller: str, one: int, other: int) -> int:
    """A method of a test's node."""
    if one > 100:
        raise Ros1Error("too much")
    return one + other


async def with_server(test: Any) -> None:
    server = ApiServer({"add": add})
    await server.open("127.0.0.1")
    try:
        await test(f"http://127.0.0.1:{server.port}/")
    finally:
        await server.close()


def test_calls() -> None:
    async def test(uri: str) -> None:
        assert await call(uri, "add", "/me", 2, 3) == 5
        with pytest.raises(ApiError, match="too much"):
            await call(uri, "add", "/me", 101, 3)
        with pytest.raises(ApiError, match="missing 1 required"):
            await call(uri, "add", "/me", 1)
        with pytest.raises(ApiError, match="no method 'subtract'"):
            await call(uri, "subtract")
        with pytest.raises(ApiError, match="int exceeds"):
            await call(uri, "add", "/me", 1 << 40, 3)

    asyncio.run(with_server(test))


@pytest.mark.parametrize("uri", ["", "robot", "http://", "http://host:port"])
def test_addresses_that_are_none(uri: str) -> None:
    with pytest.raises(ApiError, match="is no address"):
        asyncio.run(call(uri, "getPid"))


def test_nobody_there() -> None:
    async def test(uri: str) -> None:
        pass

    async def main() -> None:
        server = ApiServer({})
        await server.open("127.0.0.1")
        await server.close()
        with pytest.raises(UnreachableError, match="cannot be reached"):
            await call(f"http://127.0.0.1:{server.port}", "getPid")

    asyncio.run(main())


@pytest.mark.parametrize(
    "answer",
    [
        b"",
        b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\nhello",
        b"HTTP/1.1 200 OK\r\n\r\n<methodResponse></methodResponse>",
        b"HTTP/1.1 200 OK\r\nContent-Length: 99999999999\r\n\r\n",
        b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
        b"x" * 100_000,
        b"HTTP/1.1 200 OK\r\n\r\n<?xml version='1.0'?><methodResponse><params><param><value><int>3</int></value>"
        b"</param></params></methodResponse>",
    ],
    ids=range(8),
)
def test_answers_that_are_none(answer: bytes) -> None:
    async def main() -> None:
        async def on_call(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            await reader.readuntil(b"</methodCall>")
            writer.write(answer)
            writer.close()

        server = await asyncio.start_server(on_call, "127.0.0.1", 0)
        uri = f"http://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        with pytest.raises((ApiError, UnreachableError)):
            await call(uri, "getPid", timeout=5)
        server.close()
        await server.wait_closed()

    asyncio.run(main())


def test_requests_that_would_grow_without_end() -> None:
    """Entities within entities: each line ten times the one before."""
    lines = [f'<!ENTITY e{n} "{f"&e{n - 1};" * 10}">' for n in range(1, 12)]
    entities = f'<!ENTITY e0 "0123456789">{"".join(lines)}'
    bomb = f'<?xml version="1.0"?><!DOCTYPE m [{entities}]><methodCall>&e11;</methodCall>'

    async def test(uri: str) -> None:
        host, _, port = uri.removeprefix("http://").rstrip("/").partition(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        writer.write(f"POST / HTTP/1.0\r\nContent-Length: {len(bomb)}\r\n\r\n{bomb}".encode())
        assert b"fault" in await reader.read()
        writer.close()
        await writer.wait_closed()
        assert await call(uri, "add", "/me", 2, 3) == 5

    asyncio.run(with_server(test))


@given(st.binary(max_size=80))
def test_requests_that_are_none(raw: bytes) -> None:
    async def test(uri: str) -> None:
        host, _, port = uri.removeprefix("http://").rstrip("/").partition(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        writer.write(b"POST / HTTP/1.0\r\nContent-Length: %d\r\n\r\n" % len(raw) + raw)
        assert b"fault" in await reader.read()
        writer.close()
        await writer.wait_closed()

    asyncio.run(with_server(test))
