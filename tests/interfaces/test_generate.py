"""``muros interface`` and the packages it writes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from muros.cli import main


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    status = main(["interface", *words])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_show(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "show", "std_msgs/Header") == (
        0,
        "builtin_interfaces/Time stamp\nstring frame_id\n",
        "",
    )
    status, out, _ = run(capsys, "show", "std_msgs/Header", "std_srvs/SetBool")
    assert (status, out.splitlines()[0], out.splitlines()[-4]) == (0, "# std_msgs/msg/Header", "bool data")
    assert (
        "MSG: builtin_interfaces/Time\nint32 sec\n" in run(capsys, "show", "--full", "std_msgs/msg/Header")[1]
    )
    out = run(capsys, "show", "--hash", "std_srvs/srv/SetBool", "example_interfaces/Fibonacci")[1]
    assert out.splitlines()[:4] == [
        "std_srvs/srv/SetBool",
        "  RIHS01_abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a",
        "  md5 09fb03525b03e7ea1fd3992bafd87e16",
        "example_interfaces/action/Fibonacci",
    ]
    assert "class SetBool_Request(" in run(capsys, "show", "--code", "std_srvs/SetBool")[1]


def test_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "list", "std_srvs")[1].split() == [
        f"std_srvs/srv/{n}" for n in ("Empty", "SetBool", "Trigger")
    ]
    assert "std_msgs/msg/Int32\n" in run(capsys, "list")[1]
    assert "example_interfaces" in run(capsys, "list", "--packages")[1].split()
    assert run(capsys, "list", "nope")[::2] == (
        1,
        "muros: unknown package 'nope'; see muros interface list --packages\n",
    )


def test_own_folders_and_errors(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tool_msgs/msg").mkdir(parents=True)
    (tmp_path / "tool_msgs/msg/Probe.msg").write_text("# a probe\nint8 a # value\n")
    assert run(capsys, "show", "--path", "tool_msgs", "tool_msgs/Probe")[1] == "# a probe\nint8 a # value\n"
    (tmp_path / "tool_msgs/msg/Probe.msg").write_text("\n" * 6 + "flaot32 b")
    status, out, err = run(capsys, "show", "--path", "tool_msgs", "tool_msgs/Probe")
    assert (status, out) == (1, "")
    assert err == "muros: tool_msgs/msg/Probe.msg:7: unknown type 'flaot32' (did you mean float32?)\n"
    (tmp_path / "file").touch()
    assert run(capsys, "generate", "std_msgs/Int32", "-o", "file")[::2] == (
        1,
        "muros: file/std_msgs/msg: Not a directory\n",
    )


@pytest.mark.parametrize("board", [False, True])
def test_generated_packages_run(capsys: pytest.CaptureFixture[str], tmp_path: Path, board: bool) -> None:
    types = ("sensor_msgs/Imu", "example_interfaces/AddTwoInts", "example_interfaces/action/Fibonacci")
    options = ("--board", "--action-services") if board else ()
    status, out, _ = run(capsys, "generate", *types, "-o", str(tmp_path), *options)
    assert status == 0
    assert all(Path(line).is_file() for line in out.split())
    assert sorted(map(str, tmp_path.rglob("*.py"))) == sorted(out.split())
    program = """
import sensor_msgs
from sensor_msgs.msg import Imu
from example_interfaces.srv import AddTwoInts
from example_interfaces.action import Fibonacci
assert sensor_msgs.__file__.startswith(sys.argv[1])
imu = Imu()
imu.linear_acceleration.x = 2.0
body = bytearray(imu.size())
imu.write(body, 0)
again = Imu()
again.read(body, 0, len(body))
assert again.linear_acceleration.x == 2.0
if hasattr(imu, "serialize"):
    assert Imu.deserialize(imu.serialize(True, True), header=True) == imu == again
assert AddTwoInts.Request(a=1).a == 1 and Fibonacci.SendGoal.Request.TYPE.endswith("_SendGoal_Request")
"""
    subprocess.run(
        [sys.executable, "-W", "error", "-c", "import sys\n" + program, str(tmp_path)],
        cwd=tmp_path,
        check=True,
        timeout=50,
    )


def test_generated_host_packages_type_check(tmp_path: Path) -> None:
    api = pytest.importorskip("mypy.api")
    from muros.interfaces.host import generate

    generate(["geometry_msgs/msg/Twist", "example_interfaces/srv/AddTwoInts"], tmp_path)
    (tmp_path / "program.py").write_text(
        "from geometry_msgs.msg import Twist, Vector3\n"
        "speed: float = Twist(linear=Vector3(x=1.0)).linear.x\n"
        "wrong: str = Twist().linear.x\n"
        "data: bytes = Twist().serialize()\n"
    )
    out, _, _ = api.run(
        ["--strict", "--no-incremental", "--python-executable", sys.executable, str(tmp_path / "program.py")]
    )
    assert [line.split(": ", 1)[1] for line in out.splitlines() if "program.py" in line] == [
        'error: Incompatible types in assignment (expression has type "float", variable has type "str")  [assignment]'
    ]
