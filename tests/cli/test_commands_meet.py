"""The commands against each other: processes of their own, in the ROS 2 graph of this host."""

import base64
import json
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

from tests.cli.shell import LIMIT, Shell
from tests.dds.domains import free_domain

STRING = "std_msgs/msg/String"
HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


@pytest.fixture(scope="module")
def shell() -> Iterator[Shell]:
    with free_domain() as domain:
        yield Shell(domain)


def test_what_pub_says_echo_prints(shell: Shell) -> None:
    with shell.running(f"topic echo /chatter {STRING}") as echo:
        done = shell.run(f"topic pub --once /chatter {STRING} 'data: Hello World'")
        assert done.returncode == 0
        assert done.stdout.endswith(
            "publisher: beginning loop\npublishing #1: std_msgs.msg.String(data='Hello World')\n\n"
        )
        assert echo.line("data: ") == "data: Hello World\n"
        assert echo.line("-") == "---\n"
        assert echo.stop() == (130, "")
        assert echo.err == ""


def test_a_publisher_leaves_when_its_large_sample_has_arrived(
    shell: Shell, tmp_path_factory: pytest.TempPathFactory
) -> None:
    file = tmp_path_factory.mktemp("large") / "large.yaml"
    file.write_text(f"data: !!binary {base64.b64encode(bytes(1_000_000)).decode()}\n")
    kind = "std_msgs/msg/UInt8MultiArray"
    with shell.running(f"topic echo /large {kind} --once --no-arr --field data -l 1") as echo:
        done = shell.run(f"topic pub --once --keep-alive 0 /large {kind} --yaml-file {file}")
        assert done.returncode == 0
        assert echo.out.read() == "- 0\n- '...'\n---\n"


def test_a_publisher_is_seen_measured_and_gone(shell: Shell) -> None:
    with shell.running(f"topic pub -n lamp -r 100 -p 10 /lamp/state {STRING} 'data: \"on\"'") as pub:
        pub.line("publishing #10: ")
        nodes, topics, info, node, graph = shell.outputs(
            "node list", "topic list -t", "topic info -v /lamp/state", "node info /lamp", "graph"
        )
        assert nodes == "/lamp\n"
        assert topics == f"/lamp/state [{STRING}]\n"
        assert "Node name: lamp\nNode namespace: /\n" in info
        assert f"Topic type hash: {HASH}\nEndpoint type: PUBLISHER\n" in info
        assert "  Reliability: RELIABLE\n  History (Depth): UNKNOWN\n" in info
        assert "    /lamp/state: std_msgs/msg/String\n" in node
        assert "  writes  /lamp/state  std_msgs/msg/String  -> nobody\n" in graph
        rate, bandwidth, values = shell.outputs(
            "topic hz /lamp/state --times 1",
            "topic bw /lamp/state --times 1",
            "topic echo /lamp/state --once --csv",
        )
        assert rate.startswith("average rate: ")
        assert "\tMessage size mean: 0.01 KB min: 0.01 KB" in bandwidth
        assert values == "on\n"
        status, _ = pub.stop()
        assert status == 130
    assert shell.run("node list").stdout == ""


SERVER = """
import asyncio, sys
from muros import interfaces
from muros.cli._names import service_of
from muros.space import open_space

ADD = "example_interfaces/srv/AddTwoInts"
made = interfaces.service(ADD)

async def main():
    space = open_space("dds:")
    space.attach(asyncio.get_running_loop())
    def answer(identity, data):
        request = made.Request.deserialize(data)
        server.reply(identity, made.Response(sum=request.a + request.b).serialize())
    server = space.participant("adder").replier(service_of("/add", ADD), on_request=answer)
    print("ready", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    space.close()

asyncio.run(main())
"""


def test_a_service_is_listed_and_called(shell: Shell) -> None:
    server = subprocess.Popen(
        [sys.executable, "-c", SERVER],
        env=shell.environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert server.stdout is not None
        assert server.stdout.readline() == "ready\n"
        kind = "example_interfaces/srv/AddTwoInts"
        listed, of_type, of_node = shell.outputs("service list -t", "service type /add", "node info adder")
        assert listed == f"/add [{kind}]\n"
        assert of_type == f"{kind}\n"
        assert "    /add: example_interfaces/srv/AddTwoInts\n" in of_node
        once, thrice = shell.outputs(
            "service call /add '{a: 24, b: 42}'", f"service call /add {kind} '{{a: 1}}' -r 20 --times 3"
        )
        assert once == (
            "requester: making request: example_interfaces.srv.AddTwoInts_Request(a=24, b=42)\n\n"
            "response:\nexample_interfaces.srv.AddTwoInts_Response(sum=66)\n\n"
        )
        assert thrice.count("AddTwoInts_Response(sum=1)") == 3
    finally:
        server.communicate(timeout=LIMIT)


def test_doctor_finds_qos_that_does_not_fit(shell: Shell) -> None:
    with (
        shell.running(f"topic pub -n mute /scan {STRING} --qos-reliability best_effort") as pub,
        shell.running(f"topic echo /scan {STRING} --qos-reliability reliable") as echo,
    ):
        pub.line("publishing #2")
        done = shell.run("doctor")
        assert done.returncode == 1
        assert "hears nothing of /mute: " in done.stdout
        assert "-> Make the reader best effort, or the writer reliable\n" in done.stdout
        assert "thing is wrong" in done.stdout.splitlines()[-1]
        assert done.stderr == ""
        pub.stop()
        echo.stop()
        assert (
            "muros: /mute does not match: the reader wants reliable, the writer offers best effort"
            in echo.err
        )


def test_doctor_knows_the_clients_of_an_agent_on_this_host(shell: Shell) -> None:
    with shell.running("agent udp4 -p 0 --bind 127.0.0.1 -m dds") as agent:
        banner = agent.out.readline()
        port = int(banner.rpartition(":")[2].split()[0])
        program = (
            "from muros.client import Udp\nfrom muros.rclc import Context, Executor\nfrom std_msgs.msg import Int32\n"
            f"context = Context(Udp('127.0.0.1', {port}), client_key=0xBA5EBA11, domain_id={shell.domain})\n"
            "node = context.node('thermometer', namespace='house')\n"
            "pub = node.publisher(Int32, 'temperature')\n"
            "node.timer(0.1, lambda: pub.publish(Int32(data=21)))\n"
            "Executor(context).spin()\n"
        )
        board = subprocess.Popen([sys.executable, "-c", program], env=shell.environment)
        try:
            assert shell.run("topic echo /house/temperature --once --field data").stdout == "21\n---\n"
            done = shell.run(f"doctor --agent 127.0.0.1:{port}")
            assert f"ok     an agent answers at 127.0.0.1:{port}, " in done.stdout
            assert "ok     its clients' nodes: /house/thermometer\n" in done.stdout
        finally:
            board.kill()
            board.wait(LIMIT)
        agent.stop(signal.SIGTERM)


@pytest.mark.parametrize(
    ("line", "status", "error"),
    [
        ("topic info /nothing", 1, "muros: Unknown topic '/nothing': there is none at all in domain "),
        ("topic pub /x std_msgs/msg/Strin", 1, "muros: unknown type 'std_msgs/msg/Strin' (did you mean "),
        ("topic list --space nowhere:", 1, "muros: 'nowhere:' names no data space engine (known: "),
        (
            "topic list --space dds:5 -d 6",
            2,
            "muros: --space dds:5 and -d 6 contradict each other: leave one out",
        ),
        ("topic list --space dds:kitchen", 1, "muros: "),
        (
            "topic echo /x std_msgs/msg/String --types /no/such/folder",
            1,
            "muros: /no/such/folder: no such folder",
        ),
    ],
)
def test_errors_are_one_clear_line(shell: Shell, line: str, status: int, error: str) -> None:
    done = shell.run(line)
    assert done.returncode == status
    assert done.stderr.startswith(error)
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""


def test_a_variable_that_cannot_be_meant_is_one_clear_line(shell: Shell) -> None:
    shell.environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "GALAXY"
    try:
        done = shell.run("topic list")
    finally:
        shell.environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    assert done.returncode == 1
    assert "GALAXY" in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_command_leaves_the_graph_when_it_is_told_to_end(shell: Shell) -> None:
    with shell.running(f"topic pub -n brief /x {STRING}") as pub:
        pub.line("publishing #1")
        assert shell.run("node list").stdout == "/brief\n"
        assert pub.stop(signal.SIGTERM)[0] == 143
        assert pub.err == ""
    assert shell.run("node list").stdout == ""


def test_who_reads_our_output_may_leave(shell: Shell) -> None:
    with shell.running(f"topic pub -r 50 -p 10 /count {STRING} 'data: x'") as pub:
        pub.line("publishing #10: ")
        echo = subprocess.Popen(
            [sys.executable, "-m", "muros", "topic", "echo", "/count"],
            env=shell.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert echo.stdout is not None
        assert echo.stderr is not None
        assert echo.stdout.readline() == "data: x\n"
        echo.stdout.close()
        assert echo.wait(LIMIT) == 1
        # On a busy machine it may have waited for its topic.
        assert [line for line in echo.stderr if "waiting: topic" not in line] == []
        echo.stderr.close()


def test_looking_for_a_topic_does_not_load_what_only_others_need(shell: Shell) -> None:
    """Commands start quickly: no numpy, and the type stores only when a type is needed."""
    program = (
        "import sys, json\nfrom muros.cli import main\nstatus = main(['topic', 'list'])\n"
        "print(json.dumps([status, sorted({m.partition('.')[0] for m in sys.modules})]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=shell.environment,
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=True,
    )
    status, modules = json.loads(done.stdout)
    assert status == 0
    assert not {"numpy", "rosbags", "ruamel", "yaml"} & set(modules)
