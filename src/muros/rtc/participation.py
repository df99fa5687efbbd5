"""A component as execution contexts see it: the calls of a context become actions of the component.

Around each action stand what belongs to it: listeners before and after, the moments at which configuration values
are taken over, ports that are active only while the component is. What an action raises becomes RTC_ERROR and a
finding; nothing is raised to a context.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from muros.rtc.actions import Action, InvalidReturnError, return_code_of
from muros.rtc.codes import ReturnCode

if TYPE_CHECKING:
    from muros.rtc.component import Component
    from muros.rtc.contexts import ExecutionContext

__all__ = ["Participation"]

OK: Final = ReturnCode.RTC_OK


class Participation:
    """Implements `muros.rtc.contexts.Participant` for a component of this process."""

    def __init__(self, component: Component) -> None:
        self.component: Final = component
        self._active: set[int] = set()

    def __repr__(self) -> str:
        return f"<{self.component.instance_name}>"

    @property
    def instance_name(self) -> str:
        """The component's."""
        return self.component.instance_name

    # Contexts

    def attach_context(self, context: ExecutionContext) -> int:
        """The component takes part in `context` from now on; its handle, 1000 and up."""
        return self.component.attach_context(context)

    def detach_context(self, handle: int) -> ReturnCode:
        """It takes part no longer. BAD_PARAMETER for a handle that was not given."""
        return self.component.detach_context(handle)

    def part(self, handle: int) -> None:
        """The context of `handle` has gone without a word: what it activated is deactivated here."""
        try:
            self._active.remove(handle)
        except KeyError:
            pass  # it was not active, or another thread has noticed it, too
        else:
            self.on_deactivated(handle)
        self.detach_context(handle)

    # Actions that contexts call

    def on_startup(self, handle: int) -> ReturnCode:
        """The context starts."""
        return self.perform(Action.STARTUP, handle)

    def on_shutdown(self, handle: int) -> ReturnCode:
        """The context stops."""
        return self.perform(Action.SHUTDOWN, handle)

    def on_activated(self, handle: int) -> ReturnCode:
        """The component becomes active; its ports with it where it agrees."""
        self.component.configuration.update()
        code = self.perform(Action.ACTIVATED, handle)
        if code is OK:
            self._active.add(handle)
            for port in self.component.ports:
                port.activate()
        return code

    def on_deactivated(self, handle: int) -> ReturnCode:
        """The component becomes inactive, its ports before it."""
        self._active.discard(handle)
        for port in self.component.ports:
            port.deactivate()
        return self.perform(Action.DEACTIVATED, handle)

    def on_aborting(self, handle: int) -> ReturnCode:
        """The component goes from active to the error state."""
        return self.perform(Action.ABORTING, handle)

    def on_error(self, handle: int) -> ReturnCode:
        """A cycle in the error state."""
        code = self.perform(Action.ERROR, handle)
        self.component.configuration.update()
        return code

    def on_reset(self, handle: int) -> ReturnCode:
        """The component is to leave the error state."""
        return self.perform(Action.RESET, handle)

    def on_execute(self, handle: int) -> ReturnCode:
        """A cycle in the active state, with the reading before it and the writing after it where that was asked for."""
        component = self.component
        if component.reads_all and not component.read_all() and not component.read_all_completion:
            return ReturnCode.RTC_ERROR
        code = self.perform(Action.EXECUTE, handle)
        if component.writes_all and not component.write_all() and not component.write_all_completion:
            return ReturnCode.RTC_ERROR
        return code

    def on_state_update(self, handle: int) -> ReturnCode:
        """The second half of a cycle; configuration values are taken over behind it."""
        code = self.perform(Action.STATE_UPDATE, handle)
        self.component.configuration.update()
        return code

    def on_rate_changed(self, handle: int) -> ReturnCode:
        """The context's rate has changed."""
        return self.perform(Action.RATE_CHANGED, handle)

    # What the component's own life calls

    def on_initialize(self) -> ReturnCode:
        """The component begins."""
        return self.perform(Action.INITIALIZE)

    def on_finalize(self) -> ReturnCode:
        """The component ends."""
        return self.perform(Action.FINALIZE)

    def perform(self, action: Action, handle: int | None = None) -> ReturnCode:
        """Run an action of the user's, with its listeners.

        What it raises, and a return value that is no return code, are RTC_ERROR and a finding.
        """
        component = self.component
        listeners = component.listeners
        listeners.tell(("PRE", action), handle or 0)
        method = getattr(component, action.value)
        try:
            code = return_code_of(method() if handle is None else method(handle))
        except InvalidReturnError as error:
            component.tell_failure(
                f"{action.value} of {component.instance_name} returned the wrong thing", error
            )
            code = ReturnCode.RTC_ERROR
        except Exception as error:
            component.tell_failure(f"{action.value} of {component.instance_name} raised", error)
            code = ReturnCode.RTC_ERROR
        listeners.tell(("POST", action), handle or 0, code)
        return code
