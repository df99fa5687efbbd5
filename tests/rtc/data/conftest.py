"""Data ports without an ORB: `corba_cdr` is carried in memory."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from muros.rtc.data import TRANSPORTS
from tests.rtc.data.kit import MemoryTransport, Pair


@pytest.fixture(autouse=True)
def memory(monkeypatch: pytest.MonkeyPatch) -> MemoryTransport:
    """What carries `corba_cdr` here."""
    transport = MemoryTransport()
    monkeypatch.setitem(TRANSPORTS.push, "corba_cdr", transport)
    monkeypatch.setitem(TRANSPORTS.pull, "corba_cdr", transport)
    return transport


@pytest.fixture
def pair() -> Iterator[Pair]:
    """An OutPort and an InPort, disconnected at the end."""
    pair = Pair()
    yield pair
    pair.out.disconnect_all()
    pair.in_.disconnect_all()
