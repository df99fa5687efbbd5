"""Sense, plan, act: stages in a fixed order, and components that run in one of them.

    robot = SensePlanAct(["sense", "plan", "act"])
    robot.add("sense", Executor(context, trigger=all_of(laser, imu)))
    robot.add("plan", localise)
    robot.add("plan", find_path, after=[localise])
    robot.add("act", drive)
    robot.run(0.05)

Theory of operation. A turn of the main loop goes through the stages in order. A component belongs to one stage: it is
woken when the stage begins, and the next stage begins when all components of this one have finished. So what plans sees
what all have sensed. Components of one stage run at the same time, each in a thread of its own, or one after the other
in the thread of the loop (``parallel=False``); executors always do the latter, as their handles belong to one thread.

A component may have a *barrier*: others that must have finished in this turn before it begins. They were added before
it, to this stage or one before, so that nobody can wait for himself.

A component that has not finished ``patience`` seconds after its stage began is late: that is told, and the loop goes on
without it. It is woken again in the turn after it has finished. Whoever has it in his barrier misses that and is left
out of this turn, which is told too. So no component can stop a robot, and none is left behind in silence.

This is how the robot framework Fawkes synchronises its main loop (its ten stages are ``FAWKES_STAGES``). Components
that belong to no stage have a thread of their own beside it, see ``groups``.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Collection, Sequence
from enum import Enum
from types import TracebackType
from typing import Any, Final

from muros.client import reasons
from muros.rclc import scheduling
from muros.rclc.errors import RclError
from muros.rclc.executor import Executor
from muros.rclc.host.checks import WrongTypeError, WrongValueError
from muros.rclc.host.handles import tell_problem
from muros.rclc.host.sharing import Bell
from muros.rclc.scheduling import NOT_SCHEDULED, Policy

__all__ = ["FAWKES_STAGES", "Component", "ComponentError", "SensePlanAct", "State"]

FAWKES_STAGES: Final = (
    "pre_loop",
    "sensor_acquire",
    "sensor_prepare",
    "sensor_process",
    "worldstate",
    "think",
    "skill",
    "act",
    "act_exec",
    "post_loop",
)
"""The stages of Fawkes' main loop."""

LATE: Final = 54
"""The code with which ``on_problem`` is told of components that are late, and of barriers that were missed."""

PATIENCE: Final = 1.0
"""Seconds that a stage may take."""


class State(Enum):
    """What becomes of a component in a turn."""

    IDLE = "idle"
    WAITING = "waits at its barrier"
    RUNNING = "runs"
    FINISHED = "has finished"
    LEFT_OUT = "was left out"
    LATE = "is late"


_OPEN = (State.WAITING, State.RUNNING)
"""The states of components that others wait for."""


class ComponentError(RclError):
    """A component has raised; that is the cause. ``component`` is what did."""

    def __init__(self, component: Component, cause: BaseException) -> None:
        super().__init__(
            f"component {component.name!r} of stage {component.stage!r}: {type(cause).__name__}: {cause}"
        )
        self.component = component
        self.__cause__ = cause


class Component:
    """What runs in a stage; made by ``SensePlanAct.add``.

    ``turns`` counts how often it ran, ``missed`` the turns that it was left out of or too late for, ``longest`` is the
    longest time that it took, in seconds.
    """

    def __init__(
        self,
        name: str,
        stage: str,
        function: Callable[[], object],
        barrier: Sequence[Component],
        parallel: bool,
        policy: Policy | None,
        cpus: Collection[int] | None,
    ) -> None:
        self.name = name
        self.stage = stage
        self.function = function
        self.barrier = tuple(barrier)
        self.parallel = parallel
        self.policy = policy
        self.cpus = cpus
        self.state = State.IDLE
        self.turns = 0
        self.missed = 0
        self.longest = 0.0
        self.error: BaseException | None = None
        self._bell: Bell | None = None  # of its thread, while it has one

    def __repr__(self) -> str:
        return f"Component({self.name!r}, {self.stage!r}, {self.state.value})"


class SensePlanAct:
    """A main loop of ``stages``; each may take ``patience`` seconds.

    ``keep_going``: what a component raises is told, and the loop goes on; else it ends the turn and ``loop`` raises it.
    ``on_problem(code, text)`` is told what is late; None: as the context of the executors tells its problems, or on
    standard error. ``overruns`` counts the turns that took longer than the period.
    """

    def __init__(
        self,
        stages: Sequence[str] = ("sense", "plan", "act"),
        *,
        patience: float = PATIENCE,
        keep_going: bool = False,
        on_problem: Callable[[int, str], object] | None = None,
    ) -> None:
        if isinstance(stages, str) or not stages or len(set(stages)) != len(stages):
            raise WrongValueError(
                f"stages are names, each once, such as ['sense', 'plan', 'act'], not {stages!r}"
            )
        _be_seconds(patience, "patience")
        self.stages = tuple(stages)
        self.patience = patience
        self.keep_going = keep_going
        self.on_problem = on_problem
        self.components: list[Component] = []
        self.turns = 0
        self.overruns = 0
        self._executors: list[Executor] = []
        self._changed = threading.Condition()
        self._ending = False

    def add(
        self,
        stage: str,
        component: Callable[[], object] | Executor,
        name: str = "",
        *,
        after: Sequence[Any] = (),
        parallel: bool = True,
        policy: Policy | None = None,
        cpus: Collection[int] | None = None,
    ) -> Component:
        """A component of a stage: a function, or an executor, which makes one pass in each turn.

        ``after`` is its barrier: components, or functions or names of components, that were added before. A thread of
        its own is scheduled by ``policy``, on ``cpus``, see ``scheduling``. Raises ValueError for a stage that there is
        not, a name that is taken, and for a barrier of components that run later.
        """
        if stage not in self.stages:
            raise WrongValueError(f"there is no stage {stage!r}, only {', '.join(self.stages)}")
        scheduling.check(policy, cpus)
        if isinstance(component, Executor):
            self._executors.append(component)
            parallel = False
            function: Callable[[], object] = component.spin_some
            name = name or f"executor {len(self._executors)}"
        elif callable(component):
            function = component
            name = name or getattr(component, "__name__", type(component).__name__)
        else:
            raise WrongTypeError(f"a component is a function or an executor, not {component!r}")
        if any(other.name == name for other in self.components):
            raise WrongValueError(f"there is a component {name!r} already: give this one a name of its own")
        barrier = [self._find(other, name) for other in after]
        for other in barrier:
            if self.stages.index(other.stage) > self.stages.index(stage):
                raise WrongValueError(
                    f"{name!r} of stage {stage!r} cannot wait for {other.name!r}, which runs later, in {other.stage!r}"
                )
        made = Component(name, stage, function, barrier, parallel, policy, cpus)
        self.components.append(made)
        return made

    def loop(self) -> None:
        """One turn: all stages in order. Raises ComponentError for the first component that raised."""
        with self._changed:
            for component in self.components:
                if component.state is not State.LATE:
                    component.state = State.IDLE
        for stage in self.stages:
            self._run_stage([component for component in self.components if component.stage == stage])
        self.turns += 1

    def run(self, period: float | None = None, turns: int | None = None) -> None:
        """Turn after turn, one each ``period`` seconds; at most so many.

        Without a period a turn begins when something has come for the executors, or at once if there are none. A turn
        that takes longer than the period is counted in ``overruns``; later ones do not make up for it. It ends with the
        context of the executors, with ``stop()`` and by Ctrl-C. Raises as ``loop``.
        """
        if period is not None:
            _be_seconds(period, "period")
        self._ending = False
        due = time.monotonic()
        done = 0
        try:
            while self._going() and (turns is None or done < turns):
                self.loop()
                done += 1
                due = self._pause(due, period)
        except KeyboardInterrupt:
            for executor in self._executors:
                executor.context.close()
        finally:
            self.close()

    def stop(self) -> None:
        """Ends ``run`` after this turn; from any thread."""
        self._ending = True
        for executor in self._executors:
            wake = getattr(executor.context.middleware, "wake", None)
            if wake is not None:
                wake()
        with self._changed:
            self._changed.notify_all()

    def close(self) -> None:
        """Ends the threads of the components when what they run is over. They begin again with the next turn."""
        for component in self.components:
            bell, component._bell = component._bell, None
            if bell is not None:
                bell.ring()

    def __enter__(self) -> SensePlanAct:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # A stage

    def _run_stage(self, components: list[Component]) -> None:
        """Has components run, and waits until they have finished or patience is at its end."""
        end = time.monotonic() + self.patience
        woken = [component for component in components if self._wake(component)]
        for component in woken:
            if not component.parallel and self._pass_barrier(component, end):
                self._execute(component)
        with self._changed:
            self._changed.wait_for(
                lambda: not any(component.state in _OPEN for component in woken),
                max(0.0, end - time.monotonic()),
            )
            behind = [component for component in woken if component.state in _OPEN]
            for component in behind:
                component.missed += 1
                running = component.state is State.RUNNING
                component.state = State.LATE if running else State.LEFT_OUT
            self._changed.notify_all()
        for component in behind:
            if component.state is State.LEFT_OUT:
                self._tell_left_out(component)
            else:
                self._tell(
                    f"component {component.name!r} of stage {component.stage!r} has not finished within "
                    f"{self.patience:g} s. The loop goes on without it until it has."
                )
        for component in woken:
            self._settle(component)

    def _wake(self, component: Component) -> bool:
        """Has a component begin; whether it does: one that is late does not."""
        with self._changed:
            if component.state is State.LATE:
                component.missed += 1
                return False
            component.state = State.WAITING
        if component.parallel:
            if component._bell is None:
                component._bell = Bell()
                threading.Thread(
                    target=self._serve,
                    args=(component, component._bell),
                    name=f"muros {component.name}",
                    daemon=True,
                ).start()
            component._bell.ring()
        return True

    def _serve(self, component: Component, bell: Bell) -> None:
        """The thread of a component."""
        scheduling.name_thread(component.name)
        problem = scheduling.apply(component.policy, component.cpus)
        if problem:
            self._tell(f"component {component.name!r}: {problem} It goes on with what it has.", NOT_SCHEDULED)
        while True:
            bell.wait(math.inf)
            if component._bell is not bell:
                return
            if self._pass_barrier(component, math.inf):
                self._execute(component)

    def _pass_barrier(self, component: Component, end: float) -> bool:
        """Waits for the barrier of a component, until the loop goes on without it; whether it begins."""
        with self._changed:
            self._changed.wait_for(
                lambda: (
                    component.state is not State.WAITING
                    or not any(other.state in _OPEN for other in component.barrier)
                ),
                None if end == math.inf else max(0.0, end - time.monotonic()),
            )
            if component.state is not State.WAITING:
                return False
            if all(other.state is State.FINISHED for other in component.barrier):
                component.state = State.RUNNING
                return True
            component.state = State.LEFT_OUT
            component.missed += 1
            self._changed.notify_all()
        self._tell_left_out(component)
        return False

    def _execute(self, component: Component) -> None:
        """Runs a component."""
        start = time.monotonic()
        try:
            component.function()
        except Exception as error:
            component.error = error
        component.longest = max(component.longest, time.monotonic() - start)
        component.turns += 1
        with self._changed:
            component.state = State.IDLE if component.state is State.LATE else State.FINISHED
            self._changed.notify_all()

    def _settle(self, component: Component) -> None:
        """Does something about what a component has raised."""
        error, component.error = component.error, None
        if error is None:
            return
        failure = ComponentError(component, error)
        if not self.keep_going:
            raise failure
        self._tell(f"{failure}. The loop goes on.")

    # Helpers

    def _find(self, wanted: Any, name: str) -> Component:
        for component in self.components:
            if wanted in (component, component.name) or component.function is wanted:
                return component
        raise WrongValueError(f"the barrier of {name!r} names {wanted!r}, which was not added before")

    def _going(self) -> bool:
        return not self._ending and all(executor.context.running for executor in self._executors)

    def _pause(self, due: float, period: float | None) -> float:
        """Lets time pass until the next turn is due; when that was."""
        now = time.monotonic()
        if period is None:
            if self._executors:
                self._wait(now + self.patience, until_something_comes=True)
            return now
        due += period
        if now > due:
            self.overruns += 1
            return now
        self._wait(due, until_something_comes=False)
        return due

    def _wait(self, end: float, until_something_comes: bool) -> None:
        """Waits, letting the middleware of the executors work."""
        while self._going():
            left = end - time.monotonic()
            if left <= 0:
                return
            if not self._executors:
                with self._changed:
                    self._changed.wait_for(lambda: self._ending, left)
                return
            middleware = self._executors[0].context.middleware
            now = self._executors[0].context.clock()
            middleware.wait(max(1, int(min(1000 * left, middleware.deadline(now)))))
            middleware.spin_once(self._executors[0].context.clock())
            if until_something_comes:
                return

    def _tell_left_out(self, component: Component) -> None:
        missing = [other for other in component.barrier if other.state is not State.FINISHED]
        why = ", ".join(f"{other.name!r} {other.state.value}" for other in missing)
        self._tell(
            f"component {component.name!r} of stage {component.stage!r} was left out of this turn: "
            + (f"at its barrier {why}." if why else f"it did not begin within {self.patience:g} s.")
        )

    def _tell(self, text: str, code: int = LATE) -> None:
        if self.on_problem is not None:
            self.on_problem(code, text)
        elif self._executors:
            tell_problem(self._executors[0].context, code, text)
        else:
            reasons.say(text)


def _be_seconds(seconds: Any, name: str) -> None:
    if not isinstance(seconds, int | float) or not 0 < seconds < math.inf:
        raise WrongValueError(f"{name} is {seconds!r}: it must be a number of seconds above 0")
