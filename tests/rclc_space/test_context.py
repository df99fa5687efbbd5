"""Contexts on spaces: who meets whom, what is refused, what a space reports."""

import re
import threading
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest

from muros.client import Qos
from muros.rclc import Executor, Publisher, RclError
from muros.rclc.host.context import Context
from muros.space import CDR_BE, Durability, History, Reliability, Space, Topic, open_space
from muros.space import Qos as SpaceQos
from muros.space.rclc import ENCODING, NETWORK, NOT_SPUN, OTHER, PROBLEMS, SpaceMiddleware
from tests.rclc_space.ways import PATIENCE

from example_interfaces.srv import AddTwoInts
from std_msgs.msg import Int32, String

if TYPE_CHECKING:
    from muros.rclc._types import Middleware

INT32 = "std_msgs::msg::dds_::Int32_"
NAME: Any = "local:"
KEEP_ALL = Qos(keep_all=True)


@pytest.fixture
def space(url: str) -> Iterator[Space]:
    """A space of the test's own."""
    with open_space(url, request_wait=1, resource_limit=10) as made:
        yield made


def listen(context: Context, topic: str = "value", qos: str | Qos = "default") -> list[int]:
    """What comes on a topic."""
    got: list[int] = []
    context.node("listener").subscription(Int32, topic, lambda message: got.append(message.data), qos)
    return got


def say(context: Context, value: int) -> None:
    """Publishes a number."""
    context.node("talker").publisher(Int32, "value").publish(Int32(data=value))


def test_contexts_of_one_url_meet_within_a_domain() -> None:
    contexts = [
        Context("local:"), Context("local:7"), Context("local:", domain_id=7), Context(space="local:0")
    ]  # fmt: skip
    got = [listen(context) for context in contexts]
    assert [context.domain_id for context in contexts] == [0, 7, 7, 0]
    for i, context in enumerate(contexts):
        say(context, i)
    for context in contexts:
        for _ in range(3):
            Executor(context).spin_some()
    assert got == [[0, 3], [1, 2], [1, 2], [0, 3]]
    for context in contexts:
        context.close()


def test_the_last_context_closes_the_space_of_a_url() -> None:
    one, other = Context("local:"), Context("local:")
    space: Any = one.middleware
    space = space.ground.space
    one.close()
    one.close()
    assert not space.closed
    other.close()
    assert space.closed
    third = Context("local:")
    middleware: Any = third.middleware
    assert middleware.ground.space is not space
    third.close()


def test_a_space_that_is_given_stays_open(space: Space) -> None:
    one, other = Context(space), Context(space=space)
    got = listen(other)
    raw: list[bytes] = []

    def take(reader: Any) -> None:
        raw.append(reader.take().data)

    space.participant("raw").reader(Topic("rt/value", INT32), on_data=take)
    say(one, 5)
    Executor(other).spin_some()
    assert (got, raw) == ([5], [b"\5\0\0\0"])
    one.close()
    assert [node.name for node in space.graph.nodes] == ["listener", "raw"]
    other.close()
    assert [node.name for node in space.graph.nodes] == ["raw"]
    assert not space.closed


def test_contexts_may_come_again_to_a_space_that_is_given(space: Space) -> None:
    Context(space).close()
    again = Context(space, domain_id=3)
    again.node("again", "lab")
    assert (space.graph.nodes[-1].full_name, space.graph.nodes[-1].domain) == ("/lab/again", 3)
    again.close()


REFUSED: list[tuple[Callable[[], object], type[Exception], str]] = [
    (lambda: Context("nothing:"), ValueError, "'nothing:' names no data space engine (known: local:"),
    (lambda: Context("local"), ValueError, "Through an agent: Context(Udp('127.0.0.1', 8888))"),
    (lambda: Context("local:x"), ValueError, "local:x: 'x' is no domain number"),
    (lambda: Context("local:3", domain_id=4), ValueError, "'local:3' with domain_id=4: name the domain once"),
    (lambda: Context("local:999"), ValueError, "'local:999': a domain is from 0 to 232"),
    (lambda: Context("local:", 5), TypeError, "client_key belongs to the session"),
    (lambda: Context(NAME, space=NAME), TypeError, "Context takes a transport or a space, not both"),
    (lambda: Context(), TypeError, "Context needs a transport"),
]


@pytest.mark.parametrize(("use", "kind", "said"), REFUSED, ids=[case[2] for case in REFUSED])
def test_what_is_no_way(use: Callable[[], object], kind: type[Exception], said: str) -> None:
    with pytest.raises(kind, match=re.escape(said)) as caught:
        use()
    assert getattr(caught.value, "code", None) == 11
    assert "\n" not in str(caught.value)


def test_closed_spaces_and_contexts(space: Space) -> None:
    context = Context(space)
    node = context.node("node")
    publisher = node.publisher(Int32, "value")
    client = node.client(AddTwoInts, "add")
    problems: list[tuple[int, str]] = []
    context.on_problem(lambda code, text: problems.append((code, text)))
    context.close()
    assert not publisher.publish(Int32())
    assert not client.send(AddTwoInts.Request(), print)
    assert [code for code, _ in problems] == [7, 7]
    assert problems[0][1] == "4 B of rt/value dropped: the context is closed."
    assert not context.ping()
    assert client.call(AddTwoInts.Request(), timeout=0.05) is None
    assert not Executor(context).spin_some(30.0), "it does not wait for what cannot come"
    for use in (lambda: context.node("late"), lambda: node.publisher(Int32, "late")):
        with pytest.raises(RclError, match="the context is closed; make a new one"):
            use()
    space.close()
    with pytest.raises(RclError, match="the space is closed"):
        Context(space)


def test_a_node_that_was_destroyed_makes_nothing(space: Space) -> None:
    context = Context(space)
    node = context.node("node", "lab")
    node.destroy()
    with pytest.raises(RclError, match="node /lab/node was destroyed; make a new one"):
        node.subscription(Int32, "value", None)
    assert not context.handles
    context.close()


def test_names_may_be_as_long_as_ros_takes_them(space: Space) -> None:
    context = Context(space)
    node = context.node("n" * 200)
    node.publisher(Int32, "x" * 250)
    node.client(AddTwoInts, "y" * 200)
    assert max(len(topic.name) for topic in space.graph.topics) == 253
    for use in (
        lambda: node.publisher(Int32, "x" * 253),
        lambda: node.service(AddTwoInts, "x" * 253, print),
        lambda: context.node("n" * 256),
    ):
        with pytest.raises(ValueError, match=r"is too long: 2\d\d characters as .*, at most 255"):
            use()
    context.close()


def test_quality_of_service_in_the_graph(space: Space) -> None:
    context = Context(space)
    node = context.node("node")
    node.publisher(Int32, "a", Qos(False, 3, "transient_local", deadline=20, lifespan=30))
    node.publisher(Int32, "b", Qos(keep_all=True, durability="volatile"))
    node.subscription(Int32, "c", None, "sensor_data")
    node.subscription(Int32, "d", None, Qos(depth=0))
    said = {end.topic: end.qos for end in (*space.graph.writers, *space.graph.readers)}
    assert said["rt/a"] == SpaceQos(
        Reliability.BEST_EFFORT, Durability.TRANSIENT_LOCAL, depth=3, deadline=20_000_000, lifespan=30_000_000
    )
    assert said["rt/b"].history == History.KEEP_ALL
    assert (said["rt/b"].reliability, said["rt/b"].durability) == (Reliability.RELIABLE, Durability.VOLATILE)
    assert said["rt/c"] == SpaceQos.preset("sensor_data")
    assert said["rt/d"].depth == 1
    with pytest.raises(ValueError, match="no QoS profile 'nonsense'"):
        node.publisher(Int32, "e", "nonsense")
    context.close()


def test_types_and_services_in_the_graph(space: Space) -> None:
    context = Context(space)
    node = context.node("node", "lab")
    node.publisher(Int32, "a")
    node.service(AddTwoInts, "add", print)
    node.client(AddTwoInts, "/other")
    assert {(end.topic, end.type_name) for end in space.graph.writers} == {
        ("rt/lab/a", INT32),
        ("rr/lab/addReply", "example_interfaces::srv::dds_::AddTwoInts_Response_"),
        ("rq/otherRequest", "example_interfaces::srv::dds_::AddTwoInts_Request_"),
    }
    assert {service.name for service in space.graph.services} == {"/lab/add", "/other"}
    context.close()


def test_what_the_space_reports_is_a_problem_of_whom_it_is_about(
    space: Space, capsys: pytest.CaptureFixture[str]
) -> None:
    talker, listener, other = Context(space), Context(space), Context(space)
    talker.node("talker").publisher(Int32, "value", "sensor_data")
    problems: list[tuple[int, str]] = []
    listener.on_problem(lambda code, text: problems.append((code, text)))
    listener.node("listener").subscription(Int32, "value", None)
    said = (
        "/listener gets no rt/value from /talker: the reader wants reliable, the writer offers best effort. "
        "Make the reader best effort, or the writer reliable."
    )
    assert problems == [], "not from inside the space"
    for context in (talker, listener, other):
        Executor(context).spin_some()
    assert problems == [(PROBLEMS["qos-mismatch"], said)]
    assert capsys.readouterr().err == ""
    other.node("other").subscription(Int32, "value", None)
    other.close()
    assert capsys.readouterr().err == f"muros: {said}\n".replace("/listener", "/other")
    talker.close()
    listener.close()


def test_what_is_about_nobody_is_told_to_those_who_listen_and_printed_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    contexts = [Context("local:") for _ in range(4)]
    problems: list[tuple[int, str]] = []
    for context in contexts[:2]:
        context.on_problem(lambda code, text: problems.append((code, text)))
    middleware: SpaceMiddleware = contexts[0].middleware  # type: ignore[assignment]
    protocol: Middleware = middleware  # for the type checker
    space = middleware.ground.space
    space.findings.report("dds-no-multicast", who="the network", what="it is deaf", remedy="Mend it", now=1.0)
    space.findings.report("new-code", who="the network", what="it is mute", now=1.0)
    for context in contexts:
        Executor(context).spin_some()
    said = [(NETWORK, "the network: it is deaf. Mend it."), (OTHER, "the network: it is mute.")]
    assert problems == said * 2
    assert capsys.readouterr().err == "".join(f"muros: {text}\n" for _, text in said)
    for context in contexts:
        context.close()
    assert protocol.state == 0


def test_codes_are_told_apart() -> None:
    codes = [ENCODING, NETWORK, NOT_SPUN, OTHER, *PROBLEMS.values()]
    assert len(set(codes)) == len(codes)
    assert min(codes) > 12, "of sessions and of rclc"


def test_a_problem_does_not_wait_for_the_end_of_a_pass(space: Space) -> None:
    context = Context(space)
    problems: list[int] = []
    context.on_problem(lambda code, text: problems.append(code))
    node = context.node("node")
    node.publisher(Int32, "value", "sensor_data")
    timer = node.timer(0.0, lambda: (timer.cancel(), node.subscription(Int32, "value", None)))  # type: ignore[func-returns-value]
    executor = Executor(context)
    executor.spin_some()
    assert not executor.spin_some(0.0)
    assert problems == [PROBLEMS["qos-mismatch"]]
    context.close()


def test_a_request_that_no_server_came_for_is_told(space: Space) -> None:
    context = Context(space)
    problems: list[tuple[int, str]] = []
    context.on_problem(lambda code, text: problems.append((code, text)))
    client = context.node("asker").client(AddTwoInts, "add")
    assert client.call(AddTwoInts.Request(), timeout=0.1) is None
    assert [code for code, _ in problems] == [PROBLEMS["no-server"]]
    assert problems[0][1].startswith(
        "1 request of /asker to /add given up: no server for /add within 1 ns. Start"
    )
    context.close()


def test_what_tellers_raise_comes_out_of_spinning(space: Space) -> None:
    context = Context(space)

    def fail(*_: object) -> None:
        raise RuntimeError("on purpose")

    context.on_state(fail)
    node = context.node("node")
    with pytest.raises(RuntimeError, match="on purpose"):
        Executor(context).spin_some()
    assert context.state == "CONNECTED"
    context.on_problem(fail)
    node.publisher(Int32, "value", "sensor_data")
    node.subscription(Int32, "value", None)
    with pytest.raises(RuntimeError, match="on purpose"):
        Executor(context).spin_some()
    Executor(context).spin_some()
    with pytest.raises(RuntimeError, match="on purpose"):
        context.close()
    assert not space.graph.nodes


def test_what_is_only_worth_knowing_is_not_printed(space: Space, capsys: pytest.CaptureFixture[str]) -> None:
    context = Context(space)
    got = listen(context, qos="sensor_data")
    publisher = context.node("talker").publisher(Int32, "value", "sensor_data")
    for i in range(8):
        publisher.publish(Int32(data=i))
    Executor(context).spin_some()
    assert capsys.readouterr().err == ""
    while Executor(context).spin_some():
        pass
    assert got == [3, 4, 5, 6, 7]
    context.close()


def fill(talker: Context) -> tuple[Publisher, int]:
    """A publisher for which there is no room any more, and how many were taken: 0, 1, 2 and so on."""
    publisher = talker.node("talker").publisher(Int32, "value", KEEP_ALL)
    taken = 0
    while publisher.publish(Int32(data=taken)):  # what the reader and, where there is one, the wire hold
        taken += 1
        assert taken < 100
    return publisher, taken


def test_a_full_reader_that_keeps_all_refuses(space: Space) -> None:
    talker, listener = Context(space), Context(space)
    got = listen(listener, qos=KEEP_ALL)
    problems: list[tuple[int, str]] = []
    talker.on_problem(lambda code, text: problems.append((code, text)))
    publisher, taken = fill(talker)
    for _ in range(3):
        publisher.publish(Int32(data=taken))
    assert [code for code, _ in problems] == [8, 8, 8], "the first, the second, the fourth..."
    assert problems[0][1].startswith("4 B of rt/value dropped: a reliable reader that keeps all is full.")
    end = time.monotonic() + PATIENCE
    while len(got) < taken and time.monotonic() < end:
        Executor(listener).spin_some(0.05)
    assert got == list(range(taken))
    assert publisher.publish(Int32(data=taken), timeout=PATIENCE)
    talker.close()
    listener.close()


def test_who_publishes_may_wait_for_room(space: Space) -> None:
    talker, listener = Context(space), Context(space)
    got = listen(listener, qos=KEEP_ALL)
    problems: list[tuple[int, str]] = []
    talker.on_problem(lambda code, text: problems.append((code, text)))
    publisher, taken = fill(talker)
    assert not publisher.publish(Int32(data=-1), timeout=0.05)
    assert len(problems) == 2, "both that were not taken are told, once"
    spinning = threading.Thread(target=Executor(listener).spin, daemon=True)
    spinning.start()
    assert publisher.publish(Int32(data=taken), timeout=PATIENCE)
    end = time.monotonic() + PATIENCE
    while len(got) < taken and time.monotonic() < end:
        time.sleep(0.001)
    listener.close()
    spinning.join(PATIENCE)
    assert got[:taken] == list(range(taken))
    talker.close()


def test_publishing_without_spinning_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    context = Context("local:")
    problems: list[tuple[int, str]] = []
    context.on_problem(lambda code, text: problems.append((code, text)))
    publisher = context.node("node").publisher(Int32, "value")
    assert publisher.publish(Int32())
    assert problems == []
    monkeypatch.setattr("muros.space.rclc._middleware.NOT_SPUN_AFTER", -1.0)
    assert publisher.publish(Int32())
    assert publisher.publish(Int32())
    assert [code for code, _ in problems] == [NOT_SPUN]
    assert problems[0][1].startswith("rt/value is published, but nobody spins this context")
    context.close()


def test_foreign_representations(space: Space) -> None:
    context = Context(space)
    got: list[str] = []
    context.node("listener").subscription(String, "text", lambda message: got.append(message.data))
    writer = space.participant("foreign").writer(
        Topic("rt/text", "std_msgs::msg::dds_::String_"), SpaceQos(depth=9)
    )
    problems: list[tuple[int, str]] = []
    context.on_problem(lambda code, text: problems.append((code, text)))
    writer.write(String(data="big").serialize(big_endian=True), representation=CDR_BE)
    writer.write(String(data="new").serialize(), representation=0x0007)
    writer.write(b"\xff\xff\xff\xff", representation=CDR_BE)
    writer.write(String(data="little").serialize())
    for _ in range(4):
        Executor(context).spin_some()
    assert got == ["big", "little"]
    assert [code for code, _ in problems] == [ENCODING, ENCODING]
    assert "its representation 0x0007 is not read here, only classic CDR" in problems[0][1]
    context.close()


def test_services_of_a_bigendian_client(space: Space) -> None:
    context = Context(space)
    context.node("server").service(
        AddTwoInts, "add", lambda request: AddTwoInts.Response(sum=request.a + request.b)
    )
    service = space.graph.services[0]
    assert service.name == "/add"
    from muros.space import Service

    replies: list[bytes] = []
    client = space.participant("foreign").requester(
        Service(
            "/add",
            "rq/addRequest",
            "rr/addReply",
            "example_interfaces::srv::dds_::AddTwoInts_Request_",
            "example_interfaces::srv::dds_::AddTwoInts_Response_",
        ),
        on_reply=lambda number, data: replies.append(data),
    )
    client.send(AddTwoInts.Request(a=1, b=2).serialize(big_endian=True), representation=CDR_BE)
    Executor(context).spin_some()
    assert [AddTwoInts.Response.deserialize(data).sum for data in replies] == [3]
    context.close()
