"""Settings of a manager: files, options, defaults."""

from pathlib import Path

import pytest

from muros.rtc.manager._settings import Options, parse_options, read_settings
from muros.rtc.properties import ConfError, Properties


def settings(folder: Path, *argv: str, environment: dict[str, str] | None = None) -> Properties:
    return read_settings(
        parse_options(argv), environment=environment or {}, folder=folder, system_files=[folder / "etc.conf"]
    ).properties


def test_all_options() -> None:
    argv = [
        "-a",
        "-d",
        "-i",
        "-f",
        "my.conf",
        "-p",
        "2811",
        "-o",
        "a.b: c:d ",
        "-o",
        "e:",
        "Comp.py",
        "--instance_name=Left",
    ]
    assert parse_options(argv) == Options(
        "my.conf",
        True,
        {
            "manager.corba_servant": "NO",
            "manager.is_master": "YES",
            "corba.endpoints": ":2811",
            "a.b": "c:d",
            "e": "",
        },
        ("Comp.py",),
        "Left",
    )


@pytest.mark.parametrize(
    ("argv", "message"),
    [
        (["-x"], r"option -x not recognized; the options are -a, -d, -f FILE, -i, -o KEY:VALUE and -p PORT"),
        (["-o", "key"], r"-o key: write it as KEY:VALUE, such as -o logger.log_level:DEBUG"),
        (["-p", "http"], r"-p http: a port is a number from 0 to 65535"),
        (["-p", "65536"], r"-p 65536: a port is a number from 0 to 65535"),
    ],
)
def test_wrong_options(argv: list[str], message: str) -> None:
    with pytest.raises(ConfError, match=message):
        parse_options(argv)


def test_the_first_file_there_is(tmp_path: Path) -> None:
    def number(*argv: str, environment: dict[str, str] | None = None) -> str:
        return settings(tmp_path, *argv, environment=environment).get("n", "none")

    env = {"RTC_MANAGER_CONFIG": "env.conf"}
    assert number() == "none"
    (tmp_path / "etc.conf").write_text("n: etc")
    assert number() == "etc"
    (tmp_path / "rtc.conf").write_text("n: here")
    assert number() == "here"
    (tmp_path / "env.conf").write_text("n: environment")
    assert number(environment=env) == "environment"
    (tmp_path / "f.conf").write_text("n: f")
    assert number("-f", "f.conf", environment=env) == "f"
    assert number("-f", "f.conf", "-o", "n:option", environment=env) == "option"


def test_files_asked_for_but_not_there(tmp_path: Path) -> None:
    with pytest.raises(
        ConfError, match=r"^none.conf \(-f\): no such file; mend the name, or give -i to go on without"
    ):
        settings(tmp_path, "-f", "none.conf")
    with pytest.raises(ConfError, match=r"^e.conf \(\$RTC_MANAGER_CONFIG\): no such file"):
        settings(tmp_path, environment={"RTC_MANAGER_CONFIG": "e.conf"})
    (tmp_path / "rtc.conf").write_text("n: here")
    assert "n" not in settings(tmp_path, "-i", "-f", "none.conf")


def test_defaults_stand_behind_everything(tmp_path: Path) -> None:
    properties = settings(tmp_path)
    assert properties["naming.formats"] == "%h.host_cxt/%n.rtc"
    assert properties.number("manager.auto_shutdown_duration", 0) == 20.0
    assert properties.flag("manager.shutdown_on_nortcs")
    assert properties.node("logger")["log_level"] == "INFO"
    assert properties["manager.pid"].isdigit()


def test_the_instance_of_a_manager_has_its_name(tmp_path: Path) -> None:
    assert settings(tmp_path)["manager.instance_name"] == "manager"
    assert settings(tmp_path, "-o", "manager.name:left")["manager.instance_name"] == "left"
    both = settings(tmp_path, "-o", "manager.name:left", "-o", "manager.instance_name:right")
    assert (both["manager.name"], both["manager.instance_name"]) == ("left", "right")
