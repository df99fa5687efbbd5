"""Users' IDL: compiled behind the scenes, once for each content, and loaded into one set of modules.

`load_idl("MyService.idl")` gives the modules of the file: `SimpleService` and `SimpleService__POA`. omniidl, which
comes with the ORB, compiles the file and those of the user's that it includes; the RTC world's own (BasicDataType.idl
...) are there already. The result lies in the user's cache folder under a name made of all that went into it, so that
a second start takes no time; two processes that compile the same file at once do not disturb each other, as each
writes a folder of its own and then renames it.

A module whose parts stand in several files grows with each of them that is loaded.
"""

from __future__ import annotations

import atexit
import functools
import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Final

import jeteve_omniorb
import omniORB

from muros.rtc.codes import RtcError
from muros.rtc.corba._importer import install
from muros.rtc.corba._stubs import IDL_FOLDER, STUB_FILES

__all__ = ["IdlError", "load_idl"]

COMPILE_SECONDS: Final = 60.0
"""Time that the compiler may take."""

_FORM: Final = "1"
"""Part of the names in the cache: changes when what lies there does."""

_INCLUDE: Final = re.compile(r'^[ \t]*#[ \t]*include[ \t]*["<]([^">\n]+)[">]', re.MULTILINE)

_lock = threading.RLock()
_loaded: dict[Path, dict[str, ModuleType]] = {}
_stubs_of: dict[str, Path] = {}
"""For each stub that was imported (`MyService_idl`): the file it was made of."""


class IdlError(RtcError):
    """An IDL file cannot be used; the text has the compiler's words, with file and line."""


def load_idl(
    path: str | os.PathLike[str], include: Sequence[str | os.PathLike[str]] = ()
) -> dict[str, ModuleType]:
    """The modules of an IDL file by name, with those of their skeletons (`NAME__POA`); now importable, too.

    What stands outside of modules is in `_GlobalIDL` and `_GlobalIDL__POA`. `include`: folders for included files,
    after the file's own and before the RTC world's. A file that was loaded before is not looked at again.
    IdlError if there is no such file, or the compiler refuses it.
    """
    source = Path(path).resolve()
    with _lock:
        if source in _loaded:
            return _loaded[source]
        install()
        folders = [Path(folder).resolve() for folder in include]
        files = list(_closure(source, folders))
        stubs = _compiled(files, folders)
        names = [f"{file.stem}_idl" for file in files]
        for file, name in zip(files, names, strict=True):
            other = _stubs_of.get(name, file)
            if other != file:
                raise IdlError(
                    f"{file}: {other} has been loaded already, and both are stub {name}. Rename one of them"
                )
        for file, name in zip(files, names, strict=True):
            _import_stub(name, stubs / f"{name}.py")
            _stubs_of[name] = file
        _loaded[source] = modules = _gather(stubs)
        return modules


# ---- what belongs together


def _closure(source: Path, folders: Sequence[Path]) -> Iterator[Path]:
    """The file and the user's files it includes, those included first. Missing ones are the compiler's to tell."""
    seen: set[Path] = set()

    def walk(file: Path) -> Iterator[Path]:
        seen.add(file)
        for name in _INCLUDE.findall(_text(file)):
            found = next(
                (place / name for place in (file.parent, *folders) if (place / name).is_file()), None
            )
            if found is not None and found.stem not in STUB_FILES and (found := found.resolve()) not in seen:
                yield from walk(found)
        yield file

    return walk(source)


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8", errors="surrogateescape")
    except OSError as error:
        raise IdlError(f"{file}: {error.strerror or error}") from error


# ---- compiling


def _compiled(files: Sequence[Path], folders: Sequence[Path]) -> Path:
    """The folder with the stubs of `files`, from the cache if they are there."""
    digest = hashlib.sha256(f"{_FORM} {omniORB.__version__}".encode())
    for file in files:
        digest.update(f"\0{file.name}\0".encode() + _text(file).encode("utf-8", "surrogateescape"))
    cache = _cache_folder()
    target = cache / digest.hexdigest()[:32]
    if target.is_dir():
        return target
    work = Path(tempfile.mkdtemp(prefix="making-", dir=cache))
    try:
        _run_compiler(files, folders, work)
        try:
            work.rename(target)
        except OSError:
            if not target.is_dir():  # or else another process was first
                raise
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return target


def _run_compiler(files: Sequence[Path], folders: Sequence[Path], target: Path) -> None:
    compiler = Path(jeteve_omniorb.__file__).parent / "bin" / "omniidlrun.py"
    places = dict.fromkeys([*(file.parent for file in files), *folders, IDL_FOLDER])
    command = [
        *(sys.executable, str(compiler), "-bpython", f"-C{target}"),
        *(f"-I{place}" for place in places),
        *map(str, files),
    ]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=COMPILE_SECONDS, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise IdlError(f"{files[-1]}: omniidl does not run: {error}") from error
    if done.returncode != 0:
        words = [
            line.removeprefix("omniidl: ")
            for line in (done.stderr or done.stdout).splitlines()
            if line.strip()
        ]
        raise IdlError("\n".join(words) or f"{files[-1]}: omniidl ended with status {done.returncode}")


def _cache_folder() -> Path:
    """Where stubs are kept: of this user, or for this process alone where that cannot be written."""
    home = os.environ.get("XDG_CACHE_HOME", "")
    folder = (Path(home) if os.path.isabs(home) else Path.home() / ".cache") / "muros" / "idl"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if os.access(folder, os.W_OK | os.X_OK):
            return folder
    except OSError:
        pass
    return _own_folder()


@functools.cache
def _own_folder() -> Path:
    folder = tempfile.mkdtemp(prefix="muros-idl-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


# ---- loading


def _import_stub(name: str, path: Path) -> None:
    if name in sys.modules:  # the program had stubs of its own, compiled by its author
        return
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None or not path.is_file():
        raise IdlError(f"{path}: the compiler left no stub {name}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise


def _gather(stubs: Path) -> dict[str, ModuleType]:
    """The IDL modules that the stubs in this folder add to, registered with the import system."""
    folders = sorted(path.parent for path in stubs.rglob("__init__.py"))
    modules = {}
    for folder in folders:
        name = ".".join(folder.relative_to(stubs).parts)
        module: ModuleType = omniORB.openModule(name)
        if name not in sys.modules:
            omniORB._partialModules.pop(name, None)
            sys.modules[name] = module
        parent, _, leaf = name.rpartition(".")
        if parent:
            setattr(sys.modules[parent], leaf, module)
        modules[name] = module
    return modules
