"""`muros rtc new`: files, profiles, wrong wishes."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from muros.cli import main
from muros.rtc.profile_xml import read_profile_file

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
        '    my = Provided("SimpleService::MyService", idl="MyService.idl", port="MyService", instance="my")',
        '    their = Required("SimpleService::MyService", idl="MyService.idl", port="Other", instance="their")',
        "    def echo(self, msg):",
        "    def get_echo_history(self):",
        "    def set_value(self, value, from_):",
        "    def get_value(self, all_):",
        '    specification = {"exec_cxt.periodic.rate": "50"}',
        "    max_instance = 4",
    ):
        assert line in source.splitlines()
    assert (folder / "Turner/MyService.idl").read_text() == IDL


def test_the_profile_gives_the_same_component(folder: Path) -> None:
    assert main(["rtc", "new", "Turner", *ALL]) == 0
    assert main(["rtc", "new", "--profile", "Turner/RTC.xml", "--folder", "again"]) == 0
    assert (folder / "again/Turner.py").read_text() == (folder / "Turner/Turner.py").read_text()
    assert read_profile_file(folder / "again/RTC.xml") == read_profile_file(folder / "Turner/RTC.xml")
    assert (folder / "again/MyService.idl").read_text() == IDL


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
