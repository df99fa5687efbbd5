"""What a board and the graph see of the server, in virtual time."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from muros import interfaces
from muros.rosserial.constants import (
    ID_PARAMETER_REQUEST,
    ID_PUBLISHER,
    ID_SERVICE_SERVER,
    ID_TIME,
    ID_TX_STOP,
    VERSION_GROOVY,
    VERSION_HYDRO,
)
from muros.rosserial.packets import frame
from muros.rosserial.server import (
    BoardBack,
    BoardGone,
    BoardLog,
    BoardLost,
    BoardReady,
    BoardReset,
    EndpointSetUp,
)
from muros.rosserial.server._endpoints import ServiceServer
from muros.space import Durability, Qos, Reliability
from tests.rosserial.scene import START, RosLib, Scene, string

STRING = "std_msgs/msg/String"
BYTE = "std_msgs/msg/Byte"


def led_board(scene: Scene, version: int = VERSION_HYDRO) -> tuple[RosLib, int, int]:
    """A board that reads /led_out and publishes /chatter, in sync."""
    board = RosLib(scene, version=version)
    led = board.subscriber("led_out", "std_msgs/Byte")
    chatter = board.publisher("chatter", "std_msgs/String")
    board.plug()
    scene.until(lambda: board.connected)
    scene.step(400)
    return board, led, chatter


@pytest.mark.parametrize("version", [VERSION_HYDRO, VERSION_GROOVY])
def test_leds_are_switched_from_the_graph(version: int) -> None:
    scene = Scene()
    board, led, _ = led_board(scene, version)
    switch = scene.writer("/led_out", BYTE)
    for value in (1, 2, 4, 8, 0):
        switch(data=value)
        scene.step(2)
    assert board.taken(led) == [bytes([value]) for value in (1, 2, 4, 8, 0)]
    assert "Setup subscriber on led_out [std_msgs/Byte]" in [e.text() for e in scene.said(EndpointSetUp)]
    (ready,) = scene.said(BoardReady)
    assert ready.text() == "board a: node /board_a: 1 publisher, 1 subscriber"
    assert not scene.told


@pytest.mark.parametrize("version", [VERSION_HYDRO, VERSION_GROOVY])
def test_topics_of_a_board_are_heard_in_the_graph(version: int) -> None:
    scene = Scene()
    board, _, chatter = led_board(scene, version)
    hear = scene.reader("/chatter", STRING)
    for i in range(100):
        board.send(chatter, string(f"grüß {i}"))
    scene.step()
    assert [message.data for message in hear()] == [f"grüß {i}" for i in range(100)]


def test_a_board_is_a_node_of_the_graph() -> None:
    scene = Scene()
    led_board(scene)
    assert "/board_a" in [node.full_name for node in scene.space.graph.nodes]
    info = scene.space.graph.topic("rt/led_out")
    assert info is not None
    assert [reader.participant.full_name for reader in info.readers] == ["/board_a"]
    assert info.types == ("std_msgs::msg::dds_::Byte_",)


def test_the_time_that_a_board_gets_is_right_however_long_the_answer_takes() -> None:
    scene = Scene()
    board = RosLib(scene)
    board.plug()
    scene.until(lambda: board.clock)
    assert board.clock is not None
    assert abs(board.clock - scene.wall()) <= 1_000_000
    slow = Scene(baud=57600)
    late = RosLib(slow)
    late.plug()
    slow.until(lambda: late.clock)
    assert late.clock is not None
    assert -3_000_000 <= late.clock - slow.wall() <= 1_000_000  # the request's own time on the line


def test_a_session_lives_on_answers_to_requests_for_the_time() -> None:
    scene = Scene()
    board, _, _ = led_board(scene)
    asked = board.asked_time
    scene.step(30_000)
    assert board.connected
    assert board.asked_time - asked == pytest.approx(12, abs=1)
    assert scene.core.boards[0].asks == 1  # a healthy board is not asked again
    assert not scene.said(BoardLost)


def test_services_of_a_board_are_called_one_at_a_time() -> None:
    scene = Scene()
    board = RosLib(scene)
    response, request = board.server("switch", "std_srvs/SetBool")
    board.plug()
    scene.until(lambda: board.connected)
    call, answers = scene.client("/switch", "std_srvs/srv/SetBool")
    scene.step(400)
    for data in (True, False, True):
        call(data=data)
    scene.step(3)
    assert board.taken(request) == [b"\x01"]  # the others wait
    for text, expected in (("on", [b"\x00"]), ("off", [b"\x01"]), ("on", [])):
        board.send(response, b"\x01" + string(text))
        scene.step(3)
        assert board.taken(request) == expected
    assert [(answer.success, answer.message) for answer in answers] == [
        (True, "on"),
        (True, "off"),
        (True, "on"),
    ]
    assert not scene.told


def test_who_calls_with_a_request_that_cannot_be_sent_is_told() -> None:
    """As far as the world has a way to; in ROS 1 the call would never end."""
    scene = Scene()
    board = RosLib(scene)
    _, requests = board.server("switch", "std_srvs/SetBool")
    for half, info in board.infos:
        info.buffer_size = 0 if half == ID_SERVICE_SERVER + 1 else 512
    board.plug()
    scene.step(400)
    (server,) = scene.core.boards[0].roster.endpoints.values()
    assert isinstance(server, ServiceServer)
    assert server.server is not None
    told: list[str] = []
    server.server.fail = lambda request, text: told.append(text)  # type: ignore[method-assign]
    call, _ = scene.client("/switch", "std_srvs/srv/SetBool")
    scene.step(5)
    call(data=True)
    scene.step(5)
    assert told == ["1 B do not fit the board's input buffer"]
    for info in server.infos:
        info.buffer_size = 512
    scene.link.waiting = 100
    while scene.core.boards[0].output.post(b"urgent"):
        pass
    call(data=True)
    scene.step(5)
    assert told[1:] == ["too much waits for the board's line"]
    assert "call-unanswered" in scene.codes()
    assert not board.taken(requests)


def test_a_board_that_does_not_answer_delays_the_next_call_only() -> None:
    scene = Scene()
    board = RosLib(scene)
    response, request = board.server("switch", "std_srvs/SetBool")
    other = board.subscriber("text", "std_msgs/String")
    board.plug()
    scene.until(lambda: board.connected)
    call, answers = scene.client("/switch", "std_srvs/srv/SetBool")
    write = scene.writer("/text", STRING)
    scene.step(400)
    call(data=True)
    call(data=False)
    scene.step(500)
    write(data="meanwhile")
    scene.step(2)
    assert board.taken(other) == [string("meanwhile")]
    scene.step(1_000)
    assert "call-unanswered" in scene.codes()
    board.send(response, b"\x01" + string("late"))  # must not be taken for the answer to the second call
    scene.step(5)
    assert answers == []
    assert "late-answer" in scene.codes()
    assert board.taken(request) == [b"\x01", b"\x00"]
    board.send(response, b"\x01" + string("second"))
    scene.step(5)
    assert [answer.message for answer in answers] == ["second"]


def test_a_board_calls_services_of_the_graph() -> None:
    scene = Scene()
    response_type = interfaces.service("std_srvs/srv/SetBool").Response
    scene.server("/lamp", "std_srvs/srv/SetBool", lambda r: response_type(success=r.data, message="done"))
    board = RosLib(scene)
    request, response = board.client("lamp", "std_srvs/SetBool")
    board.plug()
    scene.until(lambda: board.connected)
    scene.step(400)
    board.send(request, b"\x01")
    scene.step(5)
    assert board.taken(response) == [b"\x01" + string("done")]
    board.send(request, b"\x00")
    scene.step(5)
    assert board.taken(response) == [b"\x00" + string("done")]


def test_a_service_that_is_not_there_stalls_nothing_and_answers_when_it_comes() -> None:
    scene = Scene()
    board = RosLib(scene)
    request, response = board.client("lamp", "std_srvs/SetBool")
    chatter = board.publisher("chatter", "std_msgs/String")
    board.plug()
    scene.until(lambda: board.connected)
    hear = scene.reader("/chatter", STRING)
    scene.step(400)
    board.send(request, b"\x01")
    scene.step(10)
    board.send(chatter, string("still here"))
    scene.step(10)
    assert [message.data for message in hear()] == ["still here"]
    assert "no-server" in scene.codes()
    kind = interfaces.service("std_srvs/srv/SetBool").Response
    scene.server("/lamp", "std_srvs/srv/SetBool", lambda r: kind(success=True, message="late"))
    scene.step(10)
    assert board.taken(response) == [b"\x01" + string("late")]


def test_answers_to_calls_from_before_a_restart_are_dropped() -> None:
    scene = Scene()
    answer: list[object] = []
    kind = interfaces.service("std_srvs/srv/SetBool").Response
    board = RosLib(scene)
    request, response = board.client("lamp", "std_srvs/SetBool")
    board.plug()
    scene.until(lambda: board.connected)
    scene.step(400)
    board.send(request, b"\x01")
    board.boot()
    scene.until(lambda: board.connected)

    def serve(asked: object) -> object:
        answer.append(asked)
        return kind(success=True)

    scene.server("/lamp", "std_srvs/srv/SetBool", serve)
    scene.step(20)
    assert answer
    assert board.taken(response) == []


@pytest.mark.parametrize(
    ("value", "ints", "floats", "strings"),
    [
        (7, [7], [7.0], [b"7"]),
        (0.5, [], [0.5], [b"0.5"]),
        (2.0, [2], [2.0], [b"2.0"]),
        (True, [1], [1.0], [b"1"]),
        ("text", [], [], [b"text"]),
        ([1, 2, 3], [1, 2, 3], [1.0, 2.0, 3.0], [b"1", b"2", b"3"]),
        (["a", "bc"], [], [], [b"a", b"bc"]),
        (1 << 40, [], [float(1 << 40)], [b"1099511627776"]),
        (1e300, [], [3.4028234663852886e38], [b"1e+300"]),
    ],
)
def test_parameters_are_answered_in_every_kind(
    value: object, ints: list[int], floats: list[float], strings: list[bytes]
) -> None:
    scene = Scene({"gain": value})
    board, _, _ = led_board(scene)
    for name in ("gain", "~gain", "/board_a/gain"):
        board.ask(name)
        scene.step(2)
        assert board.values is not None
        assert board.values.ints == ints
        assert board.values.floats == floats
        assert board.values.strings == strings


def test_a_parameter_that_is_not_set_is_answered_at_once_too() -> None:
    scene = Scene()
    board, _, _ = led_board(scene)
    board.ask("~motor/gain")
    scene.step(1)
    assert board.values is not None
    assert (board.values.ints, board.values.floats, board.values.strings) == ([], [], [])
    (told,) = [finding for finding in scene.told if finding.code == "no-such-parameter"]
    assert "muros param set /board_a motor.gain VALUE" in told.remedy


def test_parameters_that_do_not_fit_the_board_are_cut_to_the_kinds_that_do() -> None:
    scene = Scene({"long": "x" * 600, "list": list(range(50))})
    board, _, _ = led_board(scene)
    board.ask("long")
    scene.step(2)
    assert board.values is not None
    assert board.values.strings == []
    assert "too-long-for-board" in scene.codes()
    board.ask("list")
    scene.step(2)
    assert board.values.ints == list(range(50))
    assert board.values.floats == list(range(50))
    assert board.values.strings == []


def test_parameters_are_set_as_those_of_any_node() -> None:
    scene = Scene({"gain": 1})
    board, _, _ = led_board(scene)
    call, answers = scene.client("/board_a/set_parameters", "rcl_interfaces/srv/SetParameters")
    parameter = interfaces.message("rcl_interfaces/msg/Parameter")
    value = interfaces.message("rcl_interfaces/msg/ParameterValue")
    scene.step(5)
    call(
        parameters=[
            parameter(name="gain", value=value(type=2, integer_value=5)),
            parameter(name="new", value=value(type=4, string_value="added")),
        ]
    )
    scene.step(5)
    assert [result.successful for result in answers[0].results] == [True, True]
    board.ask("gain")
    scene.step(2)
    assert board.values is not None
    assert board.values.ints == [5]
    board.ask("new")
    scene.step(2)
    assert board.values.strings == [b"added"]


def test_logs_go_to_rosout() -> None:
    scene = Scene()
    board, _, _ = led_board(scene)
    rosout = scene.reader("/rosout", "rcl_interfaces/msg/Log")
    scene.step(2)
    for level in range(5):
        board.log(level, f"level {level}")
    board.log(3, "bad \udcff".encode("utf-8", "surrogateescape").decode("latin-1"))
    scene.step(2)
    found = rosout()
    assert [(each.level, each.msg) for each in found[:5]] == [(10 + 10 * i, f"level {i}") for i in range(5)]
    assert found[0].name == "board_a"
    assert found[0].stamp.sec == START // 10**9 + scene.now // 1000
    assert scene.said(BoardLog)[4].text() == "[FATAL] a: level 4"


def test_a_boards_node_says_what_the_server_says_of_the_board() -> None:
    """Where people grep: as the node of the ROS 1 servers did, in the log of the graph too."""
    scene = Scene()
    rosout = scene.reader("/rosout", "rcl_interfaces/msg/Log")
    led_board(scene)
    scene.core.boards[0].report("test", what="{n} thing{s}", why="so", remedy="Do it")
    scene.step(2)
    said = {message.msg: (message.level, message.name) for message in rosout()}
    assert said["Note: subscribe buffer size is 512 bytes"] == (20, "board_a")
    assert said["Setup subscriber on led_out [std_msgs/Byte]"] == (20, "board_a")
    assert said["Setup publisher on chatter [std_msgs/String]"] == (20, "board_a")
    assert any(
        text.startswith("finding: board a: 1 thing: so")
        for text, how in said.items()
        if how == (30, "board_a")
    )


def test_a_restart_is_noticed_within_a_second_and_nobody_in_the_graph_sees_it() -> None:
    scene = Scene()
    board, led, chatter = led_board(scene)
    switch = scene.writer("/led_out", BYTE)
    hear = scene.reader("/chatter", STRING)
    scene.step(1_000)
    before = [endpoint.gid for endpoint in (*scene.space.graph.readers, *scene.space.graph.writers)]
    board.boot()
    assert scene.until(lambda: board.connected) <= 1_300
    scene.step(10)
    switch(data=4)
    board.send(chatter, string("again"))
    scene.step(5)
    assert board.taken(led) == [b"\x04"]
    assert [message.data for message in hear()] == ["again"]
    assert len(scene.said(BoardReset)) == 1
    assert [e.gid for e in (*scene.space.graph.readers, *scene.space.graph.writers)] == before
    scene.step(20_000)
    assert scene.core.boards[0].asks == 2


def test_restarts_are_noticed_whenever_they_happen() -> None:
    for moment in range(0, 2_600, 130):
        scene = Scene()
        board, _, _ = led_board(scene)
        scene.step(3_000 + moment)
        board.boot()
        assert scene.until(lambda: board.connected) <= 1_300  # noqa: B023


def test_what_has_waited_long_for_a_silent_board_is_not_carried_out() -> None:
    """As after a pull: a robot that starts, however long that takes, must not carry out old commands."""
    scene = Scene()
    board, led, _ = led_board(scene)
    switch = scene.writer("/led_out", BYTE)
    board.running = False
    for value in range(100):
        switch(data=value)
        scene.step(100)
    board.boot()
    board.running = True
    scene.until(lambda: board.connected)
    scene.step(400)
    assert not board.taken(led)
    switch(data=100)
    scene.step(2)
    assert board.taken(led) == [bytes([100])]


def test_a_request_for_topics_that_gets_lost_is_made_again_though_the_board_talks() -> None:
    scene = Scene()
    board, led, chatter = led_board(scene)
    switch = scene.writer("/led_out", BYTE)
    send, raw = scene.link.send, board.raw
    scene.link.send = lambda message, address: True  # type: ignore[method-assign]
    board.raw = lambda data: None  # type: ignore[method-assign]
    scene.until(lambda: scene.core.boards[0].asks == 2)
    scene.link.send, board.raw = send, raw  # type: ignore[method-assign]
    for i in range(11):
        board.send(chatter, string(str(i)))
        scene.step(100)
    switch(data=1)
    scene.step(2)
    assert board.taken(led) == [b"\x01"]


def test_another_firmware_replaces_what_has_changed_and_keeps_the_rest() -> None:
    scene = Scene()
    board, led, _ = led_board(scene)
    kept = scene.space.graph.topic("rt/led_out")
    assert kept is not None
    board.boot()
    board.infos = [pair for pair in board.infos if pair[1].topic_name == "led_out"]
    board.infos[0][1].topic_id = 777
    board.publisher("fresh", "std_msgs/String")
    scene.until(lambda: board.connected)
    scene.step(3_000)
    now = scene.space.graph.topic("rt/led_out")
    assert now is not None
    assert now.readers[0].gid == kept.readers[0].gid
    assert scene.space.graph.topic("rt/chatter") is None
    assert scene.space.graph.topic("rt/fresh") is not None
    scene.writer("/led_out", BYTE)(data=1)
    scene.step(5)
    assert board.taken(777) == [b"\x01"]
    assert board.taken(led) == []


def test_a_topic_info_that_was_damaged_is_asked_for_again() -> None:
    scene = Scene()
    board = RosLib(scene)
    led = board.subscriber("led_out", "std_msgs/Byte")
    board.publisher("chatter", "std_msgs/String")
    real = board.raw
    lost: list[bytes] = []

    def damage(data: bytes) -> None:
        if b"led_out" in data and not lost:
            lost.append(data)
            data = data[:20] + bytes([data[20] ^ 0x10]) + data[21:]
        real(data)

    board.raw = damage  # type: ignore[method-assign]
    board.plug()
    scene.step(1_500)
    assert lost
    scene.writer("/led_out", BYTE)(data=1)
    scene.step(5)
    assert board.taken(led) == [b"\x01"]


def test_a_message_on_an_unknown_id_brings_one_request_a_second() -> None:
    scene = Scene()
    board, _, _ = led_board(scene)
    scene.step(1_000)
    for _ in range(100):
        board.send(300, b"stray")
        scene.step(10)
    assert 2 <= scene.core.boards[0].asks <= 3
    assert scene.core.boards[0].unknown == 100
    assert "unknown-topic-id" in scene.codes()


def test_wrong_sums_and_unknown_types_refuse_one_topic_and_no_more() -> None:
    scene = Scene()
    board = RosLib(scene)
    bad = board.publisher("bad", "std_msgs/String", "0" * 32)
    board.infos.append(
        (ID_PUBLISHER, type(board.infos[0][1])(200, "odd", "no_such_msgs/Thing", "1" * 32, 512))
    )
    good = board.publisher("good", "std_msgs/String")
    board.plug()
    scene.until(lambda: board.connected)
    hear = scene.reader("/good", STRING)
    scene.step(400)
    for _ in range(5):
        board.send(bad, string("x"))
        board.send(200, b"x")
        board.send(good, string("fine"))
        scene.step(1_000)
    assert len(hear()) == 5
    refused = {finding.subject: finding for finding in scene.told if finding.code == "topic-refused"}
    assert set(refused) == {"publisher bad", "publisher odd"}
    assert refused["publisher bad"].what.startswith("Creation of publisher failed: bad")
    assert "no_such_msgs" in refused["publisher odd"].why
    assert scene.core.boards[0].asks == 1


def test_nothing_longer_than_its_buffer_is_sent_to_a_board() -> None:
    scene = Scene()
    board = RosLib(scene, buffer=64)
    text = board.subscriber("text", "std_msgs/String")
    board.plug()
    scene.until(lambda: board.connected)
    write = scene.writer("/text", STRING)
    scene.step(400)
    for n in (61, 60, 1000, 3):
        write(data="x" * n)
        scene.step(2)
    assert [len(body) for body in board.taken(text)] == [64, 7]
    (told,) = [finding for finding in scene.told if finding.code == "too-long-for-board"]
    assert told.subject == "text"
    assert "65 B do not fit its input buffer of 64 B" in told.why


def test_a_type_that_can_never_fit_is_said_when_it_is_named() -> None:
    scene = Scene()
    board = RosLib(scene)
    board.subscriber("odom", "nav_msgs/Odometry")
    board.plug()
    scene.step(50)
    (told,) = [finding for finding in scene.told if finding.code == "buffer-too-small"]
    assert "INPUT_SIZE is 512 B" in told.why


def test_what_is_slow_on_the_line_is_warned_about_by_topic() -> None:
    scene = Scene(baud=57600)
    board = RosLib(scene)
    board.subscriber("imu", "sensor_msgs/Imu")
    board.subscriber("text", "std_msgs/String")
    board.plug()
    scene.step(200)
    assert {finding.subject for finding in scene.told if finding.code == "slow-line"} == {"imu"}
    scene.step(400)
    write = scene.writer("/text", STRING)
    write(data="x" * 50)
    scene.step(50)
    assert {finding.subject for finding in scene.told if finding.code == "slow-line"} == {"imu"}
    write(data="x" * 110)
    scene.step(50)
    assert {finding.subject for finding in scene.told if finding.code == "slow-line"} == {"imu", "text"}


def test_a_flood_for_a_slow_line_keeps_the_newest_and_delays_no_time() -> None:
    scene = Scene(baud=57600)
    board = RosLib(scene)
    text = board.subscriber("text", "std_msgs/String")
    other = board.subscriber("other", "std_msgs/String")
    board.plug()
    scene.until(lambda: board.connected)
    write, write_other = scene.writer("/text", STRING), scene.writer("/other", STRING)
    scene.step(400)
    for i in range(1_000):
        write(data=f"{i:040}")
        if i % 100 == 0:
            write_other(data="rare")
        scene.step(1)
    scene.step(200)
    got = [int(body[4:]) for body in board.taken(text)]
    line = sum(map(len, scene.link.sent)) * 174 / 1000
    assert got == sorted(got)
    assert got[-1] == 999
    assert len(got) < 200
    assert "line-too-slow" in scene.codes()
    assert line <= 1_700  # what was sent is what the line can carry
    assert len(board.taken(other)) == 10
    board.send(ID_TIME, bytes(8))
    for _ in range(300):
        write(data="y" * 40)
    before = len(scene.link.sent)
    scene.step(30)
    assert any(sent.startswith(b"\xff\xfe\x08\x00\xf7\x0a") for sent in scene.link.sent[before - 5 :])


def test_a_line_that_takes_nothing_for_a_moment_loses_nothing() -> None:
    scene = Scene()
    board, led, _ = led_board(scene)
    switch = scene.writer("/led_out", BYTE)
    scene.link.waiting = 100
    for value in range(90):
        switch(data=value)
        scene.step(1)
    assert board.taken(led) == []
    scene.link.waiting = 0
    scene.port.room("a", scene.now)
    scene.step(2)
    assert board.taken(led) == [bytes([value]) for value in range(90)]
    assert not scene.told


def test_a_line_that_takes_nothing_for_long_gets_the_newest() -> None:
    """A board that hung must not carry out seconds of old commands."""
    scene = Scene()
    board, led, _ = led_board(scene)
    switch = scene.writer("/led_out", BYTE)
    scene.link.waiting = 100
    for value in range(100):
        switch(data=value)
        scene.step(20)
    scene.link.waiting = 0
    scene.step(30)
    assert board.taken(led) == [bytes([value]) for value in range(90, 100)]
    (told,) = [finding for finding in scene.told if finding.code == "line-too-slow"]
    assert told.count == 90
    for value in range(90):  # from then on it is a line as before
        switch(data=value)
    scene.step(2)
    assert len(board.taken(led)) == 90


def test_a_line_that_is_always_too_slow_carries_what_is_new() -> None:
    """Also where nobody knows its rate: a network board with a poor connection takes half of what is published."""
    scene = Scene()
    board = RosLib(scene)
    text = board.subscriber("text", "std_msgs/String")
    board.plug()
    scene.step(400)
    write = scene.writer("/text", STRING)
    send = scene.link.send

    def full_after_one(message: bytes, address: Any) -> bool:
        scene.link.waiting = len(message)
        return send(message, address)

    scene.link.send = full_after_one  # type: ignore[method-assign]
    ages = []
    for i in range(3_000):
        write(data=f"{i:0190}")
        if i % 20 == 0:
            scene.link.waiting = 0
            scene.port.room("a", scene.now)
        scene.step()
        ages += [i - int(body[4:]) for body in board.taken(text)]
    assert len(ages) > 1_000
    assert max(ages) <= 200
    assert max(ages[len(ages) // 4 :]) <= 60


def test_a_board_may_read_what_is_said_of_it() -> None:
    """A line too slow for /rosout is said on /rosout."""
    scene = Scene()
    board = RosLib(scene)
    board.subscriber("rosout", "rcl_interfaces/Log")
    for name in ("a", "b", "c"):
        board.subscriber(name, "std_msgs/Byte")
    writers = [scene.writer(f"/{name}", BYTE) for name in ("a", "b", "c")]
    board.plug()
    scene.step(400)
    board.taken(101)
    scene.link.waiting = 100
    for _ in range(300):
        for write in writers:
            write(data=1)
        scene.step()
    scene.link.waiting = 0
    scene.step(30)
    assert any(b"newer ones came" in body for body in board.taken(101))


def test_latched_messages_all_come_however_slow_the_line() -> None:
    """They replace each other nowhere: each transform of /tf_static is another one."""
    scene = Scene(baud=9_600)
    keep = scene.writer("/tf_static", BYTE, Qos(Reliability.RELIABLE, Durability.TRANSIENT_LOCAL, depth=100))
    for value in range(80):
        keep(data=value)
    board = RosLib(scene)
    latched = board.subscriber("tf_static", "std_msgs/Byte")
    board.plug()
    scene.step(3_000)
    assert board.taken(latched) == [bytes([value]) for value in range(80)]
    assert "line-too-slow" not in scene.codes()


def test_a_cable_is_pulled_and_plugged_in_again() -> None:
    scene = Scene()
    board, led, _ = led_board(scene)
    before = [endpoint.gid for endpoint in scene.space.graph.readers]
    board.pull()
    board.boot()
    scene.step(5_000)
    (lost,) = scene.said(BoardLost)
    assert lost.text() == "Lost sync with device, restarting: board a (cable pulled), kept for 30 s"
    board.plug()
    assert scene.until(lambda: board.connected) <= 5
    scene.step(400)
    assert [endpoint.gid for endpoint in scene.space.graph.readers] == before
    assert scene.said(BoardBack)[0].away == pytest.approx(5.0, abs=0.01)
    scene.writer("/led_out", BYTE)(data=1)
    scene.step(2)
    assert board.taken(led) == [b"\x01"]


def test_a_board_that_stays_away_leaves_the_graph() -> None:
    scene = Scene()
    board, _, _ = led_board(scene)
    board.pull()
    scene.step(29_900)
    assert scene.core.boards
    scene.step(200)
    assert not scene.core.boards
    assert scene.said(BoardGone)[0].reason == "it did not come back within 30 s"
    assert [node.full_name for node in scene.space.graph.nodes] == ["/other"]


def test_a_board_that_falls_silent_is_asked_every_second_and_lost_after_eleven() -> None:
    scene = Scene()
    board, led, _ = led_board(scene)
    scene.step(3_000)
    board.running = False
    scene.step(9_000)
    assert not scene.said(BoardLost)
    assert 4 <= scene.core.boards[0].asks <= 9
    scene.step(3_000)
    assert len(scene.said(BoardLost)) == 1
    scene.step(40_000)
    assert [node.full_name for node in scene.space.graph.nodes] == ["/other"]
    board.boot()
    board.running = True
    assert scene.until(lambda: board.connected) <= 1_100
    scene.step(400)
    scene.writer("/led_out", BYTE)(data=1)
    scene.step(2)
    assert board.taken(led) == [b"\x01"]


def test_a_silent_board_gets_no_topics_as_its_ids_may_be_others_by_now() -> None:
    scene = Scene()
    board, led, _ = led_board(scene)
    switch = scene.writer("/led_out", BYTE)
    scene.step(3_000)
    board.running = False
    scene.step(5_000)
    before = len(scene.link.sent)
    switch(data=1)
    scene.step(100)
    assert not [sent for sent in scene.link.sent[before:] if sent[5:7] == bytes([led, 0])]


def test_a_board_that_never_asks_for_the_time_is_not_cut() -> None:
    scene = Scene()
    board = RosLib(scene)
    chatter = board.publisher("chatter", "std_msgs/String")
    board._ask_time = lambda: None  # type: ignore[method-assign]
    board.plug()
    scene.until(lambda: board.connected)
    hear = scene.reader("/chatter", STRING)
    scene.step(60_000)
    board.send(chatter, string("still here"))
    scene.step(2)
    assert [message.data for message in hear()] == ["still here"]
    assert not scene.said(BoardLost)
    assert scene.core.boards[0].asks == 1


def test_the_server_says_goodbye() -> None:
    scene = Scene()
    board, _, _ = led_board(scene)
    scene.core.stop()
    scene.step(1)
    assert board.taken(ID_TX_STOP) == [b""]
    assert not board.connected


@pytest.mark.parametrize("waiting", [0, 5_000])
def test_the_goodbye_waits_for_nothing(waiting: int) -> None:
    """The lines are closed soon."""
    scene = Scene(baud=9_600)
    board = RosLib(scene)
    board.subscriber("text", "std_msgs/String")
    board.plug()
    scene.step(1_000)
    write = scene.writer("/text", STRING)
    for _ in range(20):
        write(data="x" * 480)
    scene.link.waiting = waiting
    scene.core.stop()
    assert scene.link.sent[-1] == frame(ID_TX_STOP, b"")


def test_nothing_comes_after_the_goodbye() -> None:
    """A board that were asked again would publish to nobody until it gives up."""
    scene = Scene()
    board, led, _ = led_board(scene)
    switch = scene.writer("/led_out", BYTE)
    scene.step(1_000)
    scene.core.stop()
    scene.step(1)
    board.got.clear()
    for _ in range(40):
        switch(data=1)
        board._ask_time()
        board.send(99, b"no such id")
        scene.step(100)
    assert not board.got
    assert not board.connected
    board.pull()
    board.plug()
    scene.step(400)
    switch(data=2)
    scene.step(2)
    assert board.taken(led)[-1:] == [b"\x02"]


def test_damage_is_counted_told_and_passed_over() -> None:
    scene = Scene()
    board, _, chatter = led_board(scene)
    hear = scene.reader("/chatter", STRING)
    good = frame(chatter, string("good"))
    bad = good[:-1] + bytes([good[-1] ^ 1])
    for _ in range(10):
        board.raw(bad + b"\xff" + good + good[:5])
        scene.step(60)
        board.raw(good)
        scene.step(60)
    assert len(hear()) == 20
    assert "line-damage" in scene.codes()
    assert scene.core.boards[0].decoder.bad_checksum == 20  # what was cut short, too


def test_a_message_that_is_not_of_its_type_is_dropped() -> None:
    scene = Scene()
    board, _, chatter = led_board(scene)
    hear = scene.reader("/chatter", STRING)
    board.send(chatter, struct.pack("<I", 100) + b"short")
    board.send(chatter, string("right") + b"more")
    board.send(chatter, string("right"))
    scene.step(2)
    assert [message.data for message in hear()] == ["right"]
    (told,) = [finding for finding in scene.told if finding.code == "malformed-message"]
    assert told.subject == "chatter"


@pytest.mark.parametrize(
    ("noise", "why"),
    [
        (b"", "nothing arrives"),
        (b"Hello from setup()\r\n", "something prints text on this port: 'Hello from setup()"),
        (bytes(range(128, 200)), "that are no frames"),
        (b"\xff\xfe\x08\x00\xf7\x0a\x00\0\0\0\0\0\0\0\0\x00", "frames arrive, but damaged"),
    ],
)
def test_a_board_that_does_not_answer_is_judged_by_what_arrives(noise: bytes, why: str) -> None:
    scene = Scene()
    scene.port.up("a", scene.now)
    for _ in range(40):
        if noise:
            scene.port.receive(noise, "a", scene.now)
        scene.step(100)
    (told,) = [finding for finding in scene.told if finding.code == "no-sync"]
    assert "Unable to sync with device" in told.what
    assert why in told.why


def test_a_board_without_topics_is_told_of() -> None:
    scene = Scene()
    board = RosLib(scene)
    board.plug()
    scene.step(1_000)
    assert "no-topics" in scene.codes()
    assert scene.said(BoardReady)[0].text().endswith("no topics")


def test_diagnostics_say_how_the_line_is() -> None:
    scene = Scene()
    board, _, chatter = led_board(scene)
    look = scene.reader("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    board.send(chatter, string("x"))
    scene.step(3_000)
    arrays = look()
    assert len(arrays) == 3
    (status,) = arrays[-1].status
    assert (status.level, status.message, status.hardware_id) in (
        (b"\0", "Connected", "a"),
        (0, "Connected", "a"),
    )
    values = {value.key: value.value for value in status.values}
    assert int(values["frames received"]) >= 5
    assert values["checksum errors"] == "0"
    assert values["round trip"] == "1 ms"
    assert values["last sync"].endswith("s ago")
    assert values["last sync lost"] == "never"
    board.pull()
    scene.step(2_000)
    board.plug()
    scene.step(2_000)
    values = {value.key: value.value for value in look()[-1].status[0].values}
    assert 2.0 <= float(values["last sync lost"].removesuffix(" s ago")) <= 4.0


def test_many_boards_live_side_by_side() -> None:
    scene = Scene()
    boards = []
    for i in range(20):
        board = RosLib(scene, f"b{i}")
        boards.append(
            (board, board.subscriber("led_out", "std_msgs/Byte"), board.publisher(f"n{i}", "std_msgs/String"))
        )
        board.plug()
    scene.step(500)
    hear = [scene.reader(f"/n{i}", STRING) for i in range(20)]
    scene.writer("/led_out", BYTE)(data=1)
    scene.step(3)
    for i, (board, led, chatter) in enumerate(boards):
        assert board.taken(led) == [b"\x01"]
        board.send(chatter, string(f"from {i}"))
    scene.step(2)
    assert [[m.data for m in each()] for each in hear] == [[f"from {i}"] for i in range(20)]


def test_a_second_board_of_one_name_gets_a_number_and_a_returning_one_its_own() -> None:
    scene = Scene()
    first = RosLib(scene, "x")
    first.publisher("one", "std_msgs/String")
    scene.identify = lambda address: type(Scene.identify(scene, "x"))("host", "host", "/board", 0)  # type: ignore[method-assign]
    scene.port.identify = scene.identify
    second = RosLib(scene, "y")
    second.publisher("two", "std_msgs/String")
    first.plug()
    second.plug()
    scene.step(500)
    assert {n.full_name for n in scene.space.graph.nodes} == {"/board", "/board_2", "/other"}
    first.pull()
    scene.step(100)
    third = RosLib(scene, "z")
    third.publisher("one", "std_msgs/String")
    third.plug()
    scene.step(500)
    assert {n.full_name for n in scene.space.graph.nodes} == {"/board", "/board_2", "/other"}
    assert len(scene.core.boards) == 2


@pytest.mark.parametrize("how", ["reset", "silent"])
def test_a_board_that_dials_in_again_before_its_old_connection_has_ended_is_the_same(how: str) -> None:
    """One that was switched off and on: its node, with its parameters, and its topics stay."""
    scene = Scene({"gain": 2})
    host = Scene.identify(scene, "host")
    scene.port.identify = lambda address: host
    first = RosLib(scene, "x")
    led = first.subscriber("led_out", "std_msgs/Byte")
    first.plug()
    scene.step(3_000)
    before = [reader.gid for reader in scene.space.graph.readers]
    first.running = False
    scene.step(500)
    second = RosLib(scene, "y")
    second.infos = first.infos
    second.plug()
    if how == "reset":
        scene.step(3)
        first.pull()  # what it was sent meanwhile has shown that it is gone
    scene.until(lambda: len(scene.core.boards) == 1, within=3_500)
    scene.step(500)
    (node,) = [n for n in scene.space.graph.nodes if n.name.startswith("board")]
    assert node.full_name == "/board_host"
    assert [reader.gid for reader in scene.space.graph.readers] == before
    scene.writer("/led_out", BYTE)(data=8)
    scene.step(3)
    assert second.taken(led) == [b"\x08"]
    second.ask("~gain")
    scene.step(2)
    assert second.values is not None
    assert second.values.ints == [2]
    scene.step(20_000)
    assert second.connected
    assert len(scene.core.boards) == 1


def test_of_two_boards_at_one_place_each_stays_itself() -> None:
    scene = Scene()
    host = Scene.identify(scene, "host")
    scene.port.identify = lambda address: host
    boards = [RosLib(scene, address) for address in "xy"]
    for i, board in enumerate(boards):
        board.publisher(f"topic_{i}", "std_msgs/String")
        board.plug()
        scene.step(700)
    boards[0].pull()
    scene.step(100)
    assert {n.full_name for n in scene.space.graph.nodes} == {"/board_host", "/board_host_2", "/other"}
    assert boards[1].connected


def test_a_best_effort_writer_is_read_all_the_same() -> None:
    scene = Scene()
    board, led, _ = led_board(scene)
    switch = scene.writer("/led_out", BYTE, Qos(Reliability.BEST_EFFORT, depth=5))
    scene.step(3)
    switch(data=2)
    scene.step(3)
    assert board.taken(led) == [b"\x02"]


def test_limits_hold() -> None:
    scene = Scene(max_boards=1, max_endpoints=2)
    board = RosLib(scene, "a")
    for i in range(4):
        board.publisher(f"t{i}", "std_msgs/String")
    board.plug()
    scene.port.up("b", scene.now)
    scene.step(500)
    assert {"too-many-boards", "too-many-topics"} <= scene.codes()
    assert len(scene.core.boards) == 1
    assert scene.space.graph.topic("rt/t2") is None
    with pytest.raises(ValueError, match="lead is 0"):
        Scene(lead=0)


def test_parameter_requests_are_answered_before_any_topic_is_named() -> None:
    scene = Scene({"rate": 50})
    board = RosLib(scene)
    board.publisher("chatter", "std_msgs/String")
    board.plug()
    scene.step(1)
    board.ask("~rate")
    scene.step(2)
    assert board.taken(ID_PARAMETER_REQUEST)
    assert board.values is not None
    assert board.values.ints == [50]


def test_a_board_may_have_several_endpoints_of_one_name() -> None:
    scene = Scene()
    board = RosLib(scene)
    ups = [board.publisher("talk", "std_msgs/String") for _ in range(2)]
    downs = [board.subscriber("hear", "std_msgs/String") for _ in range(2)]
    board.plug()
    scene.until(lambda: board.connected)
    hear = scene.reader("/talk", STRING)
    write = scene.writer("/hear", STRING)
    for _ in range(3):  # also after being asked again
        scene.step(1_000)
        for i, up in enumerate(ups):
            board.send(up, string(f"from {i}"))
        write(data="to all")
        scene.step(5)
        assert [message.data for message in hear()] == ["from 0", "from 1"]
        assert [board.taken(down) for down in downs] == [[string("to all")]] * 2
        board.boot()
        scene.until(lambda: board.connected)
        scene.step(400)
    assert len(scene.core.boards[0].roster.endpoints) == 4


def test_one_number_may_serve_both_directions() -> None:
    """As ids of both directions are apart, a subscriber that is named again takes no publisher's id away."""
    scene = Scene()
    board = RosLib(scene)
    up = board.publisher("up", "std_msgs/String")
    board.subscriber("down", "std_msgs/String")
    board.infos[1][1].topic_id = up
    board.plug()
    scene.until(lambda: board.connected)
    hear = scene.reader("/up", STRING)
    write = scene.writer("/down", STRING)
    for _ in range(2):
        scene.step(1_000)
        board.send(up, string("up"))
        write(data="down")
        scene.step(5)
        assert [message.data for message in hear()] == ["up"]
        assert board.taken(up) == [string("down")]
        board.boot()
        scene.until(lambda: board.connected)


def test_ids_that_are_given_anew_never_carry_another_topic() -> None:
    """Another firmware numbers the same topics otherwise; also one that names them without being asked."""
    for asked in (True, False):
        scene = Scene()
        board = RosLib(scene)
        ids = {name: board.subscriber(name, "std_msgs/String") for name in ("a", "b", "c")}
        board.plug()
        scene.until(lambda: board.connected)  # noqa: B023
        writers = {name: scene.writer(f"/{name}", STRING) for name in ids}
        scene.step(400)
        turned = dict(zip(ids, [ids["c"], ids["a"], ids["b"]], strict=True))
        for _, info in board.infos:
            info.topic_id = turned[info.topic_name]
        if asked:
            board.boot()
            scene.until(lambda: board.connected)  # noqa: B023
        else:
            for half, info in board.infos:
                body = bytearray(info.size())
                info.write(body, 0)
                board.send(half, bytes(body))
        scene.step(2_000)
        for name, write in writers.items():
            write(data=name)
        scene.step(5)
        for name, topic_id in turned.items():
            assert board.taken(topic_id) == [string(name)]


def test_a_board_that_restarts_and_logs_all_the_time_is_asked_again_too() -> None:
    """Logs are sent by boards that nobody has asked for topics, so they prove nothing."""
    scene = Scene()
    board, _, _ = led_board(scene)
    scene.step(1_000)
    board.boot()
    start = scene.now
    while not board.connected:
        board.log(1, "still waiting")
        scene.step(50)
        assert scene.now - start <= 1_300
    assert len(scene.said(BoardReset)) == 1


def test_who_never_spoke_leaves_nothing_behind() -> None:
    scene = Scene(max_boards=5)
    for i in range(20):
        scene.port.up(i, scene.now)
        scene.port.receive(b"GET / HTTP/1.1\r\n", i, scene.now)
        scene.step(10)
        scene.port.down(i, "connection closed by the far end", scene.now)
    assert scene.core.boards == []
    assert "too-many-boards" not in scene.codes()
    board, led, _ = led_board(scene)
    scene.writer("/led_out", BYTE)(data=1)
    scene.step(2)
    assert board.taken(led) == [b"\x01"]


@pytest.mark.parametrize("how", ["pulled", "silent"])
def test_a_call_that_comes_while_the_board_is_away_is_made_when_it_is_back(how: str) -> None:
    scene = Scene()
    board = RosLib(scene)
    responses, requests = board.server("switch", "std_srvs/SetBool")
    board.plug()
    scene.step(1_000)
    call, answers = scene.client("/switch", "std_srvs/srv/SetBool")
    scene.step(10)
    if how == "pulled":
        board.pull()
    else:
        board.running = False
        scene.step(5_000)
    call(data=True)
    scene.step(50)
    board.boot()
    board.running = True
    if how == "pulled":
        board.plug()
    scene.until(lambda: board.got and board.got[-1] == (requests, b"\x01"))
    board.send(responses, b"\x01" + string("on"))
    scene.step(5)
    assert [answer.message for answer in answers] == ["on"]


def test_another_board_at_a_port_gets_nothing_on_the_ids_of_the_one_before() -> None:
    scene = Scene()
    board = RosLib(scene)
    requests = board.server("switch", "std_srvs/SetBool")[1]
    led = board.subscriber("led_out", "std_msgs/Byte")
    board.plug()
    scene.step(1_000)
    call, _ = scene.client("/switch", "std_srvs/srv/SetBool")
    switch = scene.writer("/led_out", BYTE)
    scene.step(10)
    board.pull()
    switch(data=1)
    call(data=True)
    board.infos.clear()
    board.boot()
    board.plug()
    scene.step(1_000)
    assert board.connected
    assert not board.taken(led) + board.taken(requests)


def test_what_was_published_while_a_board_was_away_is_not_carried_out_when_it_starts() -> None:
    scene = Scene()
    board = RosLib(scene)
    drive = board.subscriber("cmd_vel", "std_msgs/Byte")
    latched = board.subscriber("tf_static", "std_msgs/Byte")
    write = scene.writer("/cmd_vel", BYTE)
    keep = scene.writer("/tf_static", BYTE, Qos(Reliability.RELIABLE, Durability.TRANSIENT_LOCAL, depth=1))
    board.plug()
    scene.step(1_000)
    board.pull()
    for speed in range(20):
        write(data=speed)
        scene.step(10)
    keep(data=7)
    board.boot()
    board.plug()
    scene.step(1_000)
    write(data=99)
    scene.step(5)
    assert board.taken(drive) == [bytes([99])]
    assert board.taken(latched) == [bytes([7])]


def test_parameters_and_logs_before_the_board_was_asked() -> None:
    scene = Scene({"rate": 50})
    rosout = scene.reader("/rosout", "rcl_interfaces/msg/Log")
    board = RosLib(scene)
    board.plug()
    board.ask("~rate")
    board.log(1, "booting")
    scene.step(1)
    assert board.values is not None
    assert board.values.ints == [50]
    scene.step(5)
    board.log(1, "booted")
    scene.step(5)
    assert [message.msg for message in rosout()][-1] == "booted"


def test_boards_get_simulated_time_with_use_sim_time() -> None:
    scene = Scene({"use_sim_time": True}, baud=57_600)
    board, _, _ = led_board(scene)
    assert board.taken(ID_TIME)[-1] == bytes(8)  # before /clock says anything, and not a moment before that
    clock = scene.writer("/clock", "rosgraph_msgs/msg/Clock")
    clock(clock=interfaces.message("builtin_interfaces/msg/Time")(sec=5, nanosec=6_000_000))
    scene.step(3_000)
    seconds, nanoseconds = struct.unpack("<II", board.taken(ID_TIME)[-1])
    assert (seconds, round(nanoseconds / 1e6)) == (5, 3)  # less the time of the request on the line
    call, answers = scene.client("/board_a/set_parameters", "rcl_interfaces/srv/SetParameters")
    parameter = interfaces.message("rcl_interfaces/msg/Parameter")
    value = interfaces.message("rcl_interfaces/msg/ParameterValue")
    scene.step(5)
    call(parameters=[parameter(name="use_sim_time", value=value(type=1, bool_value=False))])
    scene.step(3_000)
    assert answers
    assert struct.unpack("<II", board.taken(ID_TIME)[-1])[0] >= START // 10**9
    found = scene.space.graph.topic("rt/clock")
    assert found is None or not found.readers


def test_required_topics_are_asked_for_until_the_board_names_them() -> None:
    scene = Scene({"require.publishers": ["chatter"], "require.subscribers": ["/led_out", "beep"]})
    board, led, _ = led_board(scene)
    scene.step(5_000)
    assert 4 <= scene.core.boards[0].asks <= 7
    assert {finding.subject for finding in scene.told if finding.code == "required-topic-missing"} == {
        "subscriber beep"
    }
    scene.writer("/led_out", BYTE)(data=1)  # whatever it has works meanwhile
    scene.step(5)
    assert board.taken(led) == [b"\x01"]
    beep = board.subscriber("beep", "std_msgs/Byte")
    scene.step(2_000)
    scene.writer("/beep", BYTE)(data=1)
    scene.step(5)
    assert board.taken(beep) == [b"\x01"]
    asks = scene.core.boards[0].asks
    scene.step(5_000)
    assert scene.core.boards[0].asks == asks


def test_lines_that_people_search_for_in_logs_of_rosserial_python() -> None:
    """Each is said at the same occasion, word for word as far as it goes."""
    scene = Scene()
    scene.port.up("nobody", scene.now)
    board = RosLib(scene)
    chatter = board.publisher("chatter", "std_msgs/String")
    board.publisher("odd", "std_msgs/String", md5="0" * 32)
    board.subscriber("led_out", "std_msgs/Byte")
    board.server("switch", "std_srvs/SetBool")
    request, _ = board.client("lamp", "std_srvs/SetBool")
    board.plug()
    scene.until(lambda: board.connected)
    scene.step(400)
    good = frame(chatter, string("good"))
    board.raw(good[:-1] + bytes([good[-1] ^ 1]) + good[:4] + bytes([good[4] ^ 1]) + good[5:] + good)
    scene.step(100)
    board.send(300, b"stray")
    board.send(request, b"\x01")
    scene.step(3_000)
    board.pull()
    scene.step(10)
    said = "\n".join([event.text() for event in scene.events] + [told.format() for told in scene.told])
    for line in (
        "Requesting topics...",
        "Note: publish buffer size is 512 bytes",
        "Note: subscribe buffer size is 512 bytes",
        "Setup publisher on chatter [std_msgs/String]",
        "Setup subscriber on led_out [std_msgs/Byte]",
        "Setup service server on switch [std_srvs/SetBool]",
        "Setup service client on lamp [std_srvs/SetBool]",
        "Starting service client, waiting for service 'lamp'",
        "Creation of publisher failed: ",
        "wrong checksum for topic id and msg",
        "Wrong checksum for msg length",
        "Tried to publish before configured, topic id 300",
        "Unable to sync with device; possible link problem or link software version mismatch",
        "Lost sync with device, restarting",
    ):
        assert line in said, said
