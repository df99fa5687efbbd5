"""The dds engine on real sockets: two spaces meet over the loopback interface, served by one asyncio loop."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager

import pytest

from muros.rtps.net import NetworkSettings
from muros.space import ClosedError, Matched, Qos, Space, SpaceError, Topic, open_space
from tests.dds.domains import free_domain
from tests.space.conformance import ADD, CHATTER, KEEP_ALL, LATCHED, RELIABLE, numbered, take_all


@pytest.fixture
def domain() -> Iterator[int]:
    with free_domain() as number:
        yield number


@asynccontextmanager
async def spaces(domain: int, count: int = 2) -> AsyncIterator[list[Space]]:
    """Spaces of one domain, attached to the running loop."""
    opened = [open_space(f"dds:{domain}", interfaces=("lo",)) for _ in range(count)]
    try:
        for space in opened:
            space.attach(asyncio.get_running_loop())
        yield opened
    finally:
        for space in opened:
            space.close()


async def until(condition: Callable[[], object]) -> None:
    """Wait until it is so."""
    async with asyncio.timeout(20):
        while not condition():
            await asyncio.sleep(0.005)


def test_topics_services_and_nodes(domain: int) -> None:
    async def main() -> None:
        async with spaces(domain) as (one, two):
            talker = one.participant("talker")
            writer = talker.writer(CHATTER, KEEP_ALL)
            latched = talker.writer(Topic("rt/latched", "T"), LATCHED)
            latched.write(b"kept")
            got: list[bytes] = []
            listener = two.participant("listener")
            listener.reader(CHATTER, KEEP_ALL, lambda reader: got.extend(take_all(reader)))
            late = listener.reader(Topic("rt/latched", "T"), LATCHED)
            server = talker.replier(ADD, None, lambda identity, data: server.reply(identity, data + data))
            answers: list[tuple[int, bytes]] = []
            client = listener.requester(ADD, None, lambda number, data: answers.append((number, data)))
            number = client.send(b"early")
            await until(lambda: writer.matched and late.pending and answers)
            assert answers == [(number, b"earlyearly")]
            assert take_all(late) == [b"kept"]
            for i in range(1000):
                while not writer.write(numbered(i)):
                    await asyncio.sleep(0.001)
                if i % 50 == 0:
                    await asyncio.sleep(0)
            await until(lambda: len(got) == 1000)
            assert got == [numbered(i) for i in range(1000)]
            await until(lambda: {node.name for node in two.graph.nodes} == {"talker", "listener"})
            talker.close()
            await until(lambda: {node.name for node in two.graph.nodes} == {"listener"})
            assert client.servers == 0
            assert [f.code for f in (*one.findings.snapshot(), *two.findings.snapshot())] in (
                [],
                ["dds-receive-buffer-small"] * 2,
            )

    asyncio.run(main())


def test_what_was_made_before_is_announced_when_attached(domain: int) -> None:
    async def main() -> None:
        async with spaces(domain, 1) as (one,):
            reader = one.participant("listener").reader(CHATTER, LATCHED)
            with open_space(f"dds:{domain}", interfaces=("lo",)) as two:
                node = two.participant("talker")
                writer = node.writer(CHATTER, LATCHED)
                itself = node.reader(CHATTER, LATCHED)
                writer.write(b"early")
                while (due := two.tick()) is not None and due <= two.clock():
                    pass
                assert take_all(itself) == [b"early"], "without a network too"
                two.attach(asyncio.get_running_loop())
                await until(lambda: reader.pending)
                assert take_all(reader) == [b"early"]

    asyncio.run(main())


def test_several_domains_of_one_space(domain: int) -> None:
    async def main() -> None:
        with free_domain() as other:
            async with spaces(domain) as (one, two):
                away = two.participant("away", domain=other).reader(CHATTER, RELIABLE)
                here = two.participant("here").reader(CHATTER, RELIABLE)
                writer = one.participant("talker", domain=other).writer(CHATTER, RELIABLE)
                await until(lambda: writer.matched)
                writer.write(b"x")
                await until(lambda: away.pending)
                assert here.matched == ()

    asyncio.run(main())


def test_a_port_that_is_not_to_be_had_is_said(domain: int) -> None:
    async def main() -> None:
        loop = asyncio.get_running_loop()
        settings = NetworkSettings(domain, interfaces=("lo",), indices=1)
        with open_space("dds:", network=settings) as one, open_space("dds:", network=settings) as two:
            assert (one.domain, one.url) == (domain, f"dds:{domain}")
            one.attach(loop)
            with pytest.raises(SpaceError, match="in use"):
                two.attach(loop)
            one.close()
            two.attach(loop)
            two.attach(loop)

    asyncio.run(main())


def test_opening(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "17")
    assert open_space("dds:").domain == 17
    assert open_space("dds:3").domain == 3
    monkeypatch.setenv("ROS_DOMAIN_ID", "many")
    with pytest.raises(SpaceError, match="ROS_DOMAIN_ID"):
        open_space("dds:")
    for url in ("dds:x", "dds:-1", "dds: 1"):
        with pytest.raises(SpaceError, match="write dds: or dds:42"):
            open_space(url)
    with pytest.raises(SpaceError):
        open_space("dds:9999")
    with pytest.raises(TypeError, match="no option colour"):
        open_space("dds:1", colour=1)
    with pytest.raises(SpaceError, match="nearest of foxy, galactic, humble"):
        open_space("dds:1", ros_distro="humbel")
    with pytest.raises(SpaceError, match="RANGE"):
        open_space("dds:1", range="FAR")
    with open_space("dds:1") as space:
        with pytest.raises(ValueError, match="domain 300"):
            space.participant("x", domain=300)
        with pytest.raises(ValueError, match="no type"):
            space.participant("x").reader(Topic("rt/x", ""))
    loop = asyncio.new_event_loop()
    loop.close()
    with pytest.raises(ClosedError):
        space.attach(loop)


def test_a_closed_space_leaves_nothing_open(domain: int) -> None:
    """Sockets left open would be a ResourceWarning, which is an error here."""

    async def main() -> None:
        async with spaces(domain) as (one, two):
            one.participant("a").writer(CHATTER, Qos())
            two.participant("b").reader(CHATTER, Qos())
            await asyncio.sleep(0.01)

    asyncio.run(main())


@pytest.mark.parametrize("where", ["another's sample", "own sample", "match", "request"])
def test_a_space_may_be_closed_in_its_callbacks(where: str, domain: int) -> None:
    """Sockets, RTPS and caches are all in the middle of something then."""

    async def main() -> None:
        async with spaces(domain) as (one, two):
            closed = asyncio.Event()

            def close(*_: object) -> None:
                two.close()
                closed.set()

            if where == "another's sample":
                writer = one.participant("talker").writer(CHATTER, RELIABLE)
                two.participant("listener").reader(CHATTER, RELIABLE, close)
                await until(lambda: writer.matched)
                for _ in range(5):
                    writer.write(b"x")
            elif where == "own sample":
                node = two.participant("node")
                node.reader(CHATTER, RELIABLE, close)
                node.writer(CHATTER, RELIABLE).write(b"x")
                await asyncio.sleep(0.01)
                if not two.closed:
                    node.writer(CHATTER, LATCHED).write(b"x")
            elif where == "match":
                two.graph.watch(lambda event: close() if isinstance(event, Matched) else None)
                one.participant("talker").writer(CHATTER, RELIABLE)
                two.participant("listener").reader(CHATTER, RELIABLE)
            else:
                two.participant("server").replier(ADD, None, close)
                one.participant("client").requester(ADD).send(b"?")
            async with asyncio.timeout(20):
                await closed.wait()
            await asyncio.sleep(0.05)
            codes = {f.code for f in (*one.findings.snapshot(), *two.findings.snapshot())}
            assert codes <= {"dds-receive-buffer-small", "request-unanswered"}

    asyncio.run(main())
