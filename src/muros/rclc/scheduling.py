"""How the operating system schedules a thread: policy, priority, processors. Linux has all of it, others the default.

    problem = apply(fifo(50), cpus={1})          # the calling thread; "" or why not

Policies are values. What the system does not permit is no error: a robot that runs late is better than one that does
not run. It is said in words what is missing, and the thread goes on as it was.
"""

from __future__ import annotations

import ctypes
import errno
import math
import os
import platform
import resource
import struct
import threading
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any, Final

from muros.rclc.host.checks import WrongTypeError, WrongValueError

__all__ = [
    "CRITICAL_PRIORITY",
    "NOT_SCHEDULED",
    "SOFT_PRIORITY",
    "Policy",
    "apply",
    "batch",
    "deadline",
    "fifo",
    "idle",
    "name_thread",
    "other",
    "pin",
    "round_robin",
    "schedule",
]

NOT_SCHEDULED: Final = 52
"""The code with which ``on_problem`` is told that threads are not scheduled as they should be."""

LEAST_PRIORITY: Final = 1
HIGHEST_PRIORITY: Final = 99
"""Priorities of real-time policies; sched(7)."""

CRITICAL_PRIORITY: Final = (LEAST_PRIORITY + HIGHEST_PRIORITY) // 2 - 1
"""Below the kernel's own threads for interrupts, which have 50."""

SOFT_PRIORITY: Final = CRITICAL_PRIORITY // 2

_SCHED_DEADLINE = 6
_RESET_ON_FORK = 0x01
_SCHED_SETATTR = {"x86_64": 314, "aarch64": 274, "armv7l": 380, "armv6l": 380, "riscv64": 274, "i686": 351}
"""The number of the system call, which the C library has no function for."""
_SHORTEST = 1024e-9
"""Seconds: the kernel takes no shorter runtime."""


@dataclass(frozen=True)
class Policy:
    """A policy with its parameters; made by ``fifo``, ``round_robin``, ``deadline``, ``other``, ``batch``, ``idle``."""

    name: str
    """As sched(7) calls it, without SCHED_."""
    priority: int = 0
    nice: int = 0
    runtime: float = 0.0
    """Seconds of each period, with DEADLINE."""
    deadline: float = 0.0
    period: float = 0.0

    @property
    def real_time(self) -> bool:
        """Whether threads that have it go before all that have not."""
        return self.name in ("FIFO", "RR", "DEADLINE")

    def __str__(self) -> str:
        text = f"SCHED_{self.name}"
        if self.name == "DEADLINE":
            times = (self.runtime, self.deadline, self.period)
            return f"{text} {'/'.join(f'{1000 * seconds:g}' for seconds in times)} ms"
        if self.priority:
            return f"{text} {self.priority}"
        return f"{text} nice {self.nice}" if self.nice else text


def fifo(priority: int = CRITICAL_PRIORITY) -> Policy:
    """Runs until it waits, before everything of lower priority (1 to 99). ValueError for another priority."""
    return Policy("FIFO", _priority(priority))


def round_robin(priority: int = SOFT_PRIORITY) -> Policy:
    """As ``fifo``, but takes turns with threads of the same priority."""
    return Policy("RR", _priority(priority))


def deadline(runtime: float, period: float, deadline: float | None = None) -> Policy:
    """``runtime`` seconds of each ``period``, within ``deadline`` seconds (None: the period) of its beginning.

    The earliest deadline goes first, before all other policies; who uses more than his runtime waits. ValueError
    unless runtime <= deadline <= period.
    """
    given = (runtime, period if deadline is None else deadline, period)
    numbers = all(isinstance(value, int | float) and math.isfinite(value) for value in given)
    if not numbers or not _SHORTEST <= given[0] <= given[1] <= given[2]:
        raise WrongValueError(
            f"deadline(runtime={runtime!r}, period={period!r}, deadline={deadline!r}): seconds with "
            "runtime <= deadline <= period, and a runtime of at least 1024 ns"
        )
    return Policy("DEADLINE", runtime=float(given[0]), deadline=float(given[1]), period=float(given[2]))


def other(nice: int = 0) -> Policy:
    """The system's default; ``nice`` is from -20 (a large share) to 19 (a small one). ValueError for another."""
    if not isinstance(nice, int) or not -20 <= nice <= 19:
        raise WrongValueError(f"nice is {nice!r}: it must be from -20 to 19")
    return Policy("OTHER", nice=nice)


def batch() -> Policy:
    """As the default, but woken later than threads that answer somebody."""
    return Policy("BATCH")


def idle() -> Policy:
    """Runs when nothing else wants to."""
    return Policy("IDLE")


def apply(policy: Policy | None, cpus: Collection[int] | None = None) -> str:
    """Has the calling thread scheduled by a policy, on the processors ``cpus`` (None: as it is).

    "" if the system did it, else why not and what to do about it, in one sentence. What is possible of it is done.
    """
    return " ".join(text for text in (pin(cpus), schedule(policy)) if text)


def pin(cpus: Collection[int] | None) -> str:
    """The half of ``apply`` that is about processors."""
    if cpus is None:
        return ""
    if not hasattr(os, "sched_setaffinity"):
        return "This system does not pin threads to processors."
    try:
        os.sched_setaffinity(threading.get_native_id(), cpus)
    except (OSError, ValueError, OverflowError):
        usable = _ranges(sorted(os.sched_getaffinity(0)))
        return f"It is not pinned to processors {_ranges(sorted(cpus))}: this process may use {usable}."
    return ""


def schedule(policy: Policy | None) -> str:
    """The half of ``apply`` that is about the policy."""
    if policy is None:
        return ""
    thread = threading.get_native_id()
    try:
        if policy.name == "DEADLINE":
            _set_deadline(policy)
            return ""
        number = getattr(os, f"SCHED_{policy.name}", None)
        if number is None or not hasattr(os, "sched_setscheduler"):
            return f"This system has no {policy}."
        if os.sched_getscheduler(thread) != number or policy.real_time:
            os.sched_setscheduler(thread, number, os.sched_param(policy.priority))
        if policy.name == "OTHER" and os.getpriority(os.PRIO_PROCESS, thread) != policy.nice:
            os.setpriority(os.PRIO_PROCESS, thread, policy.nice)
    except OSError as error:
        return _refusal(policy, error.errno or 0)
    return ""


def name_thread(name: str) -> None:
    """Names the calling thread as tools like ``top -H`` show it: its first 15 bytes."""
    try:
        with open(f"/proc/self/task/{threading.get_native_id()}/comm", "wb") as file:
            file.write(name.encode()[:15])
    except OSError:
        pass  # only Linux has such a place


def check(policy: Any, cpus: Any) -> None:
    """Raises TypeError and ValueError for what ``apply`` cannot take."""
    if policy is not None and not isinstance(policy, Policy):
        raise WrongTypeError(
            f"a policy is made by fifo(), round_robin(), deadline() or other(), not {policy!r}"
        )
    if cpus is None:
        return
    if isinstance(cpus, str) or not isinstance(cpus, Collection) or not cpus:
        raise WrongTypeError(f"cpus is {cpus!r}: it must be the numbers of processors, such as {{0, 1}}")
    for number in cpus:
        if not isinstance(number, int) or number < 0:
            raise WrongValueError(f"cpus has {number!r}: processors are numbered from 0")


def _priority(priority: Any) -> int:
    if not isinstance(priority, int) or not LEAST_PRIORITY <= priority <= HIGHEST_PRIORITY:
        raise WrongValueError(
            f"priority is {priority!r}: real-time priorities are from {LEAST_PRIORITY} to {HIGHEST_PRIORITY}"
        )
    return priority


def _set_deadline(policy: Policy) -> None:
    """The system call sched_setattr(2) for the calling thread; OSError."""
    number = _SCHED_SETATTR.get(platform.machine())
    if number is None or not hasattr(os, "sched_setscheduler"):
        raise OSError(errno.ENOSYS, os.strerror(errno.ENOSYS))
    times = [round(seconds * 1e9) for seconds in (policy.runtime, policy.deadline, policy.period)]
    attributes = struct.pack("=IIQiIQQQ", 48, _SCHED_DEADLINE, _RESET_ON_FORK, 0, 0, *times)
    library = ctypes.CDLL(None, use_errno=True)
    if library.syscall(number, 0, attributes, 0):
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))


def _refusal(policy: Policy, code: int) -> str:
    """Why the system does not give a policy, and what to do."""
    if code in (errno.EPERM, errno.EACCES):
        if policy.name == "DEADLINE":
            return (
                f"{policy} is not permitted: it needs CAP_SYS_NICE (run as root, or: setcap cap_sys_nice+ep on the "
                "interpreter), and a thread that is not pinned."
            )
        if policy.real_time:
            return f"{policy} is not permitted: it needs CAP_SYS_NICE, or {_limit('rtprio', policy.priority)}"
        return f"{policy} is not permitted: it needs CAP_SYS_NICE, or {_limit('nice', policy.nice)}"
    if code == errno.EBUSY:
        return (
            f"{policy} has no room: the deadlines of all threads take more time than the system grants them."
        )
    if code == errno.ENOSYS:
        return f"This system has no {policy}."
    return f"{policy} was refused: {os.strerror(code).lower()}."


def _limit(name: str, value: int) -> str:
    """The limit of a user that must be raised, and how."""
    kind = getattr(resource, f"RLIMIT_{name.upper()}", None)
    has = "unknown"
    if kind is not None:
        now = resource.getrlimit(kind)[0]
        has = str(now if name == "rtprio" else 20 - now)
    user = os.environ.get("USER") or "YOU"
    order = "at least" if name == "rtprio" else "at most"
    return (
        f"the limit {name} {order} {value} where it is {has} "
        f'(put "{user} - {name} {value}" into /etc/security/limits.conf and log in again).'
    )


def _ranges(numbers: list[int]) -> str:
    """Numbers as people write them: 0-3, 6."""
    said: list[list[int]] = []
    for number in numbers:
        if said and said[-1][-1] == number - 1:
            said[-1][-1:] = [said[-1][-1], number] if len(said[-1]) == 1 else [number]
        else:
            said.append([number])
    return ", ".join("-".join(map(str, run)) for run in said)
