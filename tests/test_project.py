"""The project as it is delivered: its version, its command, its wheel, and what its files may not contain."""

import importlib.metadata
import json
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import muros

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())

HEAVY = frozenset(
    "apsw asyncio importlib.metadata logging lz4 multiprocessing numpy rosbags ruamel serial socket "
    "sqlite3 ssl typing unittest xml zstandard".split()
)
"""Modules that `import muros` must not load; `muros --version` may use what argparse needs besides."""


def test_version_is_one_everywhere() -> None:
    assert re.fullmatch(r"\d+\.\d+\.\d+(\.dev\d+|rc\d+)?", muros.__version__)
    assert importlib.metadata.version("muros") == muros.__version__


def test_import_is_light() -> None:
    assert not _loaded("import muros") & HEAVY


def test_version_command_is_light() -> None:
    loaded = _loaded("import muros.cli\ntry: muros.cli.main(['--version'])\nexcept SystemExit: pass")
    assert "muros.cli" in loaded
    assert not loaded & (HEAVY - {"typing"})


def test_version_command_says_the_version() -> None:
    for command in ([Path(sys.executable).parent / "muros"], [sys.executable, "-m", "muros"]):
        done = subprocess.run(
            [*command, "--version"], capture_output=True, text=True, timeout=30, check=False
        )
        assert (done.returncode, done.stdout, done.stderr) == (0, f"muros {muros.__version__}\n", "")


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel as built from the files that git tracks or would add, and nothing that lies around."""
    source = tmp_path_factory.mktemp("source")
    for path in _files():
        (source / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / path, source / path)
    out = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(out)]
    done = subprocess.run(build, cwd=source, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    (built,) = out.glob("*.whl")
    return built


def test_wheel_holds_what_is_in_src_and_nothing_else(wheel: Path) -> None:
    assert wheel.name == f"muros-{muros.__version__}-py3-none-any.whl"
    info = f"muros-{muros.__version__}.dist-info/"
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if not name.startswith(info)}
        licence = archive.read(f"{info}licenses/LICENSE")
    tracked = {path.removeprefix("src/") for path in _files() if path.startswith("src/")}
    assert names == tracked
    assert "muros/py.typed" in names
    assert licence == (ROOT / "LICENSE").read_bytes()


def test_wheel_declares_its_command_and_its_needs(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        info = f"muros-{muros.__version__}.dist-info/"
        metadata = archive.read(f"{info}METADATA").decode()
        entry_points = archive.read(f"{info}entry_points.txt").decode()
    assert "muros = muros.cli:main" in entry_points
    declared = {
        line.split(":")[1].strip() for line in metadata.splitlines() if line.startswith("Requires-Dist")
    }
    assert {need for need in declared if "extra ==" not in need} == set(PROJECT["project"]["dependencies"])


def test_wheel_works_on_its_own(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path)
    program = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import muros; print(muros.__file__)"
    done = subprocess.run(
        [sys.executable, "-I", "-c", program], capture_output=True, text=True, timeout=30, check=True
    )
    assert Path(done.stdout.strip()) == tmp_path / "muros" / "__init__.py"


FORBIDDEN = {
    "an absolute path of a machine": re.compile(
        rb"(?<![\w.])(?:/(?:work|root)/[\w.]|" + re.escape(bytes(ROOT)) + rb"\b)"
    ),
    "a package registry's host": re.compile(
        rb"(?:pypi|pythonhosted|npmjs|debian)\.(?:org|com|io)\b", re.IGNORECASE
    ),
    "a conflict marker": re.compile(rb"^(?:<<<<<<<|>>>>>>>) ", re.MULTILINE),
    "a blank at the end of a line": re.compile(rb"[ \t]+$", re.MULTILINE),
    "a carriage return": re.compile(rb"\r\n"),
}
"""What no text file of the project contains, whoever wrote it."""


def test_files_contain_nothing_forbidden() -> None:
    found = []
    for path in _files():
        content = (ROOT / path).read_bytes()
        if b"\0" in content or path.startswith("tests/vectors/"):
            continue
        for what, pattern in FORBIDDEN.items():
            for match in pattern.finditer(content):
                line = content.count(b"\n", 0, match.start()) + 1
                found.append(f"{path}:{line}: {what}: {match.group().decode(errors='replace')!r}")
    assert not found, "\n" + "\n".join(found)


def test_paths_of_a_machine_are_recognised() -> None:
    pattern = FORBIDDEN["an absolute path of a machine"]
    for folder in ("work", "root"):
        assert pattern.search(f"see /{folder}/main/src".encode())
        assert pattern.search(f'"/{folder}/.cache"'.encode())
        assert not pattern.search(f"see ./{folder}/main, a topic robot/{folder}/x".encode())
    assert pattern.search(str(ROOT / "src").encode())


def test_rooms_have_an_order() -> None:
    """import-linter checks imports only between rooms it was told of."""
    contracts = PROJECT["tool"]["importlinter"]["contracts"]
    (layers,) = (contract["layers"] for contract in contracts if contract["id"] == "rooms")
    ordered = {layer.strip("()") for layer in layers}
    rooms = {
        path.stem
        for path in (ROOT / "src/muros").iterdir()
        if (path / "__init__.py").exists() or path.suffix == ".py"
    }
    assert rooms - {"__init__", "_importer"} <= ordered


def _loaded(source: str) -> set[str]:
    """The modules that are loaded after ``source`` and were not before it, in an interpreter of their own."""
    program = (
        "import sys, json\nbefore = set(sys.modules)\n"
        f"{source}\nprint('\\n' + json.dumps(sorted(set(sys.modules) - before)))"
    )
    done = subprocess.run(
        [sys.executable, "-I", "-c", program], capture_output=True, text=True, timeout=30, check=False
    )
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


def _files() -> list[str]:
    """The project's files: tracked by git, or new and not ignored."""
    listing = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        timeout=30,
        check=False,
    )
    if listing.returncode:
        pytest.skip("not a git clone")
    paths = listing.stdout.decode().split("\0")
    return sorted(path for path in paths if path and (ROOT / path).is_file())
