"""Execution contexts: what calls components, when, and in which thread. RTC 1.1, 5.2.2.5 to 5.2.2.8 and 5.3.

What is pure stands apart from what has threads: `_states` is the life of a component as a table, `_cycle` one pass over
the components, `_schedule` when passes are due. Around them `_context` takes requests from any thread, and the kinds of
contexts (`_threads`, `_synchronous`, `_multilayer`) say who runs the passes. `_registry` makes them after rtc.conf.
"""

from muros.rtc.contexts._context import ExecutionContext
from muros.rtc.contexts._multilayer import MultilayerCompositeEC
from muros.rtc.contexts._options import ContextOptions
from muros.rtc.contexts._participant import ContextEvent, ContextEventKind, ContextProfile, Participant
from muros.rtc.contexts._registry import (
    CONTEXT_TYPES,
    ContextSpec,
    SharedContexts,
    context_specs,
    make_context,
    make_contexts,
)
from muros.rtc.contexts._requests import inside_callback
from muros.rtc.contexts._statistics import ContextStatistics, Spread
from muros.rtc.contexts._synchronous import SynchronousExecutionContext
from muros.rtc.contexts._threads import (
    EventDrivenExecutionContext,
    ExtTrigExecutionContext,
    PeriodicExecutionContext,
)

__all__ = [
    "CONTEXT_TYPES",
    "ContextEvent",
    "ContextEventKind",
    "ContextOptions",
    "ContextProfile",
    "ContextSpec",
    "ContextStatistics",
    "EventDrivenExecutionContext",
    "ExecutionContext",
    "ExtTrigExecutionContext",
    "MultilayerCompositeEC",
    "Participant",
    "PeriodicExecutionContext",
    "SharedContexts",
    "Spread",
    "SynchronousExecutionContext",
    "context_specs",
    "inside_callback",
    "make_context",
    "make_contexts",
]
