"""Contexts that several threads use at once: nothing hangs, callbacks do not overlap, every life is a legal one."""

import gc
import random
import threading
import weakref
from collections.abc import Callable
from typing import Any

import pytest

from muros.rtc.codes import ReturnCode
from muros.rtc.component import Component
from muros.rtc.contexts import (
    CONTEXT_TYPES,
    ContextOptions,
    ExecutionContext,
    ExtTrigExecutionContext,
    MultilayerCompositeEC,
    PeriodicExecutionContext,
    SynchronousExecutionContext,
)
from muros.rtc.observers import Dialect, Observer, ObserverOptions
from muros.rtc.status import watch
from tests.rtc.contexts.actors import Actor

SOON = 30.0
FOLLOWS = {
    # on_deactivated is called on the way to Error, too: on_aborting may follow it.
    "INACTIVE": {"onActivated", "onAborting", "onShutdown", "onStartup", "onRateChanged"},
    "ACTIVE": {"onExecute", "onStateUpdate", "onDeactivated", "onShutdown", "onStartup", "onRateChanged"},
    "ERROR": {"onError", "onReset", "onShutdown", "onStartup", "onRateChanged"},
}


class Judge(Actor):
    """Fails now and then, and checks that what it is called for may be called."""

    def __init__(self, name: str, seed: int, faults: list[str]) -> None:
        super().__init__(name)
        self.random = random.Random(seed)
        self.faults = faults
        self.busy = threading.Lock()
        self.state = "INACTIVE"
        self.handle = -1
        self.inside: Callable[[], object] = lambda: None

    def detach_context(self, handle: int) -> ReturnCode:
        if handle == self.handle:
            self.state = "INACTIVE"  # one who comes again begins anew, also from Error
        return super().detach_context(handle)

    def _do(self, name: str, handle: int) -> ReturnCode:
        if not self.busy.acquire(blocking=False):
            self.faults.append(f"{self.instance_name}: {name} while it is in another callback")
            return ReturnCode.RTC_OK
        try:
            self.handle = handle
            if name not in FOLLOWS[self.state]:
                self.faults.append(f"{self.instance_name}: {name} in {self.state}")
            self.inside()
            fails = name in ("onExecute", "onActivated", "onReset") and self.random.random() < 0.1
            if name == "onActivated":
                self.state = "ACTIVE"
            elif name == "onDeactivated":
                self.state = "INACTIVE"
            elif name == "onAborting":
                self.state = "ERROR"
            elif name == "onReset" and not fails:
                self.state = "INACTIVE"
            return ReturnCode.RTC_ERROR if fails else ReturnCode.RTC_OK
        finally:
            self.busy.release()


@pytest.mark.parametrize("name", list(CONTEXT_TYPES))
@pytest.mark.parametrize("seed", range(2))
def test_random_calls_from_many_threads(name: str, seed: int) -> None:
    faults: list[str] = []
    kind = CONTEXT_TYPES[name]
    contexts: list[ExecutionContext] = [kind(rate=1000.0, options=ContextOptions()) for _ in range(2)]
    owners = [Judge(f"owner{number}", seed, faults) for number in range(2)]
    guests = [[Judge(f"guest{number}{n}", seed + n, faults) for n in range(2)] for number in range(2)]
    for context, owner in zip(contexts, owners, strict=True):
        if isinstance(context, MultilayerCompositeEC):
            context.set_groups("guest00,guest10|guest01,guest11")
        context.bind_owner(owner, 0)
        context.start()

    def act(chosen: random.Random) -> None:
        number = chosen.randrange(2)
        context = contexts[number]
        actor = chosen.choice([owners[number], *guests[number]])
        operations: list[Callable[[], Any]] = [
            lambda: context.activate_component(actor),
            lambda: context.deactivate_component(actor),
            lambda: context.reset_component(actor),
            lambda: context.get_component_state(actor),
            lambda: context.add_component(actor),
            lambda: context.remove_component(actor),
            lambda: context.set_rate(chosen.choice((500.0, 2000.0))),
            lambda: context.stop(),
            lambda: context.start(),
            lambda: context.tick(),
            lambda: context.profile(),
            lambda: context.statistics,
        ]
        chosen.choice(operations)()

    for number, owner in enumerate(owners):
        inner = random.Random(seed + number)
        # From inside callbacks, too, across both contexts.
        owner.inside = lambda inner=inner: act(inner) if inner.random() < 0.1 else None  # type: ignore[misc]

    def work(seed: int) -> None:
        chosen = random.Random(seed)
        for _ in range(500):
            act(chosen)

    threads = [threading.Thread(target=work, args=(100 * seed + n,), daemon=True) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(SOON)
    assert not any(thread.is_alive() for thread in threads), "a call hangs"
    for owner in owners:
        owner.inside = lambda: None
    for context in contexts:
        context.close()
    assert not faults, faults[:3]
    for actor in (*owners, *guests[0], *guests[1]):
        assert not actor.attached
        assert actor.state in ("INACTIVE", "ERROR")


def test_threads_of_contexts_end_with_them() -> None:
    before = threading.active_count()
    for kind in (
        PeriodicExecutionContext,
        ExtTrigExecutionContext,
        MultilayerCompositeEC,
        SynchronousExecutionContext,
    ):
        for _ in range(10):
            context = kind()
            actors = [Actor(name) for name in "abc"]
            if isinstance(context, MultilayerCompositeEC):
                context.set_groups("a|b|c")
            ran = threading.Event()
            actors[2].during["onExecute"] = ran.set
            context.bind_owner(actors[0], 0)
            for actor in actors[1:]:
                context.add_component(actor)
            context.start()
            context.activate_component(actors[2])
            context.tick()
            assert ran.wait(SOON)
            context.close()
    for thread in threading.enumerate():
        if thread.name.startswith("rtc "):
            thread.join(SOON)
    assert threading.active_count() <= before


def test_nothing_is_kept_of_contexts_that_have_ended() -> None:
    gone: list[weakref.ref[Any]] = []
    for kind in (PeriodicExecutionContext, MultilayerCompositeEC, SynchronousExecutionContext):
        component = Component()
        observer = Observer(
            lambda kind, hint: None, ObserverOptions.from_properties({}, Dialect.RTC), Dialect.RTC
        )
        context = kind()
        component.initialize([context])
        watch(component, observer)
        context.activate_component(component.participation)
        observer.close()
        component.exit()
        gone += [weakref.ref(component), weakref.ref(context), weakref.ref(observer)]
        del component, context, observer
    for thread in threading.enumerate():
        if thread.name.startswith("rtc "):
            thread.join(SOON)
    gc.collect()
    assert [reference() for reference in gone] == [None] * 9
