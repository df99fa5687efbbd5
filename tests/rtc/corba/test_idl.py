"""Users' IDL: compiled, cached, imported."""

import importlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from muros.rtc.corba import IdlError, add_idl_folder, load_idl, remove_idl_folder

SERVICE = """
#include "BasicDataType.idl"
#include "%s"
// module NotThis {
module %s
{
  typedef sequence<string> EchoList;
  module Inner { struct Stamped { RTC::Time tm; %s::Gain gain; }; };
  interface MyService { string echo(in string text); EchoList history(); };
};
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    place = tmp_path / "component"
    place.mkdir()
    yield place
    remove_idl_folder(place)


def _write(folder: Path, name: str) -> Path:
    """An IDL file with the module NAME, which includes another one of the user's."""
    (folder / f"{name}Types.idl").write_text(f"module {name}Types {{ struct Gain {{ double value; }}; }};\n")
    path = folder / f"{name}.idl"
    path.write_text(SERVICE % (f"{name}Types.idl", name, f"{name}Types"))
    return path


def test_a_file_gives_its_modules(folder: Path) -> None:
    path = _write(folder, "Alpha")
    modules = load_idl(path)
    assert set(modules) >= {"Alpha", "Alpha__POA", "Alpha.Inner", "AlphaTypes"}
    assert importlib.import_module("Alpha") is modules["Alpha"]
    rtc = importlib.import_module("RTC")
    value = modules["Alpha.Inner"].Stamped(rtc.Time(1, 2), modules["AlphaTypes"].Gain(0.5))
    assert value.gain.value == 0.5
    assert modules["Alpha"].Inner is modules["Alpha.Inner"]
    assert load_idl(path) is modules


def test_programs_import_what_lies_beside_them(folder: Path) -> None:
    _write(folder / "", "Beta")
    (folder / "idl").mkdir()
    (folder / "idl" / "Plain.idl").write_text("interface BetaPlain { void f(); };\n")
    add_idl_folder(folder)
    add_idl_folder(folder)
    beta = importlib.import_module("Beta")
    assert importlib.import_module("Beta__POA").MyService
    assert importlib.import_module("Beta_idl").__file__
    assert beta.MyService
    assert importlib.import_module("_GlobalIDL__POA").BetaPlain
    for name in ("NotThis", "Gamma_idl", "Gamma"):
        with pytest.raises(ModuleNotFoundError):
            importlib.import_module(name)


def test_the_compiler_tells_file_and_line(folder: Path) -> None:
    path = folder / "Bad.idl"
    path.write_text("module Bad\n{\n  struct S { flaot32 x; };\n};\n")
    with pytest.raises(IdlError, match=r"Bad\.idl:3: .*flaot32"):
        load_idl(path)
    add_idl_folder(folder)
    with pytest.raises(IdlError, match=r"Bad\.idl:3"):
        importlib.import_module("Bad")
    with pytest.raises(IdlError, match=r"Missing\.idl"):
        load_idl(folder / "Missing.idl")
    (folder / "Lacks.idl").write_text('#include "Nowhere.idl"\nmodule Lacks { struct S { long x; }; };\n')
    with pytest.raises(IdlError, match=r"Nowhere\.idl"):
        load_idl(folder / "Lacks.idl")
    assert not list((folder.parent / "cache" / "muros" / "idl").iterdir())


def test_included_files_are_found_in_given_folders(folder: Path) -> None:
    other = folder / "common"
    other.mkdir()
    (other / "DeltaTypes.idl").write_text("module DeltaTypes { struct T { long x; }; };\n")
    path = folder / "Delta.idl"
    path.write_text("#include <DeltaTypes.idl>\nmodule Delta { struct S { DeltaTypes::T t; }; };\n")
    with pytest.raises(IdlError):
        load_idl(path)
    assert load_idl(path, [other])["Delta"].S


def test_two_files_of_one_name_do_not_hide_each_other(folder: Path) -> None:
    first, second = folder / "a", folder / "b"
    for place in (first, second):
        place.mkdir()
        (place / "Epsilon.idl").write_text(f"module Epsilon{place.name} {{ struct S {{ long x; }}; }};\n")
    load_idl(first / "Epsilon.idl")
    with pytest.raises(IdlError, match="Rename one"):
        load_idl(second / "Epsilon.idl")


def test_one_module_of_two_files(folder: Path) -> None:
    (folder / "ZetaOne.idl").write_text("module Zeta { struct One { long x; }; };\n")
    (folder / "ZetaTwo.idl").write_text("module Zeta { struct Two { long x; }; };\n")
    load_idl(folder / "ZetaOne.idl")
    zeta = load_idl(folder / "ZetaTwo.idl")["Zeta"]
    assert zeta.One(1).x == zeta.Two(1).x


def test_processes_that_compile_at_once_share_the_result(folder: Path) -> None:
    path = _write(folder, "Eta")
    program = f"from muros.rtc.corba import load_idl; print(load_idl({str(path)!r})['Eta'].MyService)"
    started = [
        subprocess.Popen(
            [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for _ in range(3)
    ]
    for process in started:
        out, err = process.communicate(timeout=30)
        assert "MyService" in out, err
    kept = list((folder.parent / "cache" / "muros" / "idl").iterdir())
    assert len(kept) == 1
    path.write_text(path.read_text() + "\n")
    load_idl(path)
    assert len(list(kept[0].parent.iterdir())) == 2


def test_a_cache_that_cannot_be_written_is_done_without(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocked = folder / "file"
    blocked.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    assert load_idl(_write(folder, "Theta"))["Theta"].MyService
