"""Services between muros and ROS 2, both ways and in both dialects at once.

rmw_fastrtps carries a request's identity beside the payload, rmw_cyclonedds within it. A server of muros answers
both kinds of client at the same time, a client of muros asks both kinds of server.
"""

import struct
from collections.abc import Callable

import pytest

from muros.space import Replier, Requester, Service
from tests.dds.bodies import basic, basic_value, string
from tests.dds.domains import Domain
from tests.dds.peers import Peer
from tests.dds.rig import BASIC_TYPES, Rig

ROS = ("jazzy", "kilted")
ALL = (*ROS, "cyclone")
Fetch = Callable[[str], Peer]

TYPE = "test_msgs/srv/BasicTypes"
SUM = "{'int64_value': request.int64_value + request.int32_value}"


def adder(rig: Rig, domain: int) -> Replier:
    """A server of ours that adds up the two numbers of a request."""
    server: list[Replier] = []

    def answer(identity: bytes, data: bytes) -> None:
        assert server[0].reply(identity, basic(0, sum(basic_value(data))))

    server.append(rig.space(domain).participant("adder").replier(BASIC_TYPES, on_request=answer))
    return server[0]


@pytest.mark.parametrize("name", ALL)
def test_they_ask_we_answer(name: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    other = peer(name)
    node = other.do("node", name="client", domain=domain)
    server = adder(rig, domain)
    client = rig.ask(other, "client", node=node, name="/sum", type=TYPE)
    answers = rig.ask(
        other, "call", client=client, request={"int32_value": 1000}, number="int64_value", count=100
    )
    assert [answer and answer["int64_value"] for answer in answers] == [1000 + n for n in range(100)]
    assert server.clients == 1
    assert rig.told == []


def test_one_server_speaks_all_dialects_at_the_same_time(peer: Fetch, rig: Rig, domain: Domain) -> None:
    clients = {}
    for name in ALL:
        node = peer(name).do("node", name=f"client_of_{name}", domain=domain)
        clients[name] = peer(name).do("client", node=node, name="/sum", type=TYPE)
    server = adder(rig, domain)
    rig.until(lambda: server.clients == len(ALL))
    for i, name in enumerate(ALL):
        request = {"int32_value": 1000 * i}
        peer(name).begin("call", client=clients[name], request=request, number="int64_value", count=100)
    for i, name in enumerate(ALL):
        answers = rig.answer(peer(name))
        assert [answer and answer["int64_value"] for answer in answers] == [1000 * i + n for n in range(100)]
    assert rig.told == []


@pytest.mark.parametrize("name", ALL)
def test_we_ask_they_answer(name: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    other = peer(name)
    node = other.do("node", name="server", domain=domain)
    answers: dict[int, int] = {}
    requester = (
        rig.space(domain)
        .participant("client")
        .requester(BASIC_TYPES, on_reply=lambda number, data: answers.update({number: basic_value(data)[1]}))
    )
    first = requester.send(basic(40, 2))
    assert requester.waiting == 1, "for a server"
    service = rig.ask(other, "service", node=node, name="/sum", type=TYPE, rule=SUM)
    if name == "cyclone":
        other.begin("serve", service=service, count=101)
    rig.until(lambda: answers == {first: 42}, "the reply to the request that waited")
    assert requester.servers == 1
    numbers = []
    for n in range(100):
        rig.until(lambda: len(answers) > n - 5, "replies")  # noqa: B023
        numbers.append(requester.send(basic(1000, n)))
    rig.until(lambda: len(answers) == 101, "100 replies")
    assert [answers[number] for number in numbers] == [1000 + n for n in range(100)]
    if name == "cyclone":
        assert rig.answer(other) == 101
    assert rig.told == []


def test_one_client_asks_servers_of_all_dialects(peer: Fetch, rig: Rig, domain: Domain) -> None:
    """Several servers of one service is bad manners, but each gets a request it can read, and nobody is confused."""
    services = {}
    for i, name in enumerate(ALL):
        node = peer(name).do("node", name=f"server_of_{name}", domain=domain)
        rule = f"{{'int64_value': request.int64_value, 'int32_value': {i}}}"
        services[name] = peer(name).do("service", node=node, name="/sum", type=TYPE, rule=rule)
    peer("cyclone").begin("serve", service=services["cyclone"], count=10)
    replies: list[tuple[int, tuple[int, int]]] = []
    requester = (
        rig.space(domain)
        .participant("client")
        .requester(BASIC_TYPES, on_reply=lambda number, data: replies.append((number, basic_value(data))))
    )
    rig.until(lambda: requester.servers == 3)
    rig.run(0.2)
    asked = {requester.send(basic(0, n)): n for n in range(10)}
    rig.until(lambda: len(replies) >= 30, "each server's reply to each request")
    assert sorted((asked[number], server) for number, (server, _) in replies) == sorted(
        (n, server) for n in range(10) for server in range(3)
    )
    assert all(asked[number] == echoed for number, (_, echoed) in replies)
    assert rig.answer(peer("cyclone")) == 10


def test_no_server_is_told(rig: Rig, domain: Domain) -> None:
    requester = rig.space(domain, request_wait=200_000_000).participant("client").requester(BASIC_TYPES)
    assert requester.send(basic(), wait=False) == 0
    rig.until(lambda: [finding.code for finding in rig.told] == ["no-server"])
    requester.send(basic())
    rig.until(lambda: requester.waiting == 0, "the request to be given up")
    assert rig.spaces[0].findings.counts() == {"no-server": 2}


@pytest.mark.parametrize("distro", ROS)
def test_parameters_of_a_ros_node_are_read_and_set(
    distro: str, peer: Fetch, rig: Rig, domain: Domain
) -> None:
    peer(distro).do("node", name="robot", domain=domain, parameters={"speed": 3})
    node = rig.space(domain).participant("asker")
    replies: dict[int, bytes] = {}

    def client(name: str, kind: str) -> Requester:
        service = Service(
            f"/robot/{name}",
            f"rq/robot/{name}Request",
            f"rr/robot/{name}Reply",
            f"rcl_interfaces::srv::dds_::{kind}_Request_",
            f"rcl_interfaces::srv::dds_::{kind}_Response_",
        )
        return node.requester(service, on_reply=lambda number, data: replies.update({number: data}))

    names = struct.pack("<I", 1) + string("speed")
    getter, setter = client("get_parameters", "GetParameters"), client("set_parameters", "SetParameters")
    number = getter.send(names)
    rig.until(lambda: number in replies)
    assert struct.unpack_from("<IBxxxq", replies.pop(number)) == (1, 2, 3), "one value, an integer, 3"
    body = bytearray(names)
    body += b"\2\0" + bytes(-(len(body) + 2) % 8) + struct.pack("<qd", 7, 0.0)
    body += string("") + bytes(3) + struct.pack("<IIIII", 0, 0, 0, 0, 0)
    number = setter.send(bytes(body))
    rig.until(lambda: number in replies)
    size, successful = struct.unpack_from("<I?", replies.pop(number))
    assert (size, successful) == (1, True)
    number = getter.send(names)
    rig.until(lambda: number in replies)
    assert struct.unpack_from("<q", replies.pop(number), 8) == (7,)


@pytest.mark.parametrize("distro", ROS)
def test_ros_reads_the_parameters_of_a_node_of_ours(
    distro: str, peer: Fetch, rig: Rig, domain: Domain
) -> None:
    ros = peer(distro)
    asker = ros.do("node", name="asker", domain=domain)
    node = rig.space(domain).participant("board")
    service = Service(
        "/board/get_parameters",
        "rq/board/get_parametersRequest",
        "rr/board/get_parametersReply",
        "rcl_interfaces::srv::dds_::GetParameters_Request_",
        "rcl_interfaces::srv::dds_::GetParameters_Response_",
    )
    wanted: list[bytes] = []

    def answer(identity: bytes, data: bytes) -> None:
        wanted.append(data)
        body = (
            struct.pack("<IBBxxqd", 1, 2, 0, 5, 0.0)
            + string("")
            + bytes(3)
            + struct.pack("<IIIII", 0, 0, 0, 0, 0)
        )
        server.reply(identity, body)

    server = node.replier(service, on_request=answer)
    client = rig.ask(
        ros, "client", node=asker, name="/board/get_parameters", type="rcl_interfaces/srv/GetParameters"
    )
    (reply,) = rig.ask(ros, "call", client=client, request={"names": ["speed"]})
    assert reply["values"][0]["integer_value"] == 5
    assert [data[:14] for data in wanted] == [struct.pack("<I", 1) + string("speed")]
