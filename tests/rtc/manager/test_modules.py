"""Modules: found, listed without running them, loaded, unloaded."""

import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from muros.rtc.manager._modules import ModuleError, Modules
from muros.rtc.manager._spec_files import read_specs_untrusted
from muros.rtc.properties import Properties

OLD = """
import sys
VENDOR = "AIST"
oldstyle_spec = ["implementation_id", "OldStyle",
    "type_name",  "OldStyle",
    "vendor", VENDOR, "max_instance", "10",
    "conf.default.gain", "1.0", ""]
def OldStyleInit(manager):
    manager.append("old style")
def Other(manager):
    manager.append("other")
"""

NEW = '''
from muros.rtc.component import Component
class Wheel(Component):
    """Turns a wheel.

    And more."""
    vendor = "me"
    version: str = "2.0"
class _Helper: ...
'''


@pytest.fixture(autouse=True)
def _clean_imports() -> Iterator[None]:
    names, path = set(sys.modules), list(sys.path)
    yield
    sys.path[:] = path
    for name in set(sys.modules) - names:
        if name.startswith(("OldStyle", "NewStyle", "Broken", "json (")):
            del sys.modules[name]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "OldStyle.py").write_text(OLD)
    (tmp_path / "NewStyle.py").write_text(NEW)
    (tmp_path / "notes.txt").write_text(OLD)
    return tmp_path


def modules(folder: Path, **texts: str) -> Modules:
    return Modules(Properties({"load_path": str(folder), "abs_path_allowed": "YES", **texts}), folder)


def test_listing_runs_nothing(folder: Path) -> None:
    mark = folder / "mark"
    for name in ("OldStyle.py", "NewStyle.py"):
        with (folder / name).open("a") as file:
            file.write(f"\nopen({str(mark)!r}, 'w')\n")
    (folder / "Bad.py").write_text("class Bad(Component:")
    (folder / "Bin.py").write_bytes(b"\0\xff" * 100)
    new, old = modules(folder).loadable()
    assert old == {
        "implementation_id": "OldStyle",
        "type_name": "OldStyle",
        "vendor": "AIST",
        **dict.fromkeys(("category", "description", "version"), ""),  # tools want them
        "max_instance": "10",
        "conf.default.gain": "1.0",
        "module_file_name": "OldStyle.py",
        "module_file_path": str(folder / "OldStyle.py"),
    }
    assert (new["implementation_id"], new["vendor"], new["version"]) == ("Wheel", "me", "2.0")
    assert (new["description"], new["language"]) == ("Turns a wheel.", "Python")
    assert not mark.exists()


def test_a_file_is_read_again_when_it_has_changed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    known = modules(folder)
    before = known.loadable()
    with monkeypatch.context() as patched:
        patched.setattr("ast.parse", lambda source: pytest.fail("it has not changed"))
        assert known.loadable() == before
    (folder / "OldStyle.py").write_text(OLD.replace('"AIST"', '"somebody else"'))
    (folder / "NewStyle.py").unlink()
    (changed,) = known.loadable()
    assert changed["vendor"] == "somebody else"


def test_what_is_read_of_a_class_is_what_it_says_itself(folder: Path) -> None:
    loaded = modules(folder).load("NewStyle")
    (said,) = read_specs_untrusted(folder / "NewStyle.py")
    assert said == loaded.components[0].spec()


def test_tools_that_name_the_usual_function_load_the_new_style(folder: Path) -> None:
    assert modules(folder).load("NewStyle", "NewStyleInit").components


def test_classes_in_between_are_no_components(tmp_path: Path) -> None:
    path = tmp_path / "NewStyleParts.py"
    path.write_text(
        "from muros.rtc.component import Component\n"
        "class _Part(Component): ...\nclass Left(_Part): ...\nclass Right(Left): ...\n"
    )
    assert [spec["type_name"] for spec in read_specs_untrusted(path)] == ["Left", "Right"]
    loaded = modules(tmp_path).load("NewStyleParts")
    assert [component.__name__ for component in loaded.components] == ["Left", "Right"]


def test_a_list_that_is_computed_is_asked_of_another_process(tmp_path: Path) -> None:
    path = tmp_path / "Computed.py"
    path.write_text(
        "import os\nprint('hello')\ncomputed_spec = ['implementation_id'] + ['Comp' + 'uted', 'pid', os.getpid()]"
    )
    (spec,) = read_specs_untrusted(path)
    assert spec["implementation_id"] == "Computed"
    assert spec["pid"].isdigit()
    assert "Computed" not in sys.modules
    path.write_text("raise SystemExit(3)\ncomputed_spec = [] + []")
    assert read_specs_untrusted(path) == []


def test_a_file_that_never_ends_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("muros.rtc.manager._spec_files.ASK_TIME", 0.2)
    path = tmp_path / "Endless.py"
    path.write_text("while True: pass\nendless_spec = [] + []")
    begin = time.monotonic()
    assert read_specs_untrusted(path) == []
    assert time.monotonic() - begin < 30


def test_finding_a_module(folder: Path) -> None:
    assert modules(folder).find("OldStyle.py") == folder / "OldStyle.py"
    assert modules(folder).find("OldStyle") == folder / "OldStyle.py"
    assert modules(Path("/none"), load_path=f"/none, {folder}").find("OldStyle") == folder / "OldStyle.py"
    assert modules(folder, load_path="").find(str(folder / "OldStyle.py")) == folder / "OldStyle.py"
    with pytest.raises(ModuleError, match=r"^Nothing: not found in manager.modules.load_path \("):
        modules(folder).find("Nothing")
    with pytest.raises(ModuleError, match="names no module"):
        modules(folder).find(" ")


def test_absolute_paths_may_be_forbidden(folder: Path) -> None:
    (folder / "inner").mkdir()
    careful = modules(folder, abs_path_allowed="NO", load_path=str(folder / "inner"))
    with pytest.raises(ModuleError, match="absolute paths are not allowed here"):
        careful.find(str(folder / "OldStyle.py"))
    with pytest.raises(ModuleError, match="not found"):
        careful.find("../OldStyle.py")


def test_loading_the_old_style(folder: Path) -> None:
    known = modules(folder)
    loaded = known.load("OldStyle.py")
    done: list[str] = []
    assert loaded.init is not None
    loaded.init(done)
    assert done == ["old style"]
    assert known.load("OldStyle") is loaded
    assert known.loaded == (loaded,)
    assert loaded.properties()["file_path"] == str(folder / "OldStyle.py")
    assert known.unload("OldStyle") is loaded
    assert "OldStyle" not in sys.modules
    with pytest.raises(ModuleError, match="OldStyle is not loaded"):
        known.unload("OldStyle")
    again = known.load("OldStyle", "Other")
    assert again.init is not None
    again.init(done)
    assert done == ["old style", "other"]


def test_loading_the_new_style(folder: Path) -> None:
    loaded = modules(folder).load("NewStyle")
    assert loaded.init is None
    assert [component.__name__ for component in loaded.components] == ["Wheel"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("import nothing_of_that_name", r"Broken.py:1: ModuleNotFoundError: No module named"),
        ("\n\nraise ValueError", r"Broken.py:3: ValueError$"),
        ("def f():\n  1 1", r"Broken.py:2: SyntaxError: invalid syntax"),
        ("import sys\nsys.exit(1)", r"Broken.py:2: SystemExit: 1"),
        ("x = 1", r"no component in it: neither a function BrokenInit\(manager\) nor a class derived"),
    ],
)
def test_files_that_cannot_be_loaded(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "Broken.py").write_text(text)
    known = modules(tmp_path)
    with pytest.raises(ModuleError, match=message):
        known.load("Broken")
    assert known.loaded == ()
    assert text == "x = 1" or "Broken" not in sys.modules


def test_a_function_that_is_not_there(folder: Path) -> None:
    with pytest.raises(ModuleError, match="it has no function FooInit"):
        modules(folder).load("OldStyle", "FooInit")


def test_a_file_with_the_name_of_another_module(tmp_path: Path) -> None:
    (tmp_path / "json.py").write_text(NEW)
    before = sys.modules["json"]
    loaded = modules(tmp_path).load("json")
    assert loaded.module is not before
    assert sys.modules["json"] is before
