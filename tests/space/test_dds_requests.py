"""Requests of the dds engine whose server goes before it has answered: none is lost without a word."""

from muros.space import Replier, Requester
from tests.space.conformance import ADD
from tests.space.dds_world import SECOND, Computer, Net

UNANSWERED = (
    "1 request of /client to /add_two_ints will not be answered: the server they were given to has gone"
)


def silent(computer: Computer) -> Replier:
    """A server that takes requests and answers when the test does."""
    return computer.space.participant("server").replier(ADD, on_data=lambda _: None)


def client_of(computer: Computer, got: list[int]) -> Requester:
    return computer.space.participant("client").requester(ADD, None, lambda number, _: got.append(number))


def test_a_request_to_a_server_that_died_is_told_of_when_that_is_noticed() -> None:
    net = Net()
    one, two, three = net.computer(), net.computer(), net.computer()
    silent(one)
    got: list[int] = []
    client = client_of(two, got)
    net.until(lambda: client.servers == 1)
    one.vanish()
    assert client.send(b"?") == 1
    server = silent(three)  # comes too late for what was sent to the other alone
    net.until(lambda: client.servers == 2)
    assert client.send(b"!") == 2
    net.until(lambda: server.pending)
    request = server.take()
    assert request is not None
    assert server.reply(request.identity, b"yes")
    net.until(lambda: got)
    net.until(lambda: client.servers == 1)
    net.run(SECOND)
    assert got == [2]
    assert two.codes == ["several-servers", "request-unanswered"]
    assert two.told[-1].format().startswith(f"finding: {UNANSWERED}")


def test_a_request_that_another_server_has_is_not_given_up() -> None:
    net = Net()
    one, two = net.computer(), net.computer()
    servers = [silent(one), silent(two)]
    got: list[int] = []
    client = client_of(two, got)
    net.until(lambda: client.servers == 2)
    client.send(b"?")
    net.until(lambda: all(server.pending for server in servers))
    servers[0].close()
    net.until(lambda: client.servers == 1)
    assert "request-unanswered" not in two.codes
    servers[1].close()
    net.until(lambda: client.servers == 0)
    assert two.codes[-1] == "request-unanswered"


def test_a_server_that_has_answered_may_go() -> None:
    net = Net()
    one, two = net.computer(), net.computer()
    here, there = silent(two), silent(one)
    got: list[int] = []
    client = client_of(two, got)
    net.until(lambda: client.servers == 2)
    client.send(b"?")
    for server in (here, there):
        net.until(lambda server=server: server.pending)  # type: ignore[misc]
        request = server.take()
        assert request is not None
        server.reply(request.identity, b"yes")
    net.until(lambda: got == [1, 1])
    here.close()
    there.close()
    net.until(lambda: client.servers == 0)
    assert "request-unanswered" not in two.codes
