"""Contexts by the names and properties of rtc.conf.

    execution_contexts: PeriodicExecutionContext(fast), ExtTrigExecutionContext(slow)      # or none
    ec.PeriodicExecutionContext.rate: 500       # all of the type
    ec.fast.rate: 1000                          # the one of that name

A component that says nothing of it gets one context after `exec_cxt.periodic.*`. What `exec_cxt.*` says holds for all.
"""

from __future__ import annotations

import difflib
import re
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from threading import Lock
from typing import Final

from muros.rtc.codes import RtcError
from muros.rtc.contexts._context import ExecutionContext
from muros.rtc.contexts._multilayer import MultilayerCompositeEC
from muros.rtc.contexts._options import TRANSITION_TIMEOUT, ContextOptions, rate_of
from muros.rtc.contexts._synchronous import SynchronousExecutionContext
from muros.rtc.contexts._threads import (
    EventDrivenExecutionContext,
    ExtTrigExecutionContext,
    PeriodicExecutionContext,
)
from muros.rtc.properties import split_list
from muros.rtc.reports import Reporter

__all__ = ["CONTEXT_TYPES", "ContextSpec", "SharedContexts", "context_specs", "make_context", "make_contexts"]

CONTEXT_TYPES: Final[dict[str, type[ExecutionContext]]] = {
    "PeriodicExecutionContext": PeriodicExecutionContext,
    "ExtTrigExecutionContext": ExtTrigExecutionContext,
    "EventDrivenExecutionContext": EventDrivenExecutionContext,
    "OpenHRPExecutionContext": SynchronousExecutionContext,
    "SynchExtTriggerEC": SynchronousExecutionContext,
    "SimulatorExecutionContext": SynchronousExecutionContext,
    "MultilayerCompositeEC": MultilayerCompositeEC,
}
"""Kinds of contexts by name; users may add theirs, as subclasses of one of these."""

_INHERITED: Final = (
    "sync_transition", "sync_activation", "sync_deactivation", "sync_reset",
    "transition_timeout", "activation_timeout", "deactivation_timeout", "reset_timeout",
    "transition_patience", "catch_up", "cpu_affinity", "scheduling", "switch_interval",
)  # fmt: skip
"""Options that a context takes from `exec_cxt.*` where nothing nearer to it says otherwise."""

_SHOWN: Final = {"sync_transition": "YES", "transition_timeout": f"{TRANSITION_TIMEOUT:g}"}
"""Defaults that the profile of every context tells: tools look for them."""

_FORM: Final = re.compile(r"([\w.:-]+)\s*(?:\(\s*([\w.:-]*)\s*\))?", re.ASCII)
"""`Type`, `Type()` and `Type(name)`."""


@dataclass(frozen=True, slots=True)
class ContextSpec:
    """A context as asked for."""

    type_name: str
    name: str = ""
    texts: Mapping[str, str] = field(default_factory=dict)
    """Its options, `rate` and the keys of `ContextOptions.from_properties`."""
    groups: str = ""
    """`a,b|c,d`: of a multilayer context."""


class SharedContexts:
    """Contexts of one type and name are one: components that ask for it share it. Safe from any thread."""

    def __init__(self) -> None:
        self._contexts: dict[tuple[str, str], ExecutionContext] = {}
        self._lock = Lock()

    def get(self, spec: ContextSpec, make: Callable[[ContextSpec], ExecutionContext]) -> ExecutionContext:
        """The one there is, or a new one; one without a name is never shared."""
        if not spec.name:
            return make(spec)
        with self._lock:
            for key, context in list(self._contexts.items()):
                if context.is_closed:
                    del self._contexts[key]
            key = (spec.type_name, spec.name)
            if key not in self._contexts:
                self._contexts[key] = make(spec)
            return self._contexts[key]


_of_the_process: Final = SharedContexts()


def context_specs(properties: Mapping[str, str]) -> tuple[ContextSpec, ...]:
    """What a component's properties ask for. RtcError for a text that cannot be read."""
    inherited = {key: text for key in _INHERITED if (text := properties.get(f"exec_cxt.{key}", ""))}
    periodic = _below(properties, "exec_cxt.periodic.")
    groups = properties.get("conf.default.members", "")
    wanted = properties.get("execution_contexts", "").strip()
    if not wanted:
        type_name = periodic.pop("type", "") or PeriodicExecutionContext.registered_name
        return (ContextSpec(type_name, "", {**inherited, **periodic}, groups),)
    if wanted.lower() == "none":
        return ()
    if "rate" in periodic:
        inherited["rate"] = periodic["rate"]
    specs = []
    for word in split_list(wanted):
        found = _FORM.fullmatch(word)
        if found is None:
            raise RtcError(
                f"execution_contexts: {word!r} cannot be read; write Type(name), Type2(name2) or none"
            )
        type_name, name = found[1], found[2] or ""
        texts = {
            **inherited,
            **_below(properties, f"ec.{type_name}."),
            **(_below(properties, f"ec.{name}.") if name else {}),
        }
        specs.append(ContextSpec(type_name, name, texts, groups))
    return tuple(specs)


def make_context(
    spec: ContextSpec, *, reporter: Reporter | None = None, clock: Callable[[], float] = time.monotonic
) -> ExecutionContext:
    """A context, not running yet. RtcError for an unknown type and for options that cannot be used."""
    kind = CONTEXT_TYPES.get(spec.type_name)
    if kind is None:
        near = difflib.get_close_matches(spec.type_name, CONTEXT_TYPES, 1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(CONTEXT_TYPES)}"
        raise RtcError(f"execution context {spec.type_name!r} is unknown: {hint}")
    try:
        context = kind(
            name=spec.name,
            type_name=spec.type_name,
            rate=rate_of(spec.texts),
            options=ContextOptions.from_properties(spec.texts),
            properties=_SHOWN
            | {key: text for key, text in spec.texts.items() if key not in ("type", "rate")},
            clock=clock,
            report=reporter.take if reporter is not None else None,
        )
    except RtcError as error:
        raise RtcError(f"execution context {spec.name or spec.type_name}: {error}") from None
    if isinstance(context, MultilayerCompositeEC):
        context.set_groups(spec.groups)
    return context


def make_contexts(
    properties: Mapping[str, str],
    *,
    reporter: Reporter | None = None,
    shared: SharedContexts | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> tuple[ExecutionContext, ...]:
    """The contexts that a component's properties ask for, in their order; named ones may be those of others.

    Components that name the same `shared` share; None: all of the process.
    """
    pool = _of_the_process if shared is None else shared
    return tuple(
        pool.get(spec, lambda one: make_context(one, reporter=reporter, clock=clock))
        for spec in context_specs(properties)
    )


def _below(properties: Mapping[str, str], prefix: str) -> dict[str, str]:
    return {key[len(prefix) :]: text for key, text in properties.items() if key.startswith(prefix)}
