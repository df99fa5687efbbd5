"""Names of ROS 1 (ROS wiki: "Names"): relative, absolute ``/name``, private ``~name``."""

from __future__ import annotations

import os
import re
import socket
from collections.abc import Mapping
from urllib.parse import urlsplit

from muros.ros1._errors import Ros1Error

MASTER_URI = "http://localhost:11311"
"""Where a master is when nothing else is said."""

_NAME = re.compile(r"[A-Za-z/~][A-Za-z0-9_/]*\Z")


def resolve(name: str, node: str, remap: Mapping[str, str] | None = None) -> str:
    """The absolute name that a node means by ``name``. Raises :class:`Ros1Error` for what is no name."""
    meant = (remap or {}).get(name, name)
    if not _NAME.match(meant):
        raise Ros1Error(f"{name!r} is no name in ROS 1: letters, digits, _ and / are allowed, a letter first")
    if meant.startswith("~"):
        full = f"{node}/{meant[1:]}"
    elif meant.startswith("/"):
        full = meant
    else:
        full = f"{node.rpartition('/')[0]}/{meant}"
    return "/" + "/".join(part for part in full.split("/") if part)


def master_uri(environment: Mapping[str, str] = os.environ) -> str:
    """The master's address: ``$ROS_MASTER_URI``, else port 11311 of this machine."""
    return environment.get("ROS_MASTER_URI") or MASTER_URI


def own_host(master: str, environment: Mapping[str, str] = os.environ) -> str:
    """The name or address that others reach this machine by: ``$ROS_HOSTNAME``, ``$ROS_IP``, else the address of the
    interface that leads to the master."""
    given = environment.get("ROS_HOSTNAME") or environment.get("ROS_IP")
    if given:
        return given
    try:
        split = urlsplit(master)
        place = split.hostname or "localhost", split.port or 80
        family, kind, *_, address = socket.getaddrinfo(*place, socket.AF_INET, socket.SOCK_DGRAM)[0]
        with socket.socket(family, kind) as made:
            made.connect(address)
            return str(made.getsockname()[0])
    except (OSError, ValueError):
        return "127.0.0.1"
