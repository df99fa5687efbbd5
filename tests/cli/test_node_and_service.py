"""`muros node` and `muros service`: what they print is what `ros2 node` and `ros2 service` print."""

import io
from typing import Any

import pytest

from muros import interfaces
from muros.cli import _tool
from tests.cli.scene import Scene, play

ADD = "example_interfaces/srv/AddTwoInts"
STRING = "std_msgs/msg/String"


def added(request: Any) -> Any:
    return interfaces.service(ADD).Response(sum=request.a + request.b)


def test_node_list() -> None:
    async def scenario(scene: Scene) -> None:
        for name in ("/talker", "/ns/deep/listener", "/_hidden"):
            scene.node(name)
        assert (await scene.muros("node list")).out == "/ns/deep/listener\n/talker\n"
        assert (await scene.muros("node list -a")).out == "/_hidden\n/ns/deep/listener\n/talker\n"
        assert (await scene.muros("node list -c")).out == "2\n"
        scene.space.participant("talker")
        done = await scene.muros("node list")
        assert done.out == "/ns/deep/listener\n/talker\n/talker\n"
        assert done.err == "muros: several nodes have one name, which may confuse others: /talker\n"

    play(scenario)


def test_names_from_others_cannot_command_the_terminal() -> None:
    async def scenario(scene: Scene) -> None:
        scene.space.participant("a\x1b[2Jb\u202ec")
        assert (await scene.muros("node list")).out == "/a\\x1b[2Jb\\u202ec\n"

    play(scenario)


class Terminal(io.StringIO):
    """Standard error of a person."""

    def isatty(self) -> bool:
        return True


def test_a_terminal_is_told_how_far_a_long_discovery_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_tool, "PROGRESS_AFTER", 0.0)

    async def scenario(scene: Scene) -> None:
        scene.node("/talker")
        terminal = Terminal()
        tool = _tool.Tool(scene.space, spin_time=0.02, err=terminal)
        await tool.discover()
        assert terminal.getvalue().startswith("\rlooking into domain 0 for 0 s: 1 found\x1b[K")
        assert terminal.getvalue().endswith("\r\x1b[K")

    play(scenario)


def test_node_info() -> None:
    async def scenario(scene: Scene) -> None:
        scene.writer("/ns/talker", "/chatter", STRING)
        scene.writer(
            "/ns/talker", "/fib/_action/feedback", "example_interfaces/action/Fibonacci_FeedbackMessage"
        )
        scene.reader("/ns/talker", "/cmd_vel", "geometry_msgs/msg/Twist")
        scene.server("/ns/talker", "/add", ADD, added)
        assert (await scene.muros("node info /ns/talker")).out == (
            """\
/ns/talker
  Subscribers:
    /cmd_vel: geometry_msgs/msg/Twist
  Publishers:
    /chatter: std_msgs/msg/String
  Service Servers:
    /add: example_interfaces/srv/AddTwoInts
  Service Clients:

  Action Servers:
    /fib: example_interfaces/action/Fibonacci
  Action Clients:

"""
        )
        hidden = await scene.muros("node info /ns/talker --include-hidden")
        assert (
            "    /fib/_action/feedback: example_interfaces/action/Fibonacci_FeedbackMessage\n" in hidden.out
        )
        done = await scene.muros("node info /ns/tolker")
        assert (done.error, done.status) == ("Unknown node '/ns/tolker': did you mean /ns/talker?", 1)

    play(scenario)


def test_service_list_and_type_and_find() -> None:
    async def scenario(scene: Scene) -> None:
        scene.server("/adder", "/add", ADD, added)
        scene.server("/adder", "/fib/_action/send_goal", ADD, added)
        assert (await scene.muros("service list")).out == "/add\n"
        assert (await scene.muros("service list -a -c")).out == "2\n"
        assert (await scene.muros("service list -t")).out == f"/add [{ADD}]\n"
        assert (await scene.muros("service type /add")).out == f"{ADD}\n"
        assert (await scene.muros("service find example_interfaces/AddTwoInts")).out == "/add\n"
        assert (await scene.muros("service info add")).out == (
            f"Type: {ADD}\nClients count: 0\nServices count: 1\n"
        )
        done = await scene.muros("service type /ad")
        assert done.error == "Unknown service '/ad': did you mean /add?"

    play(scenario)


@pytest.mark.parametrize(
    "words", [f"{ADD} '{{a: 24, b: 42}}'", "'{a: 24, b: 42}'", "example_interfaces/AddTwoInts 'a: 24\nb: 42'"]
)
def test_service_call(words: str) -> None:
    async def scenario(scene: Scene) -> None:
        scene.server("/adder", "/add", ADD, added)
        assert await scene.muros(f"service call /add {words}") == (
            "requester: making request: example_interfaces.srv.AddTwoInts_Request(a=24, b=42)\n\n"
            "response:\nexample_interfaces.srv.AddTwoInts_Response(sum=66)\n\n",
            "",
            "",
            0,
        )

    play(scenario)


def test_service_call_waits_for_the_server() -> None:
    async def scenario(scene: Scene) -> None:
        call = scene.start("service call /add example_interfaces/srv/AddTwoInts '{a: 1}'")
        await scene.until(lambda: "waiting for service to become available...\n" in call.out.getvalue())
        scene.server("/adder", "/add", ADD, added)
        assert "AddTwoInts_Response(sum=1)" in (await call.end()).out

    play(scenario)


def test_service_call_repeats() -> None:
    async def scenario(scene: Scene) -> None:
        scene.server("/adder", "/add", ADD, added)
        done = await scene.muros("service call /add -r 500 --times 3")
        assert done.out.count("AddTwoInts_Response(sum=0)") == 3

    play(scenario)


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ("/none --timeout 0.05", "nobody serves /none in domain 0"),
        (f"/none {ADD} --timeout 0.05", "nobody serves /none in domain 0"),
        ("/silent --timeout 0.05", "no answer from /silent within 0.05 s"),
        ("/silent '{c: 1}'", "example_interfaces/srv/AddTwoInts_Request has no field 'c' (it has a, b)"),
        ("/silent std_msgs/msg/String", "std_msgs/msg/String is no service"),
        ("/silent my_srvs/srv/Nothing", "unknown type 'my_srvs/srv/Nothing': say --types FOLDER, "),
        ("/silent a b c", "too many words: put the values in one, as in '{a: 1, b: 2}'"),
    ],
)
def test_service_call_errors(words: str, error: str) -> None:
    async def scenario(scene: Scene) -> None:
        from muros.cli._names import service_of

        scene.node("/mute").replier(service_of("/silent", ADD))
        done = await scene.muros(f"service call {words}")
        assert done.error.startswith(error)
        assert done.status in (1, 2)

    play(scenario)
