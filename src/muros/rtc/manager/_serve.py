"""A manager as a program: started from a command line, ended by SIGINT, SIGTERM, or the end of its components."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from muros import __version__
from muros.findings import Finding
from muros.rtc.codes import RtcError
from muros.rtc.component import Component
from muros.rtc.manager._manager import Manager
from muros.rtc.manager._requests import ComponentId, CreateRequest
from muros.rtc.manager._settings import Options, parse_options, read_settings
from muros.rtc.manager._signals import ended_by_signals
from muros.rtc.properties import ConfError, Properties

__all__ = ["FAILED", "WRONG_USE", "fail", "serve", "serve_files", "serve_manager", "show"]

FAILED: Final = 1
"""The exit status where the ORB does not start or a component cannot be made."""
WRONG_USE: Final = 2
"""The exit status where the settings cannot be."""

OWN_WAY: Final = "MyModuleInit"
"""By this function a file of OpenRTM-aist registers and makes what it is to run as a program."""


def serve(components: Sequence[type[Component]], argv: Sequence[str]) -> int:
    """Serve one instance of each of `components` until the end; the exit status.

    `argv` are a manager's options. Status 1: a component could not be made or the ORB not be started; 2: wrong use.
    """

    def init(manager: Manager, name: str) -> None:
        for component in components:
            manager.register(component)
            name = _create(manager, component.spec()["implementation_id"], name)

    options = _options(argv)
    return options if isinstance(options, int) else _serve(options, lambda m: init(m, options.instance_name))


def serve_files(argv: Sequence[str]) -> int:
    """Serve one instance of each component in the files that `argv` names, among a manager's options; the exit status.

    A file in the style of OpenRTM-aist does it itself where it has a function `MyModuleInit(manager)`.
    """
    try:
        options = parse_options(argv)
        files = [Path(word) for word in options.words]
        if not files:
            raise ConfError("name the file of a component: muros rtc run MyComp.py")
        for file in files:
            if not file.is_file():
                raise ConfError(f"{file}: no such file")
    except ConfError as error:
        return fail(error, WRONG_USE)

    def init(manager: Manager) -> None:
        for file in files:
            before = set(manager.components)
            module = manager.load_file(file)
            own_way = getattr(module.module, OWN_WAY, None)
            if callable(own_way):
                own_way(manager)
            if before != set(manager.components):
                continue
            name = options.instance_name if file is files[0] else ""
            for factory in manager.factories_of(module):
                name = _create(manager, factory.name, name)

    return _serve(options, init)


def serve_manager(argv: Sequence[str], init: Callable[[Manager], object] | None = None) -> int:
    """Start a manager, run `init`, serve until the end; the exit status. Findings go to standard error.

    To be called in the main thread: SIGINT and SIGTERM end it; a second one ends it at once.
    """
    options = _options(argv)
    return options if isinstance(options, int) else _serve(options, init)


def _options(argv: Sequence[str]) -> Options | int:
    """The options of a command line without words; the exit status where it is wrong."""
    try:
        options = parse_options(argv)
        if options.words:
            raise ConfError(f"{options.words[0]!r} is no option of a manager")
    except ConfError as error:
        return fail(error, WRONG_USE)
    return options


def _create(manager: Manager, kind: str, name: str) -> str:
    """Make a component, called `name` if that is not empty; "", the name of those that follow."""
    manager.create_component(
        CreateRequest(ComponentId(kind), Properties({"instance_name": name} if name else {}))
    )
    return ""


def _serve(options: Options, init: Callable[[Manager], object] | None) -> int:
    try:
        manager = Manager(read_settings(options, environment=os.environ))
    except ConfError as error:
        return fail(error, WRONG_USE)
    manager.reporter.on_finding(show)

    try:
        with ended_by_signals(manager.shutdown):
            try:
                manager.start(init)
                if not manager.is_ending:
                    _greet(manager)
                manager.wait()
            finally:
                manager.close()
    except ConfError as error:
        return fail(error, WRONG_USE)
    except RtcError as error:
        return fail(error, FAILED)
    return 0


def _greet(manager: Manager) -> None:
    """One line: who runs, where others find it, how it ends."""
    names = ", ".join(component.instance_name for component in manager.components)
    kind = "master manager" if manager.is_master else "manager"
    place = (
        f"names at {manager.settings['corba.nameservers']}"
        if manager.settings.flag("naming.enable")
        else "no names"
    )
    print(
        f"muros {__version__} · {names or f'{kind} {manager.name}'} · {place} · Ctrl-C ends it",
        file=sys.stderr,
        flush=True,
    )


def show(finding: Finding) -> None:
    """Write a finding on standard error."""
    print(finding.format(), file=sys.stderr, flush=True)


def fail(error: Exception, status: int) -> int:
    """Say in a line why there is no manager; `status`."""
    print(f"muros: {error}", file=sys.stderr)
    return status
