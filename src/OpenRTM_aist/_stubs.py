"""The stubs of users' IDL: a component says `import SimpleService` and has MyService.idl beside it."""

from __future__ import annotations

import sys
from pathlib import Path

__all__ = ["look_for_idl"]


def look_for_idl() -> None:
    """Let programs import the modules of IDL files that lie beside them, in their folder `idl`, or here."""
    from muros.rtc.corba import add_idl_folder

    main = getattr(sys.modules.get("__main__"), "__file__", None)
    for folder in (Path(main).parent if main else None, Path.cwd()):
        if folder is not None:
            add_idl_folder(folder)
