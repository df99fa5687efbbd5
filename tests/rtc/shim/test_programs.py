"""Components written for OpenRTM-aist-Python run unchanged: as programs, and in muros' manager."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import RTC
from muros.rtc.corba import NameServer, Orb
from OpenRTM_aist import CORBA_RTCUtil
from tests.rtc.shim.stage import COMPONENTS, Program, Stage, wait_for

ALL = ("ConsoleOut", "SeqIO", "ConfigSample", "MyServiceProvider", "MyServiceConsumer", "Turnstile")


@pytest.fixture(params=["python", "muros rtc run"])
def run(request: pytest.FixtureRequest, stage: Stage) -> object:
    """Each component's file as a program of its own, or all in one manager."""

    def start(*names: str) -> list[Program]:
        if request.param == "python":
            return [stage.python(name) for name in names]
        files = [str(COMPONENTS / f"{name}.py") for name in names]
        return [stage.muros("rtc", "run", *files)] * len(names)

    return start


def test_numbers_are_typed_and_printed(stage: Stage) -> None:
    console_in, console_out = stage.python("ConsoleIn"), stage.python("ConsoleOut", "--instance_name=Printer")
    console_in.said("made ConsoleIn0 ConsoleIn")
    assert stage.connect("ConsoleIn0.out", "Printer.in") == RTC.RTC_OK
    console_in.said("connector ON_CONNECT wire push True")
    stage.activate("ConsoleIn0", "Printer")
    console_out.said("before activation 0")
    console_out.said("activated at 100.0")
    for number in (3, -4):
        console_in.type(str(number))
        console_out.said(f"Received: {number * 2} stamped True")
        console_in.said(f"listener ON_SEND wire {number}")
    console_in.said("sent True")
    CORBA_RTCUtil.get_port_by_name(stage.component("ConsoleIn0"), "out").disconnect_all()
    console_in.said("connector ON_DISCONNECT wire push True")
    console_in.type("5")
    console_in.said("sent False")
    assert console_out.end() == 0


def test_sequences(run: object, stage: Stage) -> None:
    (program,) = run("SeqIO")  # type: ignore[operator]
    for port in ("Octet", "Long", "Double", "Text"):
        assert stage.connect(f"SeqOut0.{port}", f"SeqIn0.{port}") == RTC.RTC_OK
    stage.activate("SeqIn0", "SeqOut0")
    program.said("got [4, 4, 4] [4, -4] [2.0] number 4")
    assert program.end() == 0


def test_parameters(run: object, stage: Stage) -> None:
    (program,) = run("ConfigSample")  # type: ignore[operator]
    component = stage.component("ConfigSample0")
    stage.activate("ConfigSample0")
    program.said("values 0 0.11 hoge [0.0, 1.0, 2.0] 255")
    configuration = component.get_configuration()
    assert [one.id for one in configuration.get_configuration_sets()][:2] == ["default", "mode1"]
    configuration.activate_configuration_set("mode1")
    program.said("values 12345 0.11 hoge")
    program.said("parameter int_param0 12345")
    assert program.end() == 0


def test_services(run: object, stage: Stage) -> None:
    _, consumer = run("MyServiceProvider", "MyServiceConsumer")  # type: ignore[operator]
    assert stage.connect("MyServiceConsumer0.MyService", "MyServiceProvider0.MyService") == RTC.RTC_OK
    stage.activate("MyServiceConsumer0", "MyServiceProvider0")
    consumer.said("history ['call 1', 'call 2', 'call 3'] [0.5, 1.0, 1.5]")
    assert [line for line in consumer.lines if line.startswith("echo")] == [
        "echo call 1 0.5",
        "echo call 2 1.0",
        "echo call 3 1.5",
    ]


def test_state_machines(run: object, stage: Stage) -> None:
    machine, seq = run("Turnstile", "SeqIO")  # type: ignore[operator]
    machine.said("locked")
    assert stage.connect("SeqOut0.Text", "Turnstile0.event", name="coin") == RTC.BAD_PARAMETER, (
        "another data type"
    )
    assert stage.connect("SeqOut0.Text", "Turnstile0.event", name="explode") == RTC.BAD_PARAMETER
    console = stage.python("ConsoleIn")
    assert stage.connect("ConsoleIn0.out", "Turnstile0.event", fsm_event_name="coin") == RTC.RTC_OK
    stage.activate("Turnstile0", "ConsoleIn0")
    for cents in (20, 30):
        console.type(str(cents))
    machine.said("unlocked with 50")
    assert stage.connect("SeqOut0.Text", "Turnstile0.event", name="push") == RTC.RTC_OK
    stage.activate("SeqOut0")
    wait_for(lambda: machine.lines.count("locked") >= 2, lambda: str(machine.lines))
    assert seq is not None
    console.type("1")
    assert machine.end() == 0
    machine.said("finalized")


def test_all_in_a_daemon_by_their_modules(stage: Stage) -> None:
    """As `rtcd` loads them: by the init functions, made by requests."""
    preload = ",".join(f"{name}.py" for name in ALL)
    stage.muros(
        "rtcd",
        *("-o", f"manager.modules.load_path:{COMPONENTS}"),
        *("-o", f"manager.modules.preload:{preload}"),
        *(
            "-o",
            "manager.components.precreate:ConsoleOut?instance_name=Left,SeqOut,Turnstile,MyServiceConsumer",
        ),
    )
    for name in ("Left", "SeqOut0", "Turnstile0", "MyServiceConsumer0"):
        profile = stage.component(name).get_component_profile()
        assert profile.instance_name == name
        assert profile.category == "example"
        assert profile.vendor == "muros"


def test_a_program_finds_components_and_works_them(stage: Stage) -> None:
    """Each function that manuals of OpenRTM-aist-Python 2 tell of."""
    for name in ("ConsoleIn", "ConsoleOut", "ConfigSample", "MyServiceProvider"):
        stage.python(name)
        stage.component(f"{name}0")
    program = stage.python("Operator", stage.names)
    assert program.over() == 0, program.lines
    told = program.lines[program.lines.index("nowhere []") :]
    assert told[:21] == [
        "nowhere []",
        "ports 0 0",
        "connect RTC_OK",
        "names ['first']",
        "names ['first']",
        "joined True",
        "again RTC_OK",
        "end RTC_OK",
        "multi RTC_OK",
        "end RTC_OK",
        "by name RTC_OK",
        "activate RTC_OK",
        "state True ACTIVE_STATE True False",
        "deactivate RTC_OK PRECONDITION_NOT_MET",
        "rate 20.0",
        "rate 50.0",
        "attach RTC_OK",
        "participant 0 ConsoleIn0",
        "detach RTC_OK []",
        "set True",
        "set True",
    ]
    assert {"set False", "active mode1", "int_param0: 12345", "str_param0: test", "default 7"} < set(told)
    assert told[-5:] == [
        "key 12345",
        "in ['ConsoleOut0.in'] out ['ConsoleIn0.out']",
        "service ['MyServiceProvider0.MyService'] all ['MyServiceProvider0.MyService']",
        "all gone RTC_OK",
        "names []",
    ]


def test_the_program_of_the_guide(stage: Stage) -> None:
    guide = Path(__file__).parents[3] / "docs" / "rtc-old-components.md"
    (text,) = re.findall(r"```python\n(.*?)```", guide.read_text("utf-8"), re.DOTALL)
    for name in ("ConsoleIn", "ConsoleOut"):
        stage.python(name)
        stage.component(f"{name}0")
    program = stage.script(text.replace("//localhost/", f"//{stage.names}/") + "\nprint(there, state)\n")
    assert program.over() == 0, program.lines
    assert program.lines[-1] == "True ACTIVE_STATE"
    assert CORBA_RTCUtil.get_connector_names(stage.component("ConsoleOut0"), "in") == ["wire"]


def test_a_program_without_a_manager_connects(stage: Stage) -> None:
    console_in, console_out = stage.python("ConsoleIn"), stage.python("ConsoleOut")
    for name in ("ConsoleIn0", "ConsoleOut0"):
        stage.component(name)
    program = stage.python("Connector", stage.names)
    assert program.over() == 0, program.lines
    assert program.lines[-1] == "connected RTC_OK flush"
    console_out.said("activated at 100.0")
    console_in.type("21")
    console_out.said("Received: 42")


def test_a_component_that_starts_itself(stage: Stage) -> None:
    program = stage.python("SelfStarter")
    program.said("active set default 2")
    program.said("same True")
    program.said("written True 1")
    program.said("listener loop 5")
    program.said("received 105")
    program.said("finished SelfStarter0")
    # All that may have happened before its main thread came to `runManager`: so it is no signal that ends it.
    assert stage.component("SelfStarter0").exit() == RTC.RTC_OK
    assert program.over() == 0, program.lines


def test_a_signal_while_components_are_made(stage: Stage, orb: Orb) -> None:
    """All is taken back, then as ever."""
    program = stage.script(
        "import os, signal, sys, OpenRTM_aist\n"
        f"sys.path.insert(0, {str(COMPONENTS)!r})\n"
        "from ConsoleOut import ConsoleOutInit\n"
        "def init(manager):\n"
        "    ConsoleOutInit(manager)\n"
        "    print('made', manager.createComponent('ConsoleOut') is not None)\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
        "manager = OpenRTM_aist.Manager.init(sys.argv)\n"
        "manager.setModuleInitProc(init)\n"
        "manager.activateManager()\n"
        "print('activated')\n"
        "manager.runManager()\n"
    )
    assert program.over() == 0, program.lines
    assert [line for line in program.lines if line in ("made True", "activated")] == [
        "made True",
        "activated",
    ]
    assert list(NameServer(orb, stage.names).walk()) == []
