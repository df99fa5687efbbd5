"""What the modules `RTC`, `OpenRTM`, `SDOPackage`, `RTM` beside this package do: hand out the stubs of the process."""

from __future__ import annotations

import importlib
import sys

__all__ = ["hand_out"]


def hand_out(name: str) -> None:
    """Put the stubs' module `name` in the place of the one that is being imported.

    ImportError, with what to do, where the ORB is not installed.
    """
    from muros.rtc.corba import install

    install()
    standing = sys.modules.pop(name)
    try:
        importlib.import_module(name)
    except ModuleNotFoundError as error:
        sys.modules[name] = standing
        raise ImportError(
            f"{name} needs the ORB, and {error.name} is not installed: pip install 'muros[rtc]'", name=name
        ) from error
