"""What calls to other processes raise, as errors of this room."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final, TypeVar

import omniORB
from omniORB import CORBA

from muros.rtc.codes import PeerLostError, RtcError

__all__ = ["LOST", "asked_again", "describe", "is_late", "is_there", "peer", "quick_answer"]

T = TypeVar("T")

QUICK_SECONDS: Final = 2.0
"""Time that a peer has to say that it exists: tools wait for it."""

LOST: Final = (CORBA.TRANSIENT, CORBA.COMM_FAILURE, CORBA.OBJECT_NOT_EXIST, CORBA.TIMEOUT, CORBA.INV_OBJREF)
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


def asked_again(call: Callable[[], T]) -> T:
    """What `call` gives, which may be asked twice, at the second try if need be.

    A line to a process that has ended is noticed when it is used. Where another process listens at the same address
    by then (it was started again, or got the port by chance), the first call fails and the next one reaches it.
    """
    try:
        return call()
    except CORBA.COMM_FAILURE:
        return call()


@contextmanager
def quick_answer(seconds: float = QUICK_SECONDS) -> Iterator[None]:
    """Calls of this thread to other processes end after `seconds` at most; what they raise is left as it is.

    Within another such block its time holds again afterwards.
    """
    before: float = getattr(_thread, "seconds", 0.0)
    _give(seconds)
    try:
        yield
    finally:
        _give(before)


def _give(seconds: float) -> None:
    _thread.seconds = seconds
    omniORB.setClientThreadCallTimeout(round(seconds * 1000))


def is_late(error: BaseException) -> bool:
    """Whether a call has ended because there was no answer in time: the other side may be there and busy."""
    return isinstance(error, CORBA.SystemException) and "CallTimed" in omniORB.minorCodeToString(error)


def is_there(reference: Any) -> bool:
    """Whether an object's process says that it exists; one that does not answer in time may be busy."""
    try:
        with quick_answer():
            return not asked_again(reference._non_existent)
    except CORBA.Exception as error:
        return is_late(error)


def describe(error: BaseException) -> str:
    """The name of a CORBA exception with the ORB's reason: `TRANSIENT (ConnectFailed)`."""
    name = type(error).__name__
    if isinstance(error, CORBA.SystemException):
        minor = omniORB.minorCodeToString(error) or f"minor {error.minor:#x}"
        return f"{name} ({minor.removeprefix(name + '_')})"
    text = getattr(error, "description", "") or ""
    return f"{name}: {text}" if text else name


_thread: Final = threading.local()
"""What the ORB does not tell: the time that calls of a thread have."""
