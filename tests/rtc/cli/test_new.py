"""`muros rtc new`: files, profiles, wrong wishes."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from muros.cli import main
from muros.rtc.profile_xml import DataPortProfile, read_profile_file, read_profile_untrusted
from tests.rtc.manager._processes import ENVIRONMENT

SHIM = Path(__file__).parents[1] / "shim" / "components"

IDL = """
// a service
module SimpleService {
  typedef sequence<string> EchoList;
  interface MyService {
    string echo(in string msg);
    EchoList get_echo_history(); /* all of it */
    oneway void set_value(in float value,
                          in long from);
    float get_value(out string unit, inout SimpleService::EchoList all_);
  };
};
"""

ALL = [
    *("--inport", "in:TimedLong", "--outport", "out:TimedDouble", "--outport", "port:TimedDoubleSeq"),
    *("--config", "gain:double:1.0:0<=x<=10:slider.0.1", "--config", "names:vector<string>:a,b"),
    *("--config", "on:bool:true", "--config", "count:int:3", "--config", "text:string:say \"hi\""),
    *("--service", "MyService:my:SimpleService::MyService", "--service-idl", "MyService.idl"),
    *("--consumer", "Other:their:SimpleService::MyService", "--consumer-idl", "MyService.idl"),
    *("--description", "Turns \"things\".", "--vendor", "us", "--category", "test", "--version", "1.2.3"),
    *("--max-instances", "4", "--rate", "50"),
]  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "MyService.idl").write_text(IDL)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def muros(*words: str) -> subprocess.CompletedProcess[str]:
    """The command as a process of its own: an ORB is one for each process."""
    command = [sys.executable, "-m", "muros", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=50, env=ENVIRONMENT)


def test_everything_at_once(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rtc", "new", "Turner", *ALL]) == 0
    out, err = capsys.readouterr()
    assert out.split() == [
        "Turner/Turner.py",
        "Turner/RTC.xml",
        "Turner/test_Turner.py",
        "Turner/MyService.idl",
    ]
    assert err == "run it with: muros rtc run Turner/Turner.py\n"
    source = (folder / "Turner/Turner.py").read_text()
    ast.parse(source)
    for line in (
        "from RTC import TimedDouble, TimedDoubleSeq, TimedLong",
        "from muros.rtc import Component, InPort, OutPort, Parameter, Provided, Required, run",
        '    in_ = InPort(TimedLong, name="in")',
        "    out = OutPort(TimedDouble)",
        '    port_ = OutPort(TimedDoubleSeq, name="port")',
        '    gain = Parameter(1.0, constraint="0<=x<=10", widget="slider.0.1")',
        '    names = Parameter(["a", "b"])',
        "    on = Parameter(True)",
        "    count = Parameter(3)",
        '    text = Parameter("say \\"hi\\"")',
        '    my = Provided("SimpleService::MyService", idl="MyService.idl", port="MyService", instance="my", '
        'type_name="SimpleService::MyService")',
        '    their = Required("SimpleService::MyService", idl="MyService.idl", port="Other", instance="their", '
        'type_name="SimpleService::MyService")',
        "    def echo(self, msg):",
        "    def get_echo_history(self):",
        "    def set_value(self, value, from_):",
        "    def get_value(self, all_):",
        "    rate = 50",
        "    max_instance = 4",
    ):
        assert line in source.splitlines()
    assert (folder / "Turner/MyService.idl").read_text() == IDL


def test_names_may_be_alike_and_numbers_beyond_all(folder: Path) -> None:
    words = ["--inport", "a:TimedLong", "--config", "a:double:1", "--config", "b:vector<double>:inf,-1,nan"]
    assert main(["rtc", "new", "A", *words, "--service", "S:a:I", "--service-idl", "MyService.idl"]) == 0
    source = (folder / "A/A.py").read_text()
    for line in (
        "    a = InPort(TimedLong)",
        '    a_ = Parameter(1.0, name="a")',
        '    b = Parameter([float("inf"), -1.0, float("nan")])',
        '    a__ = Provided("I", idl="MyService.idl", port="S", instance="a")',
    ):
        assert line in source.splitlines()


def test_the_profile_gives_the_same_component(folder: Path) -> None:
    assert main(["rtc", "new", "Turner", *ALL]) == 0
    assert main(["rtc", "new", "--profile", "Turner/RTC.xml", "--folder", "again"]) == 0
    assert (folder / "again/Turner.py").read_text() == (folder / "Turner/Turner.py").read_text()
    assert read_profile_file(folder / "again/RTC.xml") == read_profile_file(folder / "Turner/RTC.xml")
    assert (folder / "again/MyService.idl").read_text() == IDL


def test_the_component_gives_the_profile(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """From the words to a profile and a component, and from the component to a profile that says the same."""
    assert main(["rtc", "new", "Turner", *ALL]) == 0
    capsys.readouterr()
    done = muros("rtc", "profile", "Turner/Turner.py")
    assert (done.returncode, done.stderr) == (0, "")
    again = read_profile_untrusted(done.stdout.encode(), "printed")
    written = read_profile_file(folder / "Turner/RTC.xml")
    assert [port.name for port in again.data_ports] == ["in", "out", "port"]
    assert again.data_ports == written.data_ports
    assert [one.name for one in again.parameters] == [one.name for one in written.parameters]
    assert again.parameters[0] == written.parameters[0]
    assert again.id == written.id
    assert (again.execution_rate, again.max_instances) == (50.0, 4)
    assert again.actions["OnExecute"]
    assert not again.actions["OnError"]
    for ours, theirs in zip(again.service_ports, written.service_ports, strict=True):
        (one,), (other,) = ours.interfaces, theirs.interfaces
        assert (ours.name, one.instance_name, one.provided) == (
            theirs.name,
            other.instance_name,
            other.provided,
        )


def test_profiles_of_other_components(folder: Path) -> None:
    done = muros("rtc", "profile", str(SHIM / "ConsoleOut.py"))
    profile = read_profile_untrusted(done.stdout.encode(), "printed")
    assert profile.data_ports == (DataPortProfile("in", "DataInPort", "RTC::TimedLong"),)
    assert profile.actions["OnExecute"]
    assert not profile.actions["OnReset"]
    (folder / "two.py").write_text(
        "from muros.rtc import Component\nclass A(Component): ...\nclass B(Component): ..."
    )
    assert muros("rtc", "profile", "two.py").stderr == "muros: two.py has A, B; choose one with --kind\n"
    assert ":B:" in muros("rtc", "profile", "two.py", "--kind", "B").stdout
    assert muros("rtc", "profile", "none.py").stderr == f"muros: {folder}/none.py: no such file\n"


def test_nothing_is_written_over(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rtc", "new", "A"]) == 0
    (folder / "A/A.py").write_text("mine")
    assert main(["rtc", "new", "A"]) == 2
    assert "A/A.py, A/RTC.xml, A/test_A.py: there already; choose another --folder" in capsys.readouterr().err
    assert (folder / "A/A.py").read_text() == "mine"
    assert main(["rtc", "new", "A", "--force"]) == 0
    assert (folder / "A/A.py").read_text() != "mine"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "name the component, or give --profile RTC.xml"),
        (["class"], "'class' cannot be the name of a class"),
        (["a-b"], "'a-b' cannot be the name of a class"),
        (["A", "--inport", "in"], "--inport in: write NAME:TYPE"),
        (["A", "--inport", "i n:TimedLong"], "'i n' cannot be the name of a port"),
        (["A", "--inport", "a:TimedLong", "--outport", "a:TimedLong"], "there are two ports 'a'"),
        (["A", "--inport", "a:Timed Long"], "port a: 'RTC::Timed Long' is no data type"),
        (["A", "--config", "gain:double"], "--config gain:double: write NAME:TYPE:DEFAULT"),
        (["A", "--config", "gain:double:fast"], "parameter gain: 'fast' is no double"),
        (["A", "--config", "on:bool:2"], "parameter on: '2' is no bool"),
        (["A", "--config", "a:int:1", "--config", "a:double:2"], "there are two parameters 'a'"),
        (["A", "--rate", "0"], "0 is no rate of an execution context"),
        (["A", "--rate", "nan"], "nan is no rate of an execution context"),
        (["A", "--service", "a:b c:C", "--service-idl", "x"], "'b c' cannot be the name of an interface"),
        (["A", "--service", "a:b", "--service-idl", "x"], "--service a:b: write PORT:INSTANCE:TYPE"),
        (["A", "--service", "a:b:C"], "--service-idl: give one IDL file for all"),
        (["A", "--service", "a:b:C", "--service-idl", "none.idl"], "none.idl: cannot be read: No such file"),
        (["--profile", "none.xml"], "none.xml: cannot be read: No such file"),
    ],
)
def test_wrong_wishes(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    assert main(["rtc", "new", *words]) == 2
    assert f"muros: {message}" in capsys.readouterr().err
    assert [path.name for path in folder.iterdir()] == ["MyService.idl"]


def test_the_written_test_passes(folder: Path) -> None:
    """Twice: once all at once, and once nothing but a name."""
    assert main(["rtc", "new", "Turner", *ALL]) == 0
    assert main(["rtc", "new", "Bare"]) == 0
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "Turner", "Bare"],
        capture_output=True,
        text=True,
        timeout=50,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "4 passed" in done.stdout


DERIVED = """
#include "MyService.idl"
#include <BasicDataType.idl>
module Better {
  exception Failed { string why; };
  interface Plain;
  interface Named { readonly attribute string label, place; };
  interface BetterService : SimpleService::MyService, Named {
    void reset(in long from_, out long to) raises (Failed);
  };
};
"""


def test_operations_are_inherited_and_included_files_come_along(folder: Path) -> None:
    """The component runs: nothing that its interface has is missing."""
    (folder / "Better.idl").write_text(DERIVED)
    wishes = ["--service", "Best:best:Better::BetterService", "--service-idl", "Better.idl"]
    assert main(["rtc", "new", "Server", *wishes]) == 0
    lines = (folder / "Server/Server.py").read_text().splitlines()
    methods = [line.strip() for line in lines if line.startswith("    def ") and "context" not in line]
    assert methods == [
        "def reset(self, from_):",
        "def echo(self, msg):",
        "def get_echo_history(self):",
        "def set_value(self, value, from_):",
        "def get_value(self, all_):",
    ]
    assert [line for line in lines if line.endswith(" = None")] == ["    label = None", "    place = None"]
    assert (folder / "Server/MyService.idl").read_text() == IDL
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "Server"],
        capture_output=True,
        text=True,
        timeout=50,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_data_types_of_a_users_own_come_along_with_the_profile(folder: Path) -> None:
    (folder / "Mine.idl").write_text(
        '#include "BasicDataType.idl"\nmodule Mine { struct Item { RTC::Time tm; long data; }; };'
    )
    assert main(["rtc", "new", "Taker", "--inport", "item:Mine::Item", "--idl", "Mine.idl"]) == 0
    assert main(["rtc", "new", "--profile", "Taker/RTC.xml", "--folder", "again"]) == 0
    assert (folder / "again/Mine.idl").read_text() == (folder / "Mine.idl").read_text()
    assert (folder / "again/Taker.py").read_text() == (folder / "Taker/Taker.py").read_text()
