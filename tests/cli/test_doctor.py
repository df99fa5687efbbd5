"""`muros doctor`: what it finds in a graph and on a host, and how it ends."""

import socket
import subprocess
import sys
from pathlib import Path

import pytest

from muros import interfaces
from muros.cli import _graph_checks, _host_checks, main
from muros.cli._diagnosis import Level, Result, report
from muros.rtps.net import Interface, NetworkSettings
from muros.space import Topic
from tests.cli.scene import Scene, play

STRING = "std_msgs/msg/String"


@pytest.fixture(autouse=True)
def _no_agent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever runs on this host: there is no agent, unless a test starts one."""
    monkeypatch.setattr(_host_checks, "_agent_answers", lambda host, port: False)
    monkeypatch.setattr(_host_checks, "port_holder", lambda protocol, port: None)
    monkeypatch.setattr(_graph_checks, "domains_in_use", list)


def test_nobody_is_there() -> None:
    async def scenario(scene: Scene) -> None:
        done = await scene.muros("doctor")
        assert "note   nobody else is in domain 0\n" in done.out
        assert "note   no agent answers at 127.0.0.1:8888" in done.out
        assert done.status == 0

    play(scenario)


def test_nobody_is_there_but_in_another_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_graph_checks, "domains_in_use", lambda: [0, 5, 7])

    async def scenario(scene: Scene) -> None:
        done = await scene.muros("doctor")
        assert (
            "note   nobody else is in domain 0, but processes of this host are in domain 5, 7\n"
            "       -> muros doctor -d 5 looks there; ROS_DOMAIN_ID=5 takes all commands there\n"
        ) in done.out

    play(scenario)


def test_domains_in_use_are_read_off_the_ports() -> None:
    head = "  sl  local_address rem_address   st tx_queue rx_queue\n"
    rows = "".join(
        f" {n}: 0100007F:{port:04X} 00000000:0000 07 00000000:00000000\n"
        for n, port in enumerate((7400, 7410, 7400 + 250 * 42, 68))
    )
    assert _host_checks.domains_in_use(head + rows) == [0, 42]
    assert _host_checks.domains_in_use("") == []


def test_all_is_well() -> None:
    async def scenario(scene: Scene) -> None:
        scene.writer("/talker", "/chatter", STRING)
        scene.reader("/listener", "/chatter", STRING)
        done = await scene.muros("doctor")
        assert "ok     2 nodes, 1 topic and 0 services in domain 0\n" in done.out
        assert "ok     types and QoS fit on every topic\n" in done.out
        assert done.status == 0

    play(scenario)


def test_qos_that_does_not_fit() -> None:
    async def scenario(scene: Scene) -> None:
        scene.writer("/talker", "/chatter", STRING, "sensor_data")
        scene.reader("/listener", "/chatter", STRING)
        done = await scene.muros("doctor")
        assert (
            "WRONG  /chatter: /listener hears nothing of /talker: "
            "the reader wants reliable, the writer offers best effort\n"
            "       -> Make the reader best effort, or the writer reliable\n"
        ) in done.out
        assert done.status == 1

    play(scenario)


def test_types_that_differ() -> None:
    async def scenario(scene: Scene) -> None:
        scene.writer("/a", "/x", STRING)
        scene.reader("/b", "/x", "std_msgs/msg/Int32")
        done = await scene.muros("doctor")
        assert (
            "WRONG  /x has several types, and those of different types do not meet: "
            "std_msgs::msg::dds_::String_ of /a; std_msgs::msg::dds_::Int32_ of /b\n"
        ) in done.out
        assert done.status == 1

    play(scenario)


def test_hashes_that_differ() -> None:
    from dataclasses import replace

    from muros.cli._names import RosTopic

    async def scenario(scene: Scene) -> None:
        scene.writer("/a", "/x", STRING)
        scene.reader("/b", "/x", STRING)
        (writer,), (reader,) = scene.space.graph.writers, scene.space.graph.readers
        right = interfaces.rihs01(STRING)
        other = "RIHS01_" + "0" * 64

        def found(of_writer: str, of_reader: str) -> list[Result]:
            topic = RosTopic(
                "/x",
                "rt/x",
                (STRING,),
                (replace(writer, type_hash=of_writer),),
                (replace(reader, type_hash=of_reader),),
            )
            return list(_graph_checks._type_checks(topic))

        assert found(right, right) == []
        assert found(right, "") == []
        (result,) = found(right, other)
        assert result.level is Level.WRONG
        assert result.what == (
            f"/x: {STRING} is defined differently: {right[:15]}... of /a; RIHS01_00000000... of /b"
        )
        (result,) = found(other, other)
        assert result.level is Level.NOTE

    play(scenario)


def test_nodes_and_topics_that_look_odd() -> None:
    async def scenario(scene: Scene) -> None:
        scene.writer("/talker", "/only_written", STRING)
        scene.reader("/talker", "/only_read", STRING)
        scene.writer("/talker", "/rosout", "rcl_interfaces/msg/Log")
        scene.node("/silent")
        scene.space.participant("talker").reader(Topic("rt/only_read", "std_msgs::msg::dds_::String_"))
        done = await scene.muros("doctor -q")
        assert "WRONG  several nodes are called /talker: " in done.out
        assert "note   written, but nobody listens: /only_written\n" in done.out
        assert "note   listened to, but nobody writes: /only_read\n" in done.out
        assert "note   /silent: there, but without writers and readers\n" in done.out
        assert "\nok " not in done.out

    play(scenario)


def test_what_the_engine_noticed_is_told() -> None:
    async def scenario(scene: Scene) -> None:
        scene.node("/talker")
        scene.space.findings.report(
            "odd", who="somebody", what="{n} datagram{s} malformed", why="noise", remedy="Look there", now=1.0
        )
        done = await scene.muros("doctor")
        assert "WRONG  somebody: 1 datagram malformed: noise\n       -> Look there\n" in done.out

    play(scenario)


# ---- this host ----


def levels(results: object) -> list[Level]:
    return [result.level for result in results]  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("environment", "level", "words"),
    [
        ({"ROS_LOCALHOST_ONLY": "1"}, Level.NOTE, "ROS_LOCALHOST_ONLY=1: only nodes on this host"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, Level.NOTE, "nodes on this host are found"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}, Level.WRONG, "nobody is found"),
        ({"RMW_IMPLEMENTATION": "rmw_zenoh_cpp"}, Level.WRONG, "do not speak DDS"),
        ({"ROS_DISCOVERY_SERVER": "10.0.0.1:11811"}, Level.WRONG, "announce themselves to that server only"),
        ({"CYCLONEDDS_URI": "<x/>"}, Level.NOTE, "CYCLONEDDS_URI is set"),
        ({"ROS_STATIC_PEERS": "localhost"}, Level.FINE, "static peer localhost is 127.0.0.1"),
    ],
)
def test_variables(environment: dict[str, str], level: Level, words: str) -> None:
    settings = NetworkSettings.from_environment(environment)
    (result,) = _host_checks.variable_checks(environment, settings)
    assert result.level is level
    assert words in result.what
    assert result.remedy or level is Level.FINE or "CYCLONEDDS_URI" in environment


def test_variables_that_are_fine_are_not_told() -> None:
    assert list(_host_checks.variable_checks({}, NetworkSettings())) == []
    rmw = {"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}
    assert list(_host_checks.variable_checks(rmw, NetworkSettings())) == []


def test_a_variable_that_cannot_be_meant_is_told_and_the_rest_is_still_looked_at() -> None:
    results = list(_host_checks.host_checks({"ROS_DOMAIN_ID": "kitchen"}))
    assert results[1].level is Level.WRONG
    assert "kitchen" in results[1].what
    assert len(results) > 4


@pytest.mark.parametrize(
    ("domain", "level"), [(0, Level.FINE), (100, Level.FINE), (101, Level.WRONG), (230, Level.WRONG)]
)
def test_domains_whose_ports_are_given_to_others(domain: int, level: Level) -> None:
    result = _host_checks.domain_check(domain, {}, asked=True, ports="32768 60999\n")
    assert result.level is level
    if level is Level.WRONG:
        assert result.remedy == "Choose a domain from 0 to 100"


def test_interfaces() -> None:
    lo = Interface("lo", 1, ("127.0.0.1",), True, True)
    lan = Interface("eth0", 2, ("192.0.2.7",), False, True)
    mute = Interface("wg0", 3, ("192.0.2.9",), False, False)
    settings = NetworkSettings()
    assert levels(_host_checks.interface_checks([lan, lo], settings)) == [Level.FINE]
    assert levels(_host_checks.interface_checks([lan, mute, lo], settings)) == [Level.FINE, Level.WRONG]
    assert levels(_host_checks.interface_checks([lan], settings)) == [Level.FINE, Level.WRONG]
    assert levels(_host_checks.interface_checks([lo], settings)) == [Level.NOTE]


def test_a_port_that_somebody_keeps() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as keeper:
        for domain in range(60, 100):
            try:
                keeper.bind(("", 7400 + 250 * domain))
                break
            except OSError:
                continue
        result = _host_checks.port_check(domain)
    assert result.level is Level.WRONG
    assert "keeps it to itself" in result.what
    assert _host_checks.port_check(domain).level is Level.FINE


def test_buffers() -> None:
    small = _host_checks.buffer_check(4 << 20, "212992\n")
    assert small.level is Level.NOTE
    assert small.remedy.startswith("sudo sysctl -w net.core.rmem_max=4194304")
    assert _host_checks.buffer_check(4 << 20, "4194304\n").level is Level.FINE
    assert _host_checks.buffer_check(4 << 20, "").level is Level.FINE


def test_serial_ports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert list(_host_checks.serial_checks(tmp_path)) == []
    (tmp_path / "ttyUSB0").touch()
    assert levels(_host_checks.serial_checks(tmp_path)) == [Level.FINE]
    monkeypatch.setattr("os.access", lambda path, mode: False)
    (result,) = _host_checks.serial_checks(tmp_path)
    assert result.what == f"serial port {tmp_path}/ttyUSB0: permission denied"


def test_an_agent_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    command = [
        sys.executable,
        "-m",
        "muros",
        "agent",
        "udp4",
        "-p",
        "0",
        "--bind",
        "127.0.0.1",
        "-m",
        "local",
    ]
    agent = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert agent.stdout is not None
        port = int(agent.stdout.readline().rpartition(":")[2])
        result, holder = _host_checks.agent_check("127.0.0.1", port)
        assert result.level is Level.FINE
        assert holder.endswith(f"(pid {agent.pid})")
    finally:
        agent.kill()
        agent.wait(20)
        if agent.stdout is not None:
            agent.stdout.close()
    result, _ = _host_checks.agent_check("127.0.0.1", port)
    assert result.level is Level.NOTE


def test_a_port_that_is_no_agents(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_host_checks, "port_holder", lambda protocol, port: "toaster (pid 12)")
    result, holder = _host_checks.agent_check("127.0.0.1", 8888)
    assert result.level is Level.WRONG
    assert "toaster (pid 12)" in result.what
    assert holder == ""


def test_the_command_as_a_whole(capsys: pytest.CaptureFixture[str]) -> None:
    status = main(["doctor", "--space", "local:"])
    out, err = capsys.readouterr()
    assert out.startswith("ok     muros ")
    assert out.rstrip().splitlines()[-1].startswith("nothing is wrong") == (status == 0)
    assert err == ""


def test_a_space_that_cannot_be_opened(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--space", "nowhere:"]) == 1
    out, err = capsys.readouterr()
    assert "thing" in out.splitlines()[-1]
    assert err.startswith("muros: 'nowhere:' names no data space engine")
    assert main(["doctor", "--space", "local:3", "-d", "4"]) == 2


def test_a_report_shows_what_others_named_escaped() -> None:
    assert report([Result(Level.NOTE, "a\x1b[1m", "b\n")]) == "note   a\\x1b[1m\n       -> b\\n"
