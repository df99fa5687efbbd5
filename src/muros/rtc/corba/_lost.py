"""What calls to other processes raise, as errors of this room."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import omniORB
from omniORB import CORBA

from muros.rtc.codes import PeerLostError, RtcError

__all__ = ["LOST", "describe", "peer", "quick_answer"]

QUICK_SECONDS: Final = 2.0
"""Time that a peer has to say that it exists: tools wait for it."""


LOST = (CORBA.TRANSIENT, CORBA.COMM_FAILURE, CORBA.OBJECT_NOT_EXIST, CORBA.TIMEOUT, CORBA.INV_OBJREF)
"""The other side has ended, the line is cut, or it took too long."""


@contextmanager
def peer(what: str) -> Iterator[None]:
    """A call of `what` of another process: PeerLostError if nobody answers, RtcError if it fails there."""
    try:
        yield
    except LOST as error:
        raise PeerLostError(f"{what} does not answer: {describe(error)}") from error
    except CORBA.Exception as error:
        raise RtcError(f"{what} failed: {describe(error)}") from error


@contextmanager
def quick_answer(seconds: float = QUICK_SECONDS) -> Iterator[None]:
    """Calls of this thread to other processes end after `seconds` at most; what they raise is left as it is."""
    omniORB.setClientThreadCallTimeout(round(seconds * 1000))
    try:
        yield
    finally:
        omniORB.setClientThreadCallTimeout(0)


def describe(error: BaseException) -> str:
    """The name of a CORBA exception with the ORB's reason: `TRANSIENT (ConnectFailed)`."""
    name = type(error).__name__
    if isinstance(error, CORBA.SystemException):
        minor = omniORB.minorCodeToString(error) or f"minor {error.minor:#x}"
        return f"{name} ({minor.removeprefix(name + '_')})"
    text = getattr(error, "description", "") or ""
    return f"{name}: {text}" if text else name
