"""The agent in company: servers in its own process, silent clients, twins, watchers that fail, many at once."""

import asyncio

import pytest

from muros.agent import Agent, ClientBack, ClientSilent, Event
from muros.links import LinkError, UdpLink
from muros.space import Qos, Service, Topic
from muros.xrce import create
from muros.xrce.constants import DATA, FRAGMENT, KIND_REQUESTER, STREAM_RELIABLE
from tests.agent.raw import BEST_EFFORT, KEEP_ALL, PARTICIPANT, REQUESTER, Raw, submessage
from tests.agent.replay import Bench

ADD = Service("/add", "rq/addRequest", "rr/addReply", "Q", "P")


def codes(bench: Bench) -> dict[str, int]:
    return bench.findings.counts()


def test_a_server_in_the_process_that_answers_at_once_reaches_the_client() -> None:
    bench = Bench()
    client = Raw(bench).service(KIND_REQUESTER)
    replier = bench.space.participant("server").replier(
        ADD, Qos.preset("services_default"), lambda identity, data: replier.reply(identity, data[::-1])
    )
    client.read(REQUESTER)
    client.got()
    asked = [client.write(bytes((n, 2, 3, 4)), REQUESTER) for n in range(5)]
    answers = [got.data for got in client.got() if got.kind == DATA]
    assert answers == [ids + bytes((4, 3, 2, n)) for n, ids in enumerate(asked)]


def test_as_many_requests_wait_for_a_service_as_the_limit_says() -> None:
    bench = Bench(request_history=3)
    client = Raw(bench).service(KIND_REQUESTER)
    for n in range(5):
        client.write(bytes((n,) * 4), REQUESTER)
    got: list[bytes] = []
    bench.space.participant("server").replier(
        ADD, Qos.preset("services_default").replace(depth=10), lambda identity, data: got.append(data)
    )
    bench.advance(bench.now + 20)
    assert got == [bytes((n,) * 4) for n in (2, 3, 4)]


def test_a_client_that_owes_acknowledgements_and_is_silent_is_told_once_and_when_it_is_back() -> None:
    bench = Bench(silent=3000)
    reader = Raw(bench, "reader", 1, acknowledges=False).tree(qos=KEEP_ALL)
    reader.acknowledges = False
    reader.read()
    writer = Raw(bench, "writer", 2).tree(qos=KEEP_ALL)
    writer.write(b"data")
    bench.advance(bench.now + 10_000)
    silent = [event for event in bench.events if isinstance(event, ClientSilent)]
    assert [event.key for event in silent] == [1]
    assert silent[0].text().startswith("client 0x00000001 silent for 3 s")
    assert reader.ping()
    (back,) = [event for event in bench.events if isinstance(event, ClientBack)]
    assert back.away > 9
    assert not back.restarted


def test_two_devices_with_one_key_are_found() -> None:
    bench = Bench()
    twins = [Raw(bench, address, 77) for address in ("here", "there")]
    for _ in range(3):
        for twin in twins:
            assert twin.connect() == 0
            bench.advance(bench.now + 100)
    (finding,) = bench.findings.snapshot()
    assert finding.code == "client-key-in-use-twice"
    assert "a client key of its own" in finding.format()


def test_a_board_that_is_reset_now_and_then_is_no_twin() -> None:
    bench = Bench()
    for n in range(6):
        assert Raw(bench, f"port {n}", 77).connect() == 0
        bench.advance(bench.now + 5000)
    assert not bench.findings.snapshot()


def test_unfinished_samples_of_all_clients_share_one_limit() -> None:
    bench = Bench(max_joining=2000)
    clients = [Raw(bench, n, 100 + n, acknowledges=False) for n in range(5)]
    for client in clients:
        assert client.connect() == 0
        client.send(STREAM_RELIABLE, submessage(FRAGMENT, bytes(480)))
        client.send(STREAM_RELIABLE, submessage(FRAGMENT, bytes(480)))
    assert bench.core.joining <= 2000
    assert codes(bench) == {"too-much-joining": 3}
    for client in clients:
        client.goodbye()
    assert bench.core.joining == 0
    good = Raw(bench, "good", 9).tree()
    good.read()
    good.got()
    good.write(bytes(1200))
    assert good.samples() == [bytes(1200)]


def test_a_topic_without_a_type_meets_any() -> None:
    bench = Bench()
    reader = Raw(bench, "reader", 1).tree(type_name="", qos=BEST_EFFORT)
    reader.read()
    bench.space.participant("here").writer(Topic("rt/chatter", "some::Type"), Qos()).write(b"1234")
    assert reader.samples() == [b"1234"]
    assert not codes(bench)


def test_the_key_of_a_wanderer_does_not_push_out_who_lives_at_an_address() -> None:
    bench = Bench()
    resident = Raw(bench, "home", 1)
    wanderer = Raw(bench, "road", 2, session_id=0x01)
    assert resident.connect() == 0
    assert wanderer.connect() == 0
    wanderer.address = "home"
    assert wanderer.ping()
    assert resident.ping()


def test_a_watcher_that_raises_harms_no_client() -> None:
    agent = Agent("local:")

    def watcher(event: Event) -> None:
        raise RuntimeError("no")

    agent.on_event(watcher)
    bench = Bench()
    bench.core.on_event = agent._tell
    assert Raw(bench).tree().ping()
    assert agent.findings.counts() == {"watcher-failed": 7}
    agent.close()


def test_an_agent_whose_port_was_busy_can_be_started_again() -> None:
    async def program() -> None:
        busy, agent = Agent("local:"), Agent("local:")
        taken = UdpLink(0, "127.0.0.1")
        busy.add_link(taken)
        await busy.start()
        agent.add_link(UdpLink(taken.port, "127.0.0.1"))
        with pytest.raises(LinkError):
            await agent.start()
        busy.close()
        await agent.start()
        assert agent.space.participant("works").writer(Topic("t", "T"), Qos()).write(b"1")
        with pytest.raises(RuntimeError, match="runs already"):
            await agent.start()
        agent.close()
        with pytest.raises(RuntimeError, match="make a new one"):
            await agent.start()

    asyncio.run(program())


def test_an_attempt_whose_session_was_removed_may_connect_again() -> None:
    bench = Bench()
    first = Raw(bench, "place", 1)
    assert first.connect(("muros_id", "00000001")) == 0
    assert Raw(bench, "place", 2).connect() == 0
    assert first.connect(("muros_id", "00000001")) == 0


def test_a_board_in_another_domain_than_the_computer_is_told() -> None:
    """The commonest reason why nothing arrives: the domain is in the board's firmware."""
    bench = Bench(url="local:42")
    Raw(bench).tree()
    (finding,) = bench.findings.snapshot()
    assert (finding.code, finding.subject) == ("other-domain", "0")
    assert "in domain 0, this computer in domain 42" in finding.format()
    assert "ROS_DOMAIN_ID=0" in finding.format()


def test_a_board_that_leaves_the_domain_to_the_agent_gets_the_computers() -> None:
    """Domain 255 asks for none."""
    bench = Bench(url="local:42")
    client = Raw(bench)
    assert client.connect() == 0
    assert client.make(PARTICIPANT, create.of_participant("node", 255)) == 0
    assert [each.domain for each in bench.space.graph.participants] == [42]
    assert bench.findings.snapshot() == ()
