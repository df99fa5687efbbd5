"""The stubs: one set, complete."""

import importlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import omniORB
import pytest

from muros.rtc.corba import _stubs, install

VECTORS = Path(__file__).parents[2] / "vectors" / "rtc"


def _load(name: str) -> Any:
    return json.loads((VECTORS / name).read_text())


def test_every_type_of_the_rtc_world_is_there() -> None:
    missing = [name for name in _load("idl_types.json") if omniORB.findType(name) is None]
    assert not missing


def test_values_print_as_programs_write_them() -> None:
    stubs = _stubs.RTC
    value = stubs.TimedLong(stubs.Time(1, 2), 3)
    assert repr(value) == "RTC.TimedLong(tm=RTC.Time(sec=1, nsec=2), data=3)"


def test_members_are_called_as_in_the_rtc_world_of_today() -> None:
    for name, layout in _load("idl_types.json").items():
        if layout["kind"] == "struct":
            descriptor = omniORB.findType(name)
            assert list(descriptor[4::2]) == [member for member, _ in layout["members"]], name


def test_every_interface_has_its_operations() -> None:
    for name, interface in _load("idl_interfaces.json")["interfaces"].items():
        skeleton, reference = omniORB.skeletonMapping[name], omniORB.objrefMapping[name]
        for operation, types in interface["operations"].items():
            descriptor = skeleton._omni_op_d[operation]
            assert hasattr(reference, operation)
            assert len(descriptor[0]) == len(types["in"])
            assert len(descriptor[1] or ()) == len(types["out"] or ())


def test_programs_import_the_same_modules_by_their_usual_names() -> None:
    install()
    install()
    for name, module in _stubs.MODULES.items():
        assert importlib.import_module(name) is module
    assert importlib.import_module("BasicDataType_idl") is importlib.import_module(
        "rtctree.rtc.BasicDataType_idl"
    )
    assert _stubs.RTC.__spec__ is not None
    assert _stubs.RTC.__spec__.name == "rtctree.rtc.RTC"


def test_asking_for_the_room_does_not_bring_the_orb() -> None:
    program = (
        "import sys, muros.rtc, muros.rtc.corba as corba\ncorba.install()\n"
        "assert 'omniORB' not in sys.modules and 'rtctree' not in sys.modules\n"
        "import RTC\nassert 'omniORB' in sys.modules\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=30, check=False
    )
    assert done.returncode == 0, done.stderr


def test_unknown_names_are_attribute_errors() -> None:
    corba: Any = importlib.import_module("muros.rtc.corba")
    with pytest.raises(AttributeError, match="nothing_such"):
        _ = corba.nothing_such


def test_the_supplement_is_what_its_idl_says(tmp_path: Path) -> None:
    """After a change of idl/supplement.idl its stubs are to be made anew, as _stubs.py says."""
    room = Path(_stubs.__file__).parent
    compiler = Path(omniORB.__file__).parents[1] / "jeteve_omniorb" / "bin" / "omniidlrun.py"
    subprocess.run(
        [
            *(sys.executable, str(compiler), "-bpython", "-Wbpackage=rtctree.rtc"),
            *(f"-I{_stubs.IDL_FOLDER}", f"-C{tmp_path}", "supplement.idl"),
        ],
        cwd=room / "idl",
        check=True,
        timeout=30,
    )
    made = (tmp_path / "rtctree" / "rtc" / "supplement_idl.py").read_text()
    kept = (room / "_supplement_idl.py").read_text()
    assert kept.split("# Python stubs", 1)[1] == made.split("# Python stubs", 1)[1]
