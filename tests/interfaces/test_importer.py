"""``from std_msgs.msg import Int32`` without ROS, each time in an interpreter of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

INSTALL = "from muros import _importer; _importer.install(); _importer.install()\nimport sys\n"


def python(program: str, folder: Path | None = None, **environment: str) -> str:
    """What a program prints, in a fresh interpreter with the importer installed."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", INSTALL + program],
        capture_output=True,
        text=True,
        timeout=50,
        check=False,
        cwd=folder,
        env={k: v for k, v in os.environ.items() if not k.startswith("MUROS_")} | environment,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def package(folder: Path, name: str = "my_msgs") -> Path:
    (folder / name / "msg").mkdir(parents=True)
    (folder / name / "srv").mkdir()
    (folder / name / "msg" / "Probe.msg").write_text("geometry_msgs/Point at\nfloat32 value 1.5\n")
    (folder / name / "msg" / "Bad.msg").write_text("int8 a\nflaot32 b\n")
    (folder / name / "srv" / "Ask.srv").write_text("Probe[] probes\n---\nbool done\n")
    return folder


def test_standard_types() -> None:
    program = """
before = set(sys.modules)
from std_msgs.msg import Int32, String
import sensor_msgs.msg
from example_interfaces.srv import AddTwoInts, AddTwoInts_Request
from example_interfaces.action import Fibonacci
import pickle
from muros.interfaces import message
assert Int32 is message("std_msgs/msg/Int32") and sensor_msgs.msg.Imu.TYPE == "sensor_msgs/msg/Imu"
assert AddTwoInts.Request is AddTwoInts_Request and Fibonacci.Goal(order=3).order == 3
assert pickle.loads(pickle.dumps(Int32(data=5))) == Int32(data=5)
assert "Header" in dir(sys.modules["std_msgs.msg"]) and not hasattr(sys.modules["std_msgs.msg"], "Nothing")
scope = {}
exec("from std_srvs.srv import *", scope)
assert scope["SetBool"].Response(success=True).success
assert not {"numpy", "asyncio"} & set(sys.modules)
print(Int32(data=5))
"""
    assert python(program) == "std_msgs.msg.Int32(data=5)\n"


def test_nothing_is_loaded_before_it_is_asked_for() -> None:
    program = """
try: import no_such_module_at_all
except ImportError: pass
print(sorted(name for name in sys.modules if name.startswith(("muros.", "rosbags", "numpy", "typing"))))
"""
    assert python(program) == "['muros._host', 'muros._importer', 'muros.compat']\n"


def test_what_is_missing_is_explained() -> None:
    program = """
for words in ("from std_msgs.msg import Int31", "import std_msgs.what",
    "import none_msgs", "from std_msgs.srv import X"):
    try: exec(words)
    except ImportError as error: print(type(error).__name__, error)
"""
    assert python(program).splitlines() == [
        "ImportError cannot import Int31 from std_msgs.msg: "
        "unknown type 'std_msgs/msg/Int31' (did you mean std_msgs/msg/Int32?)",
        "ModuleNotFoundError No module named 'std_msgs.what'",
        "ModuleNotFoundError No module named 'none_msgs'",
        "ImportError cannot import X from std_msgs.srv: unknown type 'std_msgs/srv/X'",
    ]


@pytest.mark.parametrize("name", ["my_msgs", "robot"])
def test_own_types_from_the_environment(tmp_path: Path, name: str) -> None:
    program = f"""
from {name}.msg import Probe
from {name}.srv import Ask
print(Probe(), Ask.Request(probes=[Probe()]).size())
try: from {name}.msg import Bad
except Exception as error: print(type(error).__name__, error)
"""
    folder = package(tmp_path, name)
    expected = [
        f"{name}.msg.Probe(at=geometry_msgs.msg.Point(x=0.0, y=0.0, z=0.0), value=1.5) 36",
        f"InterfaceError {name}/msg/Bad.msg:2: unknown type 'flaot32' (did you mean float32?)",
    ]
    for path in (folder, folder / name):
        for working in (folder, folder / name):
            assert python(program, working, MUROS_INTERFACES=str(path)).splitlines()[0] == expected[0]
    assert python(program, folder, MUROS_INTERFACES=name).splitlines() == expected


def test_own_types_added_by_the_program(tmp_path: Path) -> None:
    program = f"""
import muros.interfaces
muros.interfaces.add_path({str(package(tmp_path))!r})
from my_msgs.msg import Probe
print(Probe.TYPE)
"""
    assert python(program, tmp_path) == "my_msgs/msg/Probe\n"


def test_a_real_package_wins(tmp_path: Path) -> None:
    package(tmp_path)
    (tmp_path / "my_msgs/__init__.py").write_text("real = True\n")
    (tmp_path / "std_msgs").mkdir()
    (tmp_path / "std_msgs/__init__.py").write_text("real = True\n")
    program = "import my_msgs, std_msgs\nassert my_msgs.real and std_msgs.real\nprint('real')"
    assert python(program, tmp_path, MUROS_INTERFACES=str(tmp_path)) == "real\n"


def test_a_wrong_folder_in_the_environment_is_one_clear_error() -> None:
    program = """
from muros.interfaces import InterfaceError
try: import std_msgs.msg
except InterfaceError as error: print(error)
"""
    assert python(program, MUROS_INTERFACES="/nowhere") == "$MUROS_INTERFACES: /nowhere: no such folder\n"
    others = (
        "import muros.interfaces, json, wave\ntry: import no_such_thing\nexcept ImportError: print('as ever')"
    )
    assert python(others, MUROS_INTERFACES="/nowhere") == "as ever\n"
