"""Callback groups, and the threads that run them with priorities.

    control = CallbackGroup("control", REAL_TIME_CRITICAL)
    control.add(laser)
    logging = CallbackGroup("logging", BEST_EFFORT)
    logging.add(node.timer(1.0, report))

    threads = Threads(context)
    threads.assign(control, logging)              # a thread for each class, scheduled as the class asks
    threads.run()                                 # until Ctrl-C, or until a callback raises

Each thread runs one ``Executor``, which may have a trigger, a period or LET of its own; the callbacks of a thread never
run at the same time. How messages find their thread is told in ``sharing``, how threads are scheduled in
``scheduling``. See docs/threads.md.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Collection
from enum import Enum
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final

from muros.rclc import scheduling
from muros.rclc.context import Context as AnyContext
from muros.rclc.errors import RclError
from muros.rclc.host.checks import WrongTypeError, be_handle, be_text
from muros.rclc.host.executor import Executor
from muros.rclc.host.handles import describe, tell_problem
from muros.rclc.host.sharing import Ended, Seat, share
from muros.rclc.scheduling import Policy

if TYPE_CHECKING:
    from muros.rclc.host.context import Context, Node

__all__ = [
    "BEST_EFFORT",
    "REAL_TIME_CRITICAL",
    "SOFT_REAL_TIME",
    "CallbackGroup",
    "ExecutorThread",
    "RealTimeClass",
    "ThreadError",
    "Threads",
]

THREAD_ENDED: Final = 53
"""The code with which ``on_problem`` is told that a thread has ended because something raised."""

SWITCH_INTERVAL: Final = 0.0005
"""Seconds after which a thread that runs Python lets another one, while there are real-time threads."""


class RealTimeClass(Enum):
    """What a group needs of the system; the classes of the callback-group-level executor of micro-ROS."""

    REAL_TIME_CRITICAL = "RealTimeCritical"
    SOFT_REAL_TIME = "SoftRealTime"
    BEST_EFFORT = "BestEffort"


REAL_TIME_CRITICAL = RealTimeClass.REAL_TIME_CRITICAL
SOFT_REAL_TIME = RealTimeClass.SOFT_REAL_TIME
BEST_EFFORT = RealTimeClass.BEST_EFFORT

POLICIES: Final = {
    REAL_TIME_CRITICAL: scheduling.fifo(scheduling.CRITICAL_PRIORITY),
    SOFT_REAL_TIME: scheduling.round_robin(scheduling.SOFT_PRIORITY),
    BEST_EFFORT: scheduling.other(),
}
"""How a class is scheduled unless a thread is told otherwise."""


class ThreadError(RclError):
    """A thread has ended because something raised; that is the cause. ``name`` is the thread's."""

    def __init__(self, name: str, cause: BaseException) -> None:
        notes = "".join(f", {note}" for note in getattr(cause, "__notes__", ()))
        super().__init__(f"thread {name!r} has ended: {type(cause).__name__}: {cause}{notes}")
        self.name = name
        self.__cause__ = cause


class CallbackGroup:
    """Handles of one context that belong together: one thread runs them, in the order of adding."""

    def __init__(self, name: str, real_time_class: RealTimeClass = BEST_EFFORT) -> None:
        be_text(name, "the name of a group")
        if not isinstance(real_time_class, RealTimeClass):
            raise WrongTypeError(
                f"the class of a group is REAL_TIME_CRITICAL, SOFT_REAL_TIME or BEST_EFFORT, not {real_time_class!r}"
            )
        self.name = name
        self.real_time_class = real_time_class
        self.thread: ExecutorThread | None = None
        """Where it is run."""
        self._members: list[tuple[Any, tuple[Any, ...], dict[str, Any]]] = []

    @property
    def handles(self) -> list[Any]:
        """What is in it, in the order of adding."""
        return [handle for handle, _, _ in self._members]

    def add(self, handle: Any, *arguments: Any, **options: Any) -> Any:
        """Puts a handle into the group and returns it; further arguments are those of ``Executor.add``.

        Raises RclError for a handle that is in a group already, TypeError for what is no handle.
        """
        be_handle(handle, "a group")
        other = vars(handle).get("callback_group") if hasattr(handle, "__dict__") else None
        if other is not None:
            raise RclError(
                f"{describe(handle)}, is in group {other.name!r} already: a handle is in one group"
            )
        if self.thread is not None:
            self.thread.add(handle, *arguments, **options)
        handle.callback_group = self
        self._members.append((handle, arguments, options))
        return handle

    def add_node(self, node: Node) -> None:
        """Puts everything into the group that was made on a node and is in no group, in the order of making."""
        for handle in list(node.context.handles):
            if handle in node.entities and vars(handle).get("callback_group") is None:
                self.add(handle)

    def __repr__(self) -> str:
        return f"CallbackGroup({self.name!r}, {self.real_time_class.value}, {len(self._members)} handles)"


class ExecutorThread:
    """A thread that runs an executor; made by ``Threads.executor``.

    ``executor`` is the ``Executor``. ``unscheduled`` says why the system does not schedule the thread as ``policy``
    says, ``unpinned`` why not on ``cpus``, "" if it does; ``error`` is what has ended the thread, None if nothing has.
    """

    def __init__(
        self,
        owner: Threads,
        name: str,
        policy: Policy | None,
        cpus: Collection[int] | None,
        executor: Executor,
    ) -> None:
        self.name = name
        self.policy = policy
        self.cpus = cpus
        self.executor = executor
        self.groups: list[CallbackGroup] = []
        self.unpinned = ""
        self.unscheduled = ""
        self.error: BaseException | None = None
        self.ended = True
        self._owner = owner
        self._seat = Seat(name)
        self._thread: threading.Thread | None = None
        self._settled = threading.Event()
        self._spent = 0.0

    def add(self, handle: Any, *arguments: Any, **options: Any) -> None:
        """Runs a handle in this thread; arguments as for ``Executor.add``. While it runs: from its callbacks alone."""
        self.executor.add(handle, *arguments, **options)
        self._owner.sharing.claim(handle, self._seat)

    def assign(self, *groups: CallbackGroup) -> None:
        """Runs the handles of groups in this thread. RclError for a group that another thread runs."""
        for group in groups:
            if group.thread is not None:
                raise RclError(f"group {group.name!r} is run by thread {group.thread.name!r} already")
            for handle, arguments, options in group._members:
                self.add(handle, *arguments, **options)
            group.thread = self
            self.groups.append(group)

    def call(self, function: Callable[[], object]) -> None:
        """Has the thread call a function between two passes; from any thread. What it raises ends the thread."""
        self._seat.call(function)

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def native_id(self) -> int | None:
        """The system's number of the thread, as in top -H; None while it does not run."""
        return self._thread.native_id if self._thread is not None and self.alive else None

    @property
    def cpu_time(self) -> float:
        """Seconds for which it has computed."""
        thread = self._thread
        if thread is None or thread.ident is None or not thread.is_alive():
            return self._spent
        try:
            return time.clock_gettime(time.pthread_getcpuclockid(thread.ident))
        except (OSError, AttributeError):  # it has ended just now; a system that does not tell
            return self._spent

    def prepare(self) -> None:
        """Makes sure that what the executor runs belongs to this thread, however it was added; used by ``Threads``."""
        for handle in self.executor.handles:
            self._owner.sharing.claim(handle, self._seat)
        self._seat.ending = False
        self.error = None
        self._settled.clear()

    def start(self) -> None:
        """Begins, unless it is to end already; used by ``Threads``."""
        self.ended = False
        self._thread = threading.Thread(target=self._run, name=f"muros {self.name}", daemon=True)
        self._thread.start()

    def settle(self) -> None:
        """Waits until it is known how the system schedules the thread."""
        self._settled.wait()

    def end(self) -> None:
        """Has it end when the callback that runs is over; from any thread."""
        self._seat.ending = True
        self._seat.bell.ring()

    def join(self, timeout: float | None) -> bool:
        """Waits until it has ended, at most so many seconds; whether it has."""
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join(timeout)
        return not self.alive

    def _run(self) -> None:
        sharing = self._owner.sharing
        try:
            scheduling.name_thread(self.name)
            self.unpinned = scheduling.pin(self.cpus)
            self.unscheduled = scheduling.schedule(self.policy)
            sharing.sit(self._seat)
            self._settled.set()
            executor = self.executor
            if executor.period:
                executor.spin_period()
            else:
                executor.spin()
        except Ended:
            pass
        except BaseException as error:
            self.error = error
        finally:
            self._spent = time.thread_time()
            sharing.leave()
            self._settled.set()
            self.ended = True
            self._owner._ended(self)


class Threads:
    """The threads that run the callbacks of a context.

    What none of them has claimed the thread that calls ``start`` may run, with an ``Executor(context)`` of its own.
    The first error ends all threads and is raised by ``join``, unless ``keep_going``: then only the thread where it
    was raised ends. ``switch_interval``: seconds after which the interpreter lets another thread run, for the whole
    process, while there are real-time threads; None leaves it as it is.
    """

    def __init__(
        self,
        context: Context,
        *,
        keep_going: bool = False,
        switch_interval: float | None = SWITCH_INTERVAL,
    ) -> None:
        if not isinstance(context, AnyContext):
            raise WrongTypeError(f"Threads needs a context, not {context!r}")
        self.context = context
        self.sharing = share(context)
        self.keep_going = keep_going
        self.switch_interval = switch_interval
        self.threads: list[ExecutorThread] = []
        self._changed = threading.Condition()
        self._failures: list[ThreadError] = []
        self._started = False
        self._hurries = False

    # What runs where

    def executor(
        self,
        name: str,
        policy: Policy | None = None,
        *groups: CallbackGroup,
        cpus: Collection[int] | None = None,
        **options: Any,
    ) -> ExecutorThread:
        """A thread with an executor, for ``groups`` and for what is added to it.

        ``policy`` is made by ``fifo``, ``round_robin``, ``deadline``, ``other``; None: that of the most urgent of the
        groups when it starts. ``cpus`` are the numbers of the processors it may run on. ``options`` are those of
        ``Executor``; one with a period runs ``spin_period``. Raises RclError for a name that is taken.
        """
        scheduling.check(policy, cpus)
        if any(thread.name == name for thread in self.threads):
            raise RclError(f"there is a thread {name!r} already: give each a name of its own")
        if self._started:
            raise RclError("the threads run already: make them all before start()")
        made = ExecutorThread(self, name, policy, cpus, Executor(self.context, **options))
        made.assign(*groups)
        self.threads.append(made)
        return made

    def assign(self, *groups: CallbackGroup, cpus: Collection[int] | None = None) -> list[ExecutorThread]:
        """A thread for each real-time class among groups, named and scheduled like the class."""
        made = []
        for real_time_class in RealTimeClass:
            same = [group for group in groups if group.real_time_class is real_time_class]
            if same:
                made.append(self.executor(real_time_class.value, POLICIES[real_time_class], *same, cpus=cpus))
        return made

    # Running

    def start(self) -> None:
        """Begins all threads. What the system does not permit is told once, as a problem.

        Raises RclError when they run already, or there is nothing to run.
        """
        if self._started:
            raise RclError("the threads run already")
        for thread in self.threads:
            if thread.executor.handles is self.context.handles:
                raise RclError(
                    f"thread {thread.name!r} has nothing to run: add handles or assign groups to it"
                )
        for thread in self.threads:
            thread.policy = thread.policy or _policy_of(thread.groups)
        policies = [thread.policy for thread in self.threads if thread.policy is not None]
        urgent = [policy for policy in policies if policy.real_time]
        said: list[str] = []
        settled = threading.Event()

        def prepare() -> None:
            scheduling.name_thread("carrier")
            said.append(scheduling.apply(_above(urgent)))
            settled.set()

        self._failures.clear()
        for thread in self.threads:
            thread.prepare()
        self.sharing.start(prepare, self._carrier_failed)
        self._started = True
        if urgent and self.switch_interval is not None:
            self._hurries = True
            _hurry.begin(self.switch_interval)
        for thread in self.threads:
            thread.start()
        for thread in self.threads:
            thread.settle()
        settled.wait()
        self._tell_scheduling(said[0])

    def stop(self, timeout: float | None = None) -> bool:
        """Ends all threads when the callbacks that run are over; whether they have ended within ``timeout`` seconds.

        The context stays open. Does not raise what threads have raised: ``join`` does, and ``with``.
        """
        if not self._started:
            return True
        end = None if timeout is None else time.monotonic() + timeout
        for thread in self.threads:
            thread.end()
        for thread in self.threads:
            if not thread.join(None if end is None else max(0.0, end - time.monotonic())):
                return False
        if any(thread.alive for thread in self.threads):
            return False  # asked by one of them, which ends when its callback is over
        self.sharing.stop()
        if self._hurries:
            self._hurries = False
            _hurry.end()
        self._started = False
        return True

    def join(self, timeout: float | None = None) -> bool:
        """Waits until the threads have ended, or one has failed; whether that is so within ``timeout`` seconds.

        They end with the context and by ``stop``. Raises ThreadError for the first that has ended by an error, after
        all have ended; with ``keep_going`` when all have.
        """
        with self._changed:
            over = self._changed.wait_for(self._is_over, timeout)
        if over:
            self.stop()
            self._raise()
        return over

    def run(self, seconds: float | None = None) -> None:
        """Starts the threads and waits, at most ``seconds``; then stops them. Raises as ``join``.

        Ctrl-C ends it: the context takes leave of the graph.
        """
        try:
            self.start()
            self.join(seconds)
        except KeyboardInterrupt:
            self.context.close()
        finally:
            self.stop()
        self._raise()

    @property
    def errors(self) -> list[ThreadError]:
        """What has ended threads since the start."""
        return list(self._failures)

    def __enter__(self) -> Threads:
        self.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()
        if error is None:
            self._raise()

    # Helpers

    def _ended(self, thread: ExecutorThread) -> None:
        """A thread ends; told by itself."""
        if thread.error is not None:
            self._fail(ThreadError(thread.name, thread.error))
        with self._changed:
            self._changed.notify_all()

    def _carrier_failed(self, error: BaseException) -> None:
        """The carrier ends; without it nothing can go on."""
        self._fail(ThreadError("carrier", error), fatal=True)

    def _fail(self, failure: ThreadError, fatal: bool = False) -> None:
        with self._changed:
            self._failures.append(failure)
        if fatal or not self.keep_going:
            for thread in self.threads:
                thread.end()
        try:
            tell_problem(self.context, THREAD_ENDED, str(failure))
        except Exception as error:  # of the program's on_problem
            self._failures.append(ThreadError(failure.name, error))
        with self._changed:
            self._changed.notify_all()

    def _is_over(self) -> bool:
        if self._failures and not self.keep_going:
            return True
        return all(thread.ended for thread in self.threads)

    def _raise(self) -> None:
        if self._failures:
            raise self._failures[0]

    def _tell_scheduling(self, carrier: str) -> None:
        """Tells of all threads together what the system has refused."""
        said: dict[str, list[str]] = {}
        urgent = ""
        for thread in sorted(self.threads, key=lambda each: -(each.policy.priority if each.policy else 0)):
            problem = thread.unscheduled
            if problem and thread.policy is not None and thread.policy.priority:
                problem = urgent = urgent or problem  # what lets this one through lets those below through
            for text in (problem, thread.unpinned):
                if text:
                    said.setdefault(text, []).append(repr(thread.name))
        if carrier and not said:
            said[carrier] = ["'carrier'"]
        if said:
            why = " ".join(f"{', '.join(names)}: {problem}" for problem, names in said.items())
            tell_problem(
                self.context,
                scheduling.NOT_SCHEDULED,
                f"threads run, but not all are scheduled as they should be. {why} They go on with what they have.",
            )
            find = getattr(self.context.middleware, "not_scheduled", None)
            if find is not None:  # straight on a space, which has findings
                find("the threads of this program", why)


class _Hurry:
    """The interpreter's switch interval, which belongs to the whole process: the last of those who shorten it sets it
    back."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._count = 0
        self._before = 0.0

    def begin(self, seconds: float) -> None:
        """Shortens it."""
        with self._lock:
            if not self._count:
                self._before = sys.getswitchinterval()
            self._count += 1
            sys.setswitchinterval(min(seconds, sys.getswitchinterval()))

    def end(self) -> None:
        """Is done."""
        with self._lock:
            self._count -= 1
            if not self._count:
                sys.setswitchinterval(self._before)


_hurry = _Hurry()


def _policy_of(groups: list[CallbackGroup]) -> Policy | None:
    """The policy of the most urgent group."""
    classes = {group.real_time_class for group in groups}
    return next((POLICIES[each] for each in RealTimeClass if each in classes), None)


def _above(urgent: list[Policy]) -> Policy | None:
    """The policy of the carrier: it must not wait for the threads that wait for it."""
    if not urgent:
        return None
    highest = scheduling.HIGHEST_PRIORITY
    return scheduling.fifo(min(max(policy.priority or highest for policy in urgent) + 1, highest))
