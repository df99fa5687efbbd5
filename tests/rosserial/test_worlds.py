"""A board in several worlds at once, here two spaces."""

from __future__ import annotations

from typing import Any

import pytest

from muros import interfaces
from muros.findings import Findings
from muros.rosserial.server import Limits, RefusedError, ServerCore, SpaceWorld
from muros.rosserial.server._worlds import Worlds
from muros.space import Qos, Service, Topic, open_space
from tests.rosserial.scene import RosLib, Scene, SceneLink, string


class TwoSpaces(Scene):
    """A scene with a second space, whose programs are reached by ``second``."""

    def __init__(self) -> None:
        super().__init__({"gain": 1})
        self.elsewhere = open_space("local:", clock=lambda: self.now * 1_000_000)
        self.refused: list[tuple[str, str, str]] = []
        other_world = SpaceWorld(
            self.elsewhere,
            wall=self.wall,
            later=self.soon.append,
            remap={"only_here": "bad name"},
            parameters=lambda node: {"gain": 2, "rate": 50},
        )
        worlds = Worlds(
            [self.world, other_world], lambda *given: self.refused.append((given[0], given[1], str(given[2])))
        )
        self.core = ServerCore(worlds, Findings(), limits=Limits(), wall=self.wall, clock=lambda: self.now)
        self.core.on_event = self.events.append
        self.link = SceneLink(self)
        self.port = self.core.attach(self.link, self.identify)
        self.second = self.elsewhere.participant("second")

    def step(self, ms: int = 1) -> None:
        for _ in range(ms):
            super().step()
            self.elsewhere.tick()


def topic(name: str, kind: str) -> Topic:
    return Topic(interfaces.dds_topic(name), interfaces.dds_type_name(kind))


def test_topics_go_to_all_and_come_from_any() -> None:
    scene = TwoSpaces()
    board = RosLib(scene)
    up = board.publisher("up", "std_msgs/String")
    down = board.subscriber("down", "std_msgs/String")
    only = board.publisher("only_here", "std_msgs/String")
    board.plug()
    scene.until(lambda: board.connected)
    hear = scene.reader("/up", "std_msgs/msg/String")
    far = scene.second.reader(topic("/up", "std_msgs/msg/String"), Qos(depth=10))
    far_writer = scene.second.writer(topic("/down", "std_msgs/msg/String"), Qos(depth=10))
    write = scene.writer("/down", "std_msgs/msg/String")
    here = scene.reader("/only_here", "std_msgs/msg/String")
    scene.step(400)
    board.send(up, string("all"))
    board.send(only, string("here"))
    write(data="one")
    far_writer.write(interfaces.message("std_msgs/msg/String")(data="two").serialize())
    scene.step(5)
    assert [message.data for message in hear()] == ["all"]
    sample = far.take()
    assert sample is not None
    assert interfaces.message("std_msgs/msg/String").deserialize(sample.data).data == "all"
    assert sorted(board.taken(down)) == [string("one"), string("two")]
    assert [message.data for message in here()] == ["here"]
    assert [each[:2] for each in scene.refused] == [("board a", "publisher only_here")]
    board.ask("rate")
    scene.step(2)
    assert board.values is not None
    assert board.values.ints == [50]
    board.ask("gain")
    scene.step(2)
    assert board.values.ints == [1]  # the first world's


def test_services_are_called_from_any_and_calls_go_where_a_server_is() -> None:
    scene = TwoSpaces()
    kind = interfaces.service("std_srvs/srv/SetBool")
    service = Service(
        "/lamp",
        "rq/lampRequest",
        "rr/lampReply",
        "std_srvs::srv::dds_::SetBool_Request_",
        "std_srvs::srv::dds_::SetBool_Response_",
    )
    served: Any = scene.second.replier(
        service, None, lambda i, data: served.reply(i, kind.Response(success=True, message="far").serialize())
    )
    board = RosLib(scene)
    response, request = board.server("switch", "std_srvs/SetBool")
    ask, answered = board.client("lamp", "std_srvs/SetBool")
    board.plug()
    scene.until(lambda: board.connected)
    scene.step(400)
    board.send(ask, b"\x01")
    scene.step(5)
    assert board.taken(answered) == [b"\x01" + string("far")]
    answers: list[str] = []
    far = scene.second.requester(
        scene.service("/switch", "std_srvs/srv/SetBool"),
        None,
        lambda n, data: answers.append("far " + kind.Response.deserialize(data).message),
    )
    near, near_answers = scene.client("/switch", "std_srvs/srv/SetBool")
    far.send(kind.Request(data=True).serialize())
    near(data=False)
    scene.step(5)
    for _ in range(2):
        (body,) = board.taken(request)
        board.send(response, b"\x01" + string("on" if body == b"\x01" else "off"))
        scene.step(5)
    assert answers == ["far on"]
    assert [each.message for each in near_answers] == ["off"]


def test_what_all_refuse_is_refused() -> None:
    scene = TwoSpaces()
    with pytest.raises(RefusedError, match="bad name"):
        Worlds([scene.world], lambda *given: None).node("/bad name", "board a")
