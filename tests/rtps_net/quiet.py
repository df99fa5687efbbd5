"""A domain of one's own in which really nobody is: not even those who ask nobody for a domain."""

import socket

from muros.rtps import Ports
from tests.dds.domains import Domain, free_domain

__all__ = ["quiet_domain"]

TRIES = 100
"""Domains that are tried."""
INDICES = 4
"""Participant indices whose ports have to be free."""


def quiet_domain() -> Domain:
    """Claims a domain in which no well-known port is taken now."""
    for _ in range(TRIES):
        domain = free_domain()
        if _is_quiet(Ports(domain)):
            return domain
        domain.release()
    raise TimeoutError(f"in {TRIES} test domains somebody is")


def _is_quiet(ports: Ports) -> bool:
    numbers = [ports.multicast]
    for index in range(INDICES):
        numbers += [ports.unicast(index), ports.user_unicast(index)]
    for number in numbers:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("0.0.0.0", number))
            except OSError:
                return False
    return True
