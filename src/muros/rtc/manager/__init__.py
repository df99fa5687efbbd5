"""Managers: what makes components, names them and ends them, after `rtc.conf` and by the wish of others.

`serve` runs components as a program. A `Manager` can be embedded, too:

    with Manager(read_settings(parse_options([]), environment=os.environ)) as manager:
        manager.start()
        manager.register(Controller)
        manager.create_component("Controller?conf.default.gain=2.0")
        manager.wait()
"""

from muros.rtc.manager._components import CreateError, ManagerEvent
from muros.rtc.manager._factories import Factory, LimitError
from muros.rtc.manager._manager import Manager
from muros.rtc.manager._modules import LoadedModule, ModuleError
from muros.rtc.manager._requests import RequestError
from muros.rtc.manager._serve import serve, serve_files, serve_manager
from muros.rtc.manager._settings import OPTIONS_HELP, Options, Settings, parse_options, read_settings
from muros.rtc.manager._signals import ended_by_signals

__all__ = [
    "OPTIONS_HELP",
    "CreateError",
    "Factory",
    "LimitError",
    "LoadedModule",
    "Manager",
    "ManagerEvent",
    "ModuleError",
    "Options",
    "RequestError",
    "Settings",
    "ended_by_signals",
    "parse_options",
    "read_settings",
    "serve",
    "serve_files",
    "serve_manager",
]
