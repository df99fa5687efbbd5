"""Looks for agents on the network: GET_INFO to a multicast group or to a list of hosts (DDS-XRCE 1.0, 8.3.5.3).

An agent that was told to be found answers with INFO, which names the addresses of its data port.
"""

import select
import socket

from muros.compat import const, ticks_diff, ticks_ms

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.xrce._types import Buffer

DISCOVERY_GROUP = "239.255.0.2"
DISCOVERY_PORT = const(7400)

_QUESTION = b"\x80\0\0\0\x02\x01\x08\0\0\x09\xff\xfd\x03\0\0\0"
_INFO = const(6)
_LARGEST = const(1024)
_MEDIUM = const(1)
_LARGE = const(2)


class InfoError(ValueError):
    """A message that is no INFO of an agent of our version."""


def discover(
    hosts: "str | tuple[str, ...] | list[str]" = (DISCOVERY_GROUP,),
    port: int = DISCOVERY_PORT,
    attempts: int = 1,
    timeout: int = 1000,
    most: int = 4,
) -> "list[tuple[str, int]]":
    """Addresses (host, port) of agents, at most ``most``, without doubles.

    ``hosts``, one or several, are asked up to ``attempts`` times, until the first answer; answers are waited for
    ``timeout`` ms each time. Hosts that cannot be reached are passed over.
    """
    found: "list[tuple[str, int]]" = []
    sockets: "dict[int, Any]" = {}
    try:
        for _ in range(attempts):
            for host in (hosts,) if isinstance(hosts, str) else hosts:
                _ask(sockets, host, port)
            start = ticks_ms()
            while ticks_diff(ticks_ms(), start) < timeout:
                for made in sockets.values():
                    _listen(made, found, most, 20)
            if found:
                break
    finally:
        for made in sockets.values():
            made.close()
    return found


def locators_untrusted(data: "Buffer") -> "list[tuple[str, int]]":
    """The addresses (host, port) in an INFO; raises InfoError when it is none, or of another version."""
    at = 4 if len(data) > 4 and data[0] >= 0x80 else 8
    little = len(data) > at + 1 and data[at + 1] & 1
    pos = at + 4
    if len(data) < pos + 18 or data[at] != _INFO or data[pos] != 0 or data[pos + 1] != 9:
        raise InfoError("no INFO")
    if data[pos + 4] >= 0x80 or not data[pos + 6] or bytes(data[pos + 8 : pos + 12]) != b"XRCE":
        raise InfoError("no agent's INFO")
    if data[pos + 12] != 1:
        raise InfoError("version %d of DDS-XRCE" % data[pos + 12])
    if data[pos + 16]:
        raise InfoError("properties are not expected")
    if not data[pos + 17]:
        return []
    pos = pos + 22  # behind the activity's kind, padding and availability
    pos = pos + 3 & ~3
    count = _number(data, pos, 4, little)
    pos += 4
    found = []
    for _ in range(min(count, 64)):
        if pos >= len(data):
            break
        form = data[pos]
        if form == _MEDIUM:
            port_at = pos + 5 + 1 & ~1
            host = "%d.%d.%d.%d" % (
                _number(data, pos + 1, 1, little),
                _number(data, pos + 2, 1, little),
                _number(data, pos + 3, 1, little),
                _number(data, pos + 4, 1, little),
            )
            found.append((host, _number(data, port_at, 2, little)))
            pos = port_at + 2
        elif form == _LARGE:
            port_at = pos + 17 + 3 & ~3
            groups = ["%x" % (_number(data, pos + 1 + i, 2, 0)) for i in range(0, 16, 2)]
            found.append((":".join(groups), _number(data, port_at, 4, little)))
            pos = port_at + 4
        else:
            raise InfoError("an address of format %d" % form)
    return found


def _number(data: "Buffer", at: int, n: int, little: int) -> int:
    if at + n > len(data):
        raise InfoError("cut short")
    value = 0
    for i in range(n):
        value |= data[at + i] << 8 * (i if little else n - 1 - i)
    return value


def _ask(sockets: "dict[int, Any]", host: str, port: int) -> None:
    try:
        info = socket.getaddrinfo(host, port, 0, socket.SOCK_DGRAM)[0]
        if info[0] not in sockets:
            made = socket.socket(info[0], socket.SOCK_DGRAM)
            made.setblocking(False)
            sockets[info[0]] = made
        sockets[info[0]].sendto(_QUESTION, info[-1])
    except OSError:  # no such host, or no way to it
        pass


def _listen(made: "Any", found: "list[tuple[str, int]]", most: int, timeout: int) -> None:
    poll = select.poll()
    poll.register(made, select.POLLIN)
    if not poll.poll(timeout):
        return
    try:
        for locator in locators_untrusted(made.recv(_LARGEST)):
            if locator not in found and len(found) < most:
                found.append(locator)
    except (OSError, ValueError):
        pass
