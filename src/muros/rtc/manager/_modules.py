"""Modules: the files that components are loaded from, found after `manager.modules.*`.

`<File>Init(manager)` of a module registers what is in it, as in OpenRTM-aist. A module that has none is asked for its
classes derived from `Component`.
"""

from __future__ import annotations

import importlib.util
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from muros.rtc.codes import RtcError
from muros.rtc.component import Component
from muros.rtc.corba import add_idl_folder
from muros.rtc.properties import Properties

__all__ = ["LoadedModule", "ModuleError", "Modules"]

FILES: Final = 2000
"""Files that are looked at when the loadable modules are listed."""


class ModuleError(RtcError):
    """A module cannot be found or loaded; the text says why and what to do."""


@dataclass(frozen=True, slots=True)
class LoadedModule:
    """A module that has been imported."""

    path: Path
    module: ModuleType
    init: Callable[[Any], object] | None
    """What registers its components; None: `components` are to be registered."""
    components: tuple[type[Component], ...]

    def properties(self) -> dict[str, str]:
        """What tools are told of it."""
        return {
            "file_path": str(self.path),
            "module_file_name": self.path.name,
            "module_file_path": str(self.path),
        }


class Modules:
    """Finds, imports and forgets modules. `properties`: the part `manager.modules`; `folder`: the current one."""

    def __init__(self, properties: Properties, folder: Path = Path()) -> None:
        self._properties = properties
        self._folder = folder
        self._loaded: dict[Path, LoadedModule] = {}
        self._specs: dict[Path, tuple[tuple[int, int], list[dict[str, str]]]] = {}
        """What files hold, by their time and size."""

    @property
    def loaded(self) -> tuple[LoadedModule, ...]:
        """Those that have been loaded, in that order."""
        return tuple(self._loaded.values())

    @property
    def paths(self) -> tuple[Path, ...]:
        """The folders that are searched."""
        words = (*self._properties.words("load_path"), *self._properties.words("Python.load_paths"))
        return tuple(dict.fromkeys((self._folder / word).resolve() for word in words))

    def find(self, name: str) -> Path:
        """The file of a module. ModuleError where there is none, or where it is not to be loaded."""
        if not name.strip() or "\0" in name:
            raise ModuleError(f"{name!r} names no module; give the name of a file, such as ConsoleOut.py")
        asked = Path(name.strip())
        if asked.suffix != ".py":
            asked = asked.with_name(f"{asked.name}.py")
        if asked.is_absolute():
            if not self._properties.flag("abs_path_allowed"):
                raise ModuleError(
                    f"{name}: absolute paths are not allowed here (manager.modules.abs_path_allowed is NO); "
                    "name a file below manager.modules.load_path"
                )
            if asked.is_file():
                return asked.resolve()
            raise ModuleError(f"{name}: no such file")
        for folder in self.paths:
            path = (folder / asked).resolve()
            if path.is_file() and (path.is_relative_to(folder) or self._properties.flag("abs_path_allowed")):
                return path
        places = ", ".join(map(str, self.paths)) or "no folder"
        raise ModuleError(f"{name}: not found in manager.modules.load_path ({places})")

    def load(self, name: str, init: str = "") -> LoadedModule:
        """Import the module that `find` finds; see `load_file`."""
        return self.load_file(self.find(name), init)

    def load_file(self, path: Path, init: str = "") -> LoadedModule:
        """Import a file, wherever it lies; one that is loaded already is given as it is.

        `init` names the function that registers its components; `<File>Init` if it is empty. ModuleError says what
        was wrong with the file.
        """
        path = path.resolve()
        if not path.is_file():
            raise ModuleError(f"{path}: no such file")
        if path in self._loaded:
            return self._loaded[path]
        module = _import(path)
        loaded = LoadedModule(path, module, *_entry(path, module, init.strip()))
        self._loaded[path] = loaded
        return loaded

    def unload(self, name: str) -> LoadedModule:
        """Forget a module, so that it can be loaded anew. ModuleError if it is not loaded."""
        path = next((path for path in self._loaded if name in (str(path), path.name, path.stem)), None)
        loaded = self._loaded.pop(path or self.find(name), None)
        if loaded is None:
            raise ModuleError(f"{name} is not loaded")
        if sys.modules.get(loaded.module.__name__) is loaded.module:
            del sys.modules[loaded.module.__name__]
        return loaded

    def loadable(self) -> list[dict[str, str]]:
        """The properties of every component that could be loaded. No file is run in this process.

        A file is read again when it has changed.
        """
        from muros.rtc.manager._spec_files import read_specs_untrusted

        found, known = [], self._specs
        self._specs = {}
        for path in self._files():
            try:
                status = path.stat()
            except OSError:
                continue
            edition = (status.st_mtime_ns, status.st_size)
            before, specs = known.get(path, (None, []))
            if before != edition:
                specs = read_specs_untrusted(path)
            self._specs[path] = edition, specs
            for spec in specs:
                found.append({**spec, "module_file_name": path.name, "module_file_path": str(path)})
        return found

    def search(self, fits: Callable[[Mapping[str, str]], bool]) -> Path | None:
        """The first loadable file that holds a component of which `fits` is true."""
        return next((Path(spec["module_file_path"]) for spec in self.loadable() if fits(spec)), None)

    def _files(self) -> Sequence[Path]:
        files: list[Path] = []
        for folder in self.paths:
            try:
                files += sorted(path for path in folder.iterdir() if path.suffix == ".py" and path.is_file())
            except OSError:
                continue
        return files[:FILES]


def _import(path: Path) -> ModuleType:
    """Run a file as a module of its name, or of a name of its own where that is taken by another file."""
    standing = sys.modules.get(path.stem)
    name = path.stem if standing is None or _is_of(standing, path) else f"{path.stem} ({path.parent})"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ModuleError(f"{path}: not a Python file")
    module = importlib.util.module_from_spec(spec)
    folder = str(path.parent)
    if folder not in sys.path:
        sys.path.append(folder)  # components import what lies beside them
    sys.modules[name] = module
    add_idl_folder(path.parent)  # so that they find their IDL, and `import RTC` the stubs
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[name]
        if isinstance(error, KeyboardInterrupt):
            raise
        raise ModuleError(f"{path}: cannot be imported: {_origin(error, path)}") from error
    return module


def _is_of(module: ModuleType, path: Path) -> bool:
    file = getattr(module, "__file__", None)
    return file is not None and Path(file).resolve() == path


def _entry(
    path: Path, module: ModuleType, init: str
) -> tuple[Callable[[Any], object] | None, tuple[type[Component], ...]]:
    usual = f"{path.stem}Init"
    function = getattr(module, init or usual, None)
    if callable(function):
        return function, ()
    if init not in ("", usual):  # the usual one is named by tools that know no files without it
        raise ModuleError(f"{path}: it has no function {init}")
    own = [
        value
        for value in vars(module).values()
        if isinstance(value, type)
        and issubclass(value, Component)
        and value.__module__ == module.__name__
        and not value.__name__.startswith("_")
    ]
    if not own:
        raise ModuleError(
            f"{path}: no component in it: neither a function {path.stem}Init(manager) nor a class derived from "
            "muros.rtc.Component"
        )
    return None, tuple(dict.fromkeys(own))


def _origin(error: BaseException, path: Path) -> str:
    """What went wrong, and in which line of the file."""
    line = error.lineno if isinstance(error, SyntaxError) and error.filename == str(path) else None
    for frame, number in traceback.walk_tb(error.__traceback__):
        if frame.f_code.co_filename == str(path):
            line = number
    text = error.msg if isinstance(error, SyntaxError) else str(error)
    where = f"{path.name}:{line}: " if line is not None else ""
    return f"{where}{type(error).__name__}: {text}" if text else f"{where}{type(error).__name__}"
