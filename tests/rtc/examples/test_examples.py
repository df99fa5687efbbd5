"""The examples for RT components, as users run them."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from omniORB import any

from muros.rtc.corba import Orb, RunningNameServer
from muros.rtc.corba._world import CorbaWorld
from tests.dds.domains import free_domain
from tests.rtc.manager._processes import ENVIRONMENT, Managers, wait_until, world_beside

VECTORS = Path(__file__).parents[2] / "vectors" / "rtc"
EXAMPLES = Path(__file__).parents[3] / "examples" / "rtc"


@pytest.fixture
def managers(tmp_path: Path, name_server: RunningNameServer) -> Iterator[Managers]:
    with Managers(tmp_path, name_server.address) as made:
        yield made


@pytest.fixture
def world(orb: Orb, name_server: RunningNameServer) -> Iterator[CorbaWorld]:
    with world_beside(name_server.address) as made:
        yield made


def run(managers: Managers, file: str, *words: str) -> subprocess.Popen[str]:
    """`muros rtc run` of an example."""
    return managers.start(*words, command=("rtc", "run", str(EXAMPLES / file)))


def component(world: CorbaWorld, name: str) -> Any:
    """A component by its name, as tools have it."""
    return world._component_at(f"rtcname://*/{name}")


def connect(world: CorbaWorld, one: str, other: str, **properties: str) -> None:
    """Connect `Component.port` with `Component.port`, as rtcon does."""
    given = {"dataport.dataflow_type": "push", "dataport.interface_type": "corba_cdr"}
    given.update({f"dataport.{key}": text for key, text in properties.items()})
    world.connect([f"rtcname://*/{one}", f"rtcname://*/{other}"], {}, "test", given)


def activate(world: CorbaWorld, *names: str) -> None:
    for name in names:
        world.activate_at(f"rtcname://*/{name}")


def test_console(managers: Managers, world: CorbaWorld) -> None:
    outlet = run(managers, "console_out.py")
    words = managers.command(command=("rtc", "run", str(EXAMPLES / "console_in.py")))
    piped = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    with subprocess.Popen(words, text=True, env=ENVIRONMENT, cwd=managers.folder, **piped) as inlet:  # type: ignore[call-overload]
        try:
            wait_until(lambda: world.instance_names() == {"ConsoleIn0", "ConsoleOut0"})
            connect(world, "ConsoleIn0.out", "ConsoleOut0.in", subscription_type="flush")
            activate(world, "ConsoleOut0", "ConsoleIn0")
            assert inlet.stdin is not None
            inlet.stdin.write("42\nmany\n-7\n")
            inlet.stdin.flush()
            managers.wait_for(outlet, ": 42\n")
            managers.wait_for(outlet, ": -7\n")
            inlet.stdin.close()  # the component becomes inactive, it does not end
            inner = component(world, "ConsoleIn0")
            context = inner.get_owned_contexts()[0]
            wait_until(lambda: context.get_component_state(inner)._v == 1)
        finally:
            inlet.terminate()
            said = inlet.stdout.read() if inlet.stdout is not None else ""
    assert "'many' is no whole number" in said
    assert inlet.returncode == 0


def test_sequences(managers: Managers, world: CorbaWorld) -> None:
    inlet = run(managers, "seq_in.py")
    run(managers, "seq_out.py", "-o", "example.SequenceOutComponent.conf.default.length:3")
    wait_until(lambda: len(world.instance_names()) == 2)
    names = [f"{name}{seq}" for seq in ("", "Seq") for name in ("Octet", "Short", "Long", "Float", "Double")]
    for name in names:
        connect(
            world, f"SequenceOutComponent0.{name}", f"SequenceInComponent0.{name}", subscription_type="new"
        )
    activate(world, "SequenceInComponent0", "SequenceOutComponent0")
    for name in names:
        managers.wait_for(inlet, f"{name}: ")
    (line, *_) = (line for line in managers.said(inlet).splitlines() if line.startswith("LongSeq: "))
    assert line.count(",") == 2


def test_configuration(managers: Managers, world: CorbaWorld) -> None:
    sample = run(managers, "config_sample.py", "-f", str(EXAMPLES / "config_sample.conf"))
    wait_until(lambda: world.instance_names() == {"ConfigSample0"})
    captured = json.loads((VECTORS / "component_configsample.json").read_text())["component_profile"][
        "properties"
    ]
    profile = component(world, "ConfigSample0").get_component_profile()
    ours = {one.name for one in profile.properties}
    told = {one["name"] for one in captured}
    # What is not told: no configuration file, no set mode1.vector..., addresses of the ORB, the services of all.
    assert {name for name in told - ours if not name.startswith("conf.")} <= {
        *("port", "config_file", "corba.endpoints_ipv4", "corba.endpoints_ipv6"),
        *("sdo.service.consumer.available_services", "sdo.service.provider.available_services"),
    }
    activate(world, "ConfigSample0")
    managers.wait_for(sample, "123 | 1 | 0.11 | 9.9 | mode0 | dara | [0.0, 0.1, 0.2]\n")
    configuration = component(world, "ConfigSample0").get_configuration()
    assert configuration.activate_configuration_set("mode1")
    managers.wait_for(sample, "set mode1 is active now\n")
    managers.wait_for(
        sample, "-9 | 1 | 0.11 | 9.9 | mode1 | dara | [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]\n"
    )
    assert configuration.activate_configuration_set("default")
    managers.wait_for(
        sample, "0 | 1 | 0.99 | 9.9 | hoge | default set in conf file | [0.0, 1.0, 2.0, 3.0, 4.0]\n"
    )


def test_service(managers: Managers, world: CorbaWorld) -> None:
    provider = run(managers, "my_service_provider.py")
    consumer = run(managers, "my_service_consumer.py", "-o", "exec_cxt.periodic.rate:20")
    wait_until(lambda: len(world.instance_names()) == 2)
    activate(world, "MyServiceConsumer0")
    managers.wait_for(consumer, "onnect")  # it says that it is not connected
    connect(world, "MyServiceProvider0.MyService", "MyServiceConsumer0.MyService")
    managers.wait_for(consumer, "the provider is not active")
    activate(world, "MyServiceProvider0")
    managers.wait_for(provider, "echo: hello ")
    managers.wait_for(consumer, "\nhello ")


WATCHER = """
from RTC import TimedLong
from muros.rtc import Component, InPort
class Watcher(Component):
    count = InPort(TimedLong)
    def on_execute(self, context):
        if self.count.is_new():
            print(f"at {self.count.read().data}", flush=True)
"""


def test_servo(managers: Managers, world: CorbaWorld) -> None:
    """The motor turns to the target, and to another when that is changed."""
    (managers.folder / "watcher.py").write_text(WATCHER)
    run(managers, "servo.py", "-f", str(EXAMPLES / "servo.conf"), "-o", "logger.log_level:INFO")
    watcher = managers.start(command=("rtc", "run", str(managers.folder / "watcher.py")))
    wait_until(lambda: world.instance_names() == {"Motor0", "Encoder0", "Controller0", "Watcher0"})
    connect(world, "Encoder0.count", "Watcher0.count", subscription_type="new")
    activate(world, "Watcher0")
    managers.wait_for(watcher, "at 512\n")  # 45 degrees of 4096 steps
    configuration = component(world, "Controller0").get_configuration()
    changed = configuration.get_configuration_set("default")
    for value in changed.configuration_data:
        if value.name == "target":
            value.value = any.to_any("90")
    configuration.set_configuration_set_values(changed)
    configuration.activate_configuration_set("default")
    managers.wait_for(watcher, "at 1024\n")


def test_a_topic_of_ros_2(managers: Managers, world: CorbaWorld) -> None:
    """What is published on the topic comes out of the port."""
    (managers.folder / "watcher.py").write_text(WATCHER.replace("TimedLong", "TimedDouble"))
    with free_domain() as domain:
        environment = {"ROS_DOMAIN_ID": str(domain)}
        reader = managers.start(
            *("-f", str(EXAMPLES / "topic_to_port.conf"), "-o", "example.TopicToPort.conf.default.factor:2"),
            command=("rtc", "run", str(EXAMPLES / "topic_to_port.py")),
            environment=environment,
        )
        watcher = managers.start(command=("rtc", "run", str(managers.folder / "watcher.py")))
        wait_until(lambda: world.instance_names() == {"TopicToPort0", "Watcher0"})
        connect(world, "TopicToPort0.out", "Watcher0.count", subscription_type="new")
        activate(world, "Watcher0")
        publisher = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "muros",
                "topic",
                "pub",
                "/speed",
                "std_msgs/msg/Float64",
                "{data: 1.5}",
                "-r",
                "20",
            ],
            stdout=subprocess.DEVNULL,
            env={**ENVIRONMENT, **environment},
        )
        try:
            managers.wait_for(watcher, "at 3.0\n")
        finally:
            publisher.terminate()
            publisher.wait()
        assert "not connected" not in managers.said(reader)
