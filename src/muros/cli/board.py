"""The command ``muros board``: what a MicroPython board needs, in one folder."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, TextIO

DESCRIPTION = """\
Write the modules of muros that boards use, and the classes of the types you name with all that they need, into a
folder, ready to be copied to the library folder of a MicroPython board.
"""
EPILOG = """\
Name all types of your program at once: muros board copy build/board std_msgs/msg/Int32 sensor_msgs/msg/Imu
The constants of some types take more memory than their code; those are left out, unless a --program names them.
With --mpy the files are compiled by mpy-cross: they take less memory to import, and less flash. Native code for
serial lines is compiled for --march, as armv6m, armv7emsp, xtensawin, rv32imc or x64, and left out without.
With --small the folder holds what your --program reaches and no more, under names that the firmware has anyway, in
few modules: half the heap and half the flash. DIR/names.txt says what each name was, to read tracebacks.
"""
_NAMES = "names.txt"
COMPILED_THERE = 4000
"""Characters of a joined module that a board compiles itself."""


def register(subparsers: Any) -> None:
    """Adds ``board`` with its own sub-commands to an argparse sub-command table."""
    parser = subparsers.add_parser("board", help="write the files that a MicroPython board needs")
    actions = parser.add_subparsers(required=True, metavar="copy")
    copy = actions.add_parser(
        "copy",
        help="write the files that a MicroPython board needs into a folder",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    copy.add_argument("folder", metavar="DIR", type=Path, help="made if it is not there")
    copy.add_argument("types", nargs="*", metavar="TYPE", help="std_msgs/msg/Int32, or short std_msgs/Int32")
    add_program(copy)
    copy.add_argument(
        "--rules",
        action="store_true",
        help="classes that memory rules can bound; given by itself when a --program names Rules",
    )
    copy.add_argument("--mpy", action="store_true", help="compile with mpy-cross")
    copy.add_argument("--march", metavar="ARCH", help="with --mpy: native code for this architecture")
    copy.add_argument(
        "--lean",
        action="store_true",
        help="with --mpy: leave out the line numbers that tracebacks show; less heap, a tenth less flash",
    )
    copy.add_argument(
        "--small",
        action="store_true",
        help="only what all of your --program reach, with short names, in few modules; much less heap",
    )
    copy.add_argument(
        "--path",
        action="append",
        default=[],
        metavar="DIR",
        help="folder of your definitions, for types of your own",
    )
    copy.set_defaults(run=_copy)


def _copy(arguments: argparse.Namespace) -> int:
    from muros import interfaces
    from muros.cli import _floor

    if arguments.march and not arguments.mpy:
        print("muros: --march is for compiling: give --mpy too", file=sys.stderr)
        return 2
    if arguments.lean and not arguments.mpy:
        print("muros: --lean is for compiling: give --mpy too", file=sys.stderr)
        return 2
    if arguments.small and not arguments.program:
        print("muros: --small is for your programs: give --program for each file of yours", file=sys.stderr)
        return 2
    try:
        for folder in arguments.path:
            interfaces.add_path(folder)
        constants = constants_of(arguments.program)
        shapes = arguments.rules or (constants is not None and "Rules" in constants)
        tree = _floor.board_tree() | _types(arguments.types, constants, shapes)
        left_out = [path for path in tree if _floor.is_native(tree[path])] if arguments.mpy else []
        if arguments.small:
            tree = _small(tree, arguments)
        elif arguments.mpy:
            tree = _floor.compiled(tree, arguments.march, _floor.lean_mpy if arguments.lean else None)
        _replace(tree, arguments.folder)
    except (interfaces.InterfaceError, _floor.CompileError) as error:
        print(f"muros: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"muros: {error.filename or arguments.folder}: {error.strerror}", file=sys.stderr)
        return 1
    _report(tree, arguments.folder)
    if constants is None:
        report_constants(arguments.types, sys.stdout)
    if left_out and not arguments.march:
        print(
            f"Left out: native code ({', '.join(left_out)}). --march ARCH adds it; serial lines work without."
        )
    return 0


def _small(tree: dict[str, bytes], arguments: argparse.Namespace) -> dict[str, bytes]:
    """The tree, small, and compiled if it shall be; what each name was is written beside it."""
    from muros.cli import _floor
    from muros.cli._small import small

    if not arguments.march:
        tree = {path: content for path, content in tree.items() if not _floor.is_native(content)}
    texts = [path.read_text("utf-8", errors="replace") for path in arguments.program]
    tree, names = small(tree, texts, None if arguments.mpy else COMPILED_THERE)
    arguments.folder.mkdir(parents=True, exist_ok=True)
    lines = sorted(f"{new} {old}\n" for old, new in names.items())
    (arguments.folder / _NAMES).write_text("".join(lines))
    return _floor.compiled(tree, arguments.march, _floor.small_mpy) if arguments.mpy else tree


def add_program(parser: argparse.ArgumentParser) -> None:
    """Adds ``--program``, which says which constants to keep."""
    parser.add_argument(
        "--program",
        action="append",
        default=[],
        metavar="FILE",
        type=Path,
        help="for boards: keep just those constants of types that this program names; may be given again",
    )


def constants_of(programs: list[Path]) -> frozenset[str] | None:
    """What to keep: names in the programs, or None when there is none. Raises OSError."""
    from muros.interfaces import board

    texts = [path.read_text("utf-8", errors="replace") for path in programs]
    return board.constants_in("\n".join(texts)) if texts else None


def report_constants(types: list[str], file: TextIO) -> None:
    """Says which types lost their constants."""
    from muros.interfaces import board

    for name, number in board.without_constants(types).items():
        print(
            f"Left out: the {number} constants of {name}. --program FILE keeps those that your program names.",
            file=file,
        )


def _types(names: list[str], constants: frozenset[str] | None, shapes: bool) -> dict[str, bytes]:
    from muros.interfaces import board

    made = board.sources(names, True, constants=constants, shapes=shapes)
    return {path: text.encode() for path, text in made.items()}


def _replace(tree: dict[str, bytes], folder: Path) -> None:
    """Writes the files; what is compiled must not stand beside its source, which boards would take instead."""
    from muros.cli import _floor

    _floor.write(tree, folder)
    for path in tree:
        other = ".py" if path.endswith(".mpy") else ".mpy"
        (folder / path).with_suffix(other).unlink(missing_ok=True)


def _report(tree: dict[str, bytes], folder: Path) -> None:
    sizes: dict[str, list[int]] = {}
    for path, content in tree.items():
        sizes.setdefault(path.split("/")[0], []).append(len(content))
    width = max(map(len, sizes))
    for package, parts in sizes.items():
        print(f"{package:<{width}}  {sum(parts):>7,} B in {len(parts)} files")
    print(f"{'all':<{width}}  {sum(map(len, tree.values())):>7,} B")
    print("Copy it to a board, for instance with mpremote (first make the folder, unless it is there):")
    print("  mpremote fs mkdir :lib")
    print(f"  mpremote fs cp -r {' '.join(str(folder / package) for package in sizes)} :lib/")
