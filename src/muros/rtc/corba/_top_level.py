"""What the modules `RTC`, `OpenRTM`, `SDOPackage`, `RTM` beside this package do: hand out the stubs of the process.

Programs that import them by themselves, as those written for OpenRTM-aist-Python do, also import the stubs of their
own IDL: `import SimpleService`, with MyService.idl beside the program.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

__all__ = ["hand_out", "look_for_idl"]


def hand_out(name: str) -> None:
    """Put the stubs' module `name` in the place of the one that is being imported.

    ImportError, with what to do, where the ORB is not installed.
    """
    from muros.rtc.corba import install

    install()
    look_for_idl()
    standing = sys.modules.pop(name)
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        sys.modules[name] = standing
        raise ImportError(
            f"{name} needs the ORB, and {error.name} is not installed: pip install 'muros[rtc]'", name=name
        ) from error


def look_for_idl() -> None:
    """Let programs import the modules of IDL files that lie beside the program, in its folder `idl`, or here."""
    from muros.rtc.corba import add_idl_folder

    main = getattr(sys.modules.get("__main__"), "__file__", None)
    for folder in (Path(main).parent if main else None, Path.cwd()):
        if folder is not None:
            add_idl_folder(folder)
