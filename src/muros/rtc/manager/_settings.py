"""A manager's settings: what `rtc.conf`, the command line and the defaults say, the later over the earlier.

The file is the first there is of: `-f FILE`, that of `$RTC_MANAGER_CONFIG`, `./rtc.conf`, and `rtc.conf` in `/etc`,
`/etc/rtc`, `/usr/local/etc`, `/usr/local/etc/rtc`.
"""

from __future__ import annotations

import getopt
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from muros.rtc.manager._defaults import DEFAULTS, host_properties
from muros.rtc.properties import ConfError, Properties, read_conf_file

__all__ = [
    "ENVIRONMENT",
    "OPTIONS_HELP",
    "SYSTEM_FILES",
    "Options",
    "Settings",
    "parse_options",
    "read_settings",
]

ENVIRONMENT: Final = "RTC_MANAGER_CONFIG"
"""The environment variable that names the file of settings."""

SYSTEM_FILES: Final = tuple(
    Path(folder, "rtc.conf") for folder in ("/etc", "/etc/rtc", "/usr/local/etc", "/usr/local/etc/rtc")
)
"""Where the file of settings is looked for when there is none in the current folder."""

OPTIONS_HELP: Final = """\
  -f FILE       read settings from FILE (default: $RTC_MANAGER_CONFIG, ./rtc.conf, /etc/rtc.conf, ...)
  -i            go on without FILE if it is not there
  -o KEY:VALUE  set one key, whatever the file says; may be given several times
  -p PORT       listen on PORT (corba.endpoints)
  -d            be a master manager
  -a            do not offer the manager itself to tools
  --instance_name=NAME
                what the first component is to be called"""


@dataclass(frozen=True, slots=True)
class Options:
    """The command line of a manager."""

    file: str = ""
    ignore_missing: bool = False
    overrides: Mapping[str, str] = field(default_factory=dict)
    """What `-o`, `-p`, `-d` and `-a` set."""
    words: tuple[str, ...] = ()
    """What is no option."""
    instance_name: str = ""
    """The name that the first component made is to have."""


@dataclass(frozen=True, slots=True)
class Settings:
    """All properties, and the file they were read from; None where there is none."""

    properties: Properties
    file: Path | None


def parse_options(argv: Sequence[str]) -> Options:
    """The options of a command line without the program's name. ConfError for what is none."""
    try:
        pairs, words = getopt.gnu_getopt(list(argv), "adif:o:p:", ["instance_name="])
    except getopt.GetoptError as error:
        raise ConfError(
            f"{error.msg}; the options are -a, -d, -f FILE, -i, -o KEY:VALUE and -p PORT"
        ) from error
    file, instance_name, ignore_missing, overrides = "", "", False, dict[str, str]()
    for option, value in pairs:
        if option == "-f":
            file = value
        elif option == "-i":
            ignore_missing = True
        elif option == "-a":
            overrides["manager.corba_servant"] = "NO"
        elif option == "-d":
            overrides["manager.is_master"] = "YES"
        elif option == "--instance_name":
            instance_name = value
        elif option == "-p":
            if not (value.isascii() and value.isdigit() and int(value) < 65536):
                raise ConfError(f"-p {value}: a port is a number from 0 to 65535")
            overrides["corba.endpoints"] = f":{value}"
        else:
            key, colon, text = value.partition(":")
            if not colon or not key.strip():
                raise ConfError(f"-o {value}: write it as KEY:VALUE, such as -o logger.log_level:DEBUG")
            overrides[key.strip()] = text.strip()
    return Options(file, ignore_missing, overrides, tuple(words), instance_name)


def read_settings(
    options: Options,
    *,
    environment: Mapping[str, str],
    folder: Path = Path(),
    system_files: Sequence[Path] = SYSTEM_FILES,
) -> Settings:
    """The settings that hold. ConfError if a file is asked for that cannot be read. `folder`: the current one."""
    properties = Properties(defaults=DEFAULTS)
    properties.update(host_properties())
    file = _find_file(options, environment, folder, system_files)
    if file is not None:
        properties.update(read_conf_file(file))
        properties["config_file"] = str(file)
    properties.update(options.overrides)
    # Where the name of the manager is set, that of its instance follows unless it is set as well.
    if "manager.name" in properties and "manager.instance_name" not in properties:
        properties["manager.instance_name"] = properties["manager.name"]
    return Settings(properties, file)


def _find_file(
    options: Options, environment: Mapping[str, str], folder: Path, system_files: Sequence[Path]
) -> Path | None:
    asked = [(options.file, "-f"), (environment.get(ENVIRONMENT, ""), f"${ENVIRONMENT}")]
    for name, origin in asked:
        if not name:
            continue
        path = folder / name
        if path.is_file():
            return path
        if not options.ignore_missing:
            raise ConfError(f"{name} ({origin}): no such file; mend the name, or give -i to go on without it")
        return None
    return next((path for path in (folder / "rtc.conf", *system_files) if path.is_file()), None)
