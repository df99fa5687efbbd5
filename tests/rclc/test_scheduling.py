"""How the system schedules threads: as asked where it permits that, else as before and with a word about why."""

import errno
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any

import pytest

from muros.rclc import REAL_TIME_CRITICAL, SOFT_REAL_TIME, CallbackGroup, Context, Threads
from muros.rclc import scheduling as s
from muros.space import open_space

linux = pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="only Linux schedules so")


def in_thread(function: Callable[[], Any]) -> Any:
    """What a function gives that a thread of its own calls, whose scheduling ends with it."""
    given: list[Any] = []
    thread = threading.Thread(target=lambda: given.append(function()), daemon=True)
    thread.start()
    thread.join(20)
    return given[0]


def permitted() -> bool:
    """Whether this process may have real-time policies."""
    return bool(in_thread(lambda: s.apply(s.fifo(1))) == "")


def refusing(code: int) -> Callable[..., None]:
    """A system call that refuses."""

    def refuse(*arguments: Any) -> None:
        raise OSError(code, os.strerror(code))

    return refuse


@linux
def test_i1_policies_and_processors_are_the_systems() -> None:
    """Each thread has its own; those of I1 are FIFO, on one processor."""
    if not permitted():
        pytest.skip("real-time policies are not permitted here")
    cpu = min(os.sched_getaffinity(0))
    before = os.sched_getscheduler(0), os.sched_getaffinity(0)

    def look(policy: s.Policy) -> tuple[str, int, int, set[int]]:
        problem = s.apply(policy, [cpu])
        return problem, os.sched_getscheduler(0), os.sched_getparam(0).sched_priority, os.sched_getaffinity(0)

    assert in_thread(lambda: look(s.fifo())) == ("", os.SCHED_FIFO, 49, {cpu})
    assert in_thread(lambda: look(s.round_robin(7))) == ("", os.SCHED_RR, 7, {cpu})
    assert in_thread(lambda: look(s.batch())) == ("", os.SCHED_BATCH, 0, {cpu})
    assert in_thread(lambda: look(s.idle())) == ("", os.SCHED_IDLE, 0, {cpu})
    assert (os.sched_getscheduler(0), os.sched_getaffinity(0)) == before


@linux
def test_less_than_the_default_is_permitted_to_everybody() -> None:
    def look() -> tuple[str, int]:
        problem = s.apply(s.other(5))
        return problem, os.getpriority(os.PRIO_PROCESS, threading.get_native_id())

    assert in_thread(look) == ("", 5)


@linux
def test_a_deadline_is_given_where_that_is_permitted() -> None:
    """1 ms of each 100 ms; a pinned thread may not have one, sched(7)."""
    problem, policy = in_thread(
        lambda: (s.apply(s.deadline(0.001, 0.1, 0.05)), os.sched_getscheduler(0) & 0xFF)
    )
    assert policy == 6 or "SCHED_DEADLINE 1/50/100 ms is not permitted: it needs CAP_SYS_NICE" in problem


@linux
@pytest.mark.parametrize(
    ("policy", "code", "said"),
    [
        (
            s.fifo(50),
            errno.EPERM,
            "SCHED_FIFO 50 is not permitted: it needs CAP_SYS_NICE, or the limit rtprio at",
        ),
        (s.round_robin(3), errno.EPERM, "SCHED_RR 3 is not permitted"),
        (s.fifo(50), errno.EINVAL, "SCHED_FIFO 50 was refused: invalid argument."),
        (s.deadline(0.01, 0.02), errno.EBUSY, "SCHED_DEADLINE 10/20/20 ms has no room"),
        (s.deadline(0.01, 0.02), errno.EPERM, "setcap cap_sys_nice"),
        (s.deadline(0.01, 0.02), errno.ENOSYS, "This system has no SCHED_DEADLINE"),
        (
            s.other(-3),
            errno.EACCES,
            "SCHED_OTHER nice -3 is not permitted: it needs CAP_SYS_NICE, or the limit nice",
        ),
    ],
)
def test_what_is_refused_is_said_with_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, policy: s.Policy, code: int, said: str
) -> None:
    monkeypatch.setattr(os, "sched_setscheduler", refusing(code))
    monkeypatch.setattr(os, "setpriority", refusing(code))
    monkeypatch.setattr(s, "_set_deadline", refusing(code))
    assert said in in_thread(lambda: s.apply(policy))


@linux
def test_processors_that_there_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1, 2, 5})
    said = in_thread(lambda: s.apply(None, {4000, 4001}))
    assert said == "It is not pinned to processors 4000-4001: this process may use 0-2, 5."


def test_a_system_without_policies(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("sched_setscheduler", "sched_setaffinity"):
        monkeypatch.delattr(os, name, raising=False)
    assert s.apply(s.fifo(5)) == "This system has no SCHED_FIFO 5."
    assert s.apply(s.deadline(0.01, 0.02)) == "This system has no SCHED_DEADLINE 10/20/20 ms."
    assert s.apply(None, [0]) == "This system does not pin threads to processors."
    assert s.apply(None) == ""


def test_policies_that_cannot_be() -> None:
    for priority in (0, 100, 1.5):
        with pytest.raises(ValueError, match="from 1 to 99"):
            s.fifo(priority)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="from -20 to 19"):
        s.other(20)
    for times in ((0.02, 0.01, None), (0.01, 0.02, 0.03), (0.0, 0.1, None), (float("nan"), 1.0, None)):
        with pytest.raises(ValueError, match="runtime <= deadline <= period"):
            s.deadline(*times)


def test_refusals_are_one_problem_and_the_threads_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_setscheduler", refusing(errno.EPERM), raising=False)
    context = Context("local:")
    problems: list[tuple[int, str]] = []
    context.on_problem(lambda code, text: problems.append((code, text)))
    node = context.node("node")
    threads = Threads(context)
    ran: set[str] = set()
    both = threading.Event()

    def run(name: str) -> None:
        ran.add(name)
        if len(ran) == 2:
            both.set()

    for name, real_time_class in (("critical", REAL_TIME_CRITICAL), ("soft", SOFT_REAL_TIME)):
        group = CallbackGroup(name, real_time_class)
        group.add(node.timer(0.001, lambda name=name: run(name)))  # type: ignore[misc]
        threads.executor(name, None, group)
    with threads:
        assert both.wait(20)
    context.close()
    (code, text), *others = [problem for problem in problems if problem[0] == 52]
    assert code == 52
    assert not others
    assert "'critical', 'soft': SCHED_FIFO 49 is not permitted" in text
    assert text.count("CAP_SYS_NICE") == 1
    assert text.endswith("They go on with what they have.")


def test_on_a_space_a_refusal_is_a_finding_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_setscheduler", refusing(errno.EPERM), raising=False)
    space = open_space("local:")
    context = Context(space)
    problems: list[int] = []
    context.on_problem(lambda code, text: problems.append(code))
    group = CallbackGroup("control", REAL_TIME_CRITICAL)
    ran = threading.Event()
    group.add(context.node("node").timer(0.001, ran.set))
    threads = Threads(context)
    threads.assign(group)
    with threads:
        assert ran.wait(20)
    context.close()
    found = [finding for finding in space.findings.snapshot() if finding.code == "thread-not-scheduled"]
    space.close()
    assert [finding.who for finding in found] == ["the threads of this program"]
    assert "SCHED_FIFO 49 is not permitted" in found[0].why
    assert problems.count(52) == 1


UNPRIVILEGED = """
import os, resource, sys
from muros.rclc import CallbackGroup, Context, REAL_TIME_CRITICAL, Threads, scheduling
context = Context("local:")
group = CallbackGroup("control", REAL_TIME_CRITICAL)
group.add(context.node("node").timer(0.001, context.close))
threads = Threads(context)
threads.assign(group)
resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
if os.getuid() == 0:
    os.setuid(65534)
threads.run()
print("done")
"""


@linux
def test_without_privileges_there_is_one_clear_warning() -> None:
    """The same program as root and as nobody: the one is scheduled, the other says why it is not."""
    done = subprocess.run(
        [sys.executable, "-c", UNPRIVILEGED], capture_output=True, text=True, timeout=50, check=False
    )
    assert done.stdout == "done\n"
    assert done.returncode == 0
    (line,) = done.stderr.splitlines()
    assert line.startswith(
        "muros: threads run, but not all are scheduled as they should be. 'RealTimeCritical': "
    )
    assert "the limit rtprio at least 49 where it is 0" in line
