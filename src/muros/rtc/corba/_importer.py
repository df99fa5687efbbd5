"""``import RTC`` finds the stubs, ``import SimpleService`` a user's IDL file: what `sys.meta_path` needs for it.

Only this is imported when a program asks for `muros.rtc`; the ORB and the stubs come with the first import that
needs them. Names of the RTC world are looked for before anything else, for there must be one set of stubs
(`_stubs.py`); users' IDL only after all else, so that stubs that a user has compiled are theirs to keep.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from importlib.abc import Loader
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import Final

__all__ = ["add_idl_folder", "install", "remove_idl_folder"]

MODULE_NAMES: Final = frozenset(
    name + suffix for name in ("RTC", "OpenRTM", "SDOPackage", "RTM", "CSP") for suffix in ("", "__POA")
)
"""The modules that rtctree-aist has stubs for, or the supplement."""

FILE_NAMES: Final = frozenset(
    name + "_idl"
    for name in (
        "BasicDataType ComponentObserver DataPort ExtendedDataTypes ExtendedFsmService InterfaceDataTypes Logger "
        "Manager OpenRTM RTC SDOPackage"
    ).split()
)
"""What stubs of users' IDL import for the files they include."""

_MODULE: Final = re.compile(r"^[^/\n]*\bmodule\s+(\w+)", re.MULTILINE)

_folders: list[Path] = []


def install() -> None:
    """Let programs import the modules of the RTC world, and of IDL files in `add_idl_folder`. Twice is once."""
    if _STUBS not in sys.meta_path:
        sys.meta_path.insert(0, _STUBS)
    if _USERS not in sys.meta_path:
        sys.meta_path.append(_USERS)


def add_idl_folder(folder: str | Path) -> None:
    """Let ``import X`` find the IDL module X (and X__POA, and the stubs `FILE_idl`) in the IDL files of `folder`
    and of its subfolder `idl`. Each folder once; those added first are looked at first."""
    install()
    path = Path(folder).resolve()
    if path not in _folders:
        _folders.append(path)


def remove_idl_folder(folder: str | Path) -> None:
    """Undo `add_idl_folder`; what has been imported stays."""
    path = Path(folder).resolve()
    if path in _folders:
        _folders.remove(path)


class _Found(Loader):
    """Loads what is there already."""

    def __init__(self, module: ModuleType) -> None:
        self._module = module
        self._spec = module.__spec__

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        return self._module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self._spec  # the import system has written its own there


class _StubFinder:
    """The modules of the RTC world."""

    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name in MODULE_NAMES:
            from muros.rtc.corba import _stubs

            module = _stubs.MODULES[name]
        elif name in FILE_NAMES:
            import importlib

            module = importlib.import_module(f"rtctree.rtc.{name}")
        else:
            return None
        return spec_from_loader(name, _Found(module))


class _IdlFinder:
    """Modules of users' IDL files."""

    @staticmethod
    def find_spec(
        name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if path is not None:
            return None
        files = [
            file for folder in _folders for place in (folder, folder / "idl") for file in _files(place, name)
        ]
        if not files:
            return None
        from muros.rtc.corba.idl import load_idl

        for file in files:
            load_idl(file, _folders)
        return spec_from_loader(name, _Found(sys.modules[name])) if name in sys.modules else None


def _files(folder: Path, name: str) -> list[Path]:
    """The IDL files in `folder` that add to the module `name`, or whose stub it is."""
    if name.endswith("_idl"):
        return [path for path in (folder / f"{name[:-4]}.idl",) if path.is_file()]
    module = name.removesuffix("__POA")
    return [path for path in sorted(folder.glob("*.idl")) if _adds_to(path, module)]


def _adds_to(path: Path, module: str) -> bool:
    try:
        modules = _MODULE.findall(path.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return False
    return module in modules or (module == "_GlobalIDL" and not modules)


_STUBS: Final = _StubFinder()
_USERS: Final = _IdlFinder()
