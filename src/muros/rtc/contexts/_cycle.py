"""The pass of a context over its components: who is called, in which order, and what follows from the answers.

Theory of operation. A context has members, each with a state of its own (`_states`). Between passes, `ask` moves
members from state to state; `execute` is one pass: do of all, post-do of all, then those that failed are led to Error
(so that on_deactivated, which stops motors, comes in the pass that failed and not a period later). The caller sees to
it that only one thread at a time is in a cycle; groups of members may execute in parallel (`execute_group`), as
nothing is shared between members. No clock, no thread, no lock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from muros.findings import Finding, Severity
from muros.rtc.codes import LifeCycleState, PeerLostError, ReturnCode
from muros.rtc.contexts._participant import ContextEvent, ContextEventKind, Participant, Report, name_of
from muros.rtc.contexts._states import DO, POST_DO, TRANSITIONS, Ask, Transition

__all__ = ["Cycle", "Member"]

_OK: Final = ReturnCode.RTC_OK


class Member:
    """A component in one context.

    `owner`: the context is one of its own, which it knows without `attach_context`.
    """

    __slots__ = ("failed", "handle", "lost", "owner", "participant", "state")

    def __init__(self, participant: Participant, handle: int, *, owner: bool = False) -> None:
        self.participant: Final = participant
        self.handle: Final = handle
        self.owner: Final = owner
        self.state = LifeCycleState.INACTIVE_STATE
        self.failed = False
        """It answered an error in this pass."""
        self.lost = False
        """Its process does not answer any more: nothing is called again."""


class Cycle:
    """The members of one context, and the passes over them.

    `tell` is given every event, `report` every finding. Both must not raise.
    """

    def __init__(
        self, tell: Callable[[ContextEvent], None], report: Report, *, name: Callable[[], str] = lambda: ""
    ) -> None:
        self.members: tuple[Member, ...] = ()
        self.has_lost = False
        """Since the caller last looked, a member's process was found not to answer any more."""
        self._tell = tell
        self._report = report
        self._name = name

    @property
    def busy(self) -> bool:
        """Whether a pass would call anybody."""
        return any(member.state in DO for member in self.members)

    def find(self, participant: Participant) -> Member | None:
        """The component's place here."""
        for member in self.members:
            if member.participant is participant or member.participant == participant:
                return member
        return None

    # what happens between passes

    def ask(self, member: Member, ask: Ask) -> ReturnCode:
        """Move a member to another state, with the calls of the way.

        PRECONDITION_NOT_MET where no way leads from its state, and for an activation that ended in Error;
        RTC_ERROR for a reset that the component refused; BAD_PARAMETER for one that has gone meanwhile.
        """
        if member not in self.members:
            return ReturnCode.BAD_PARAMETER
        transition = TRANSITIONS.get((member.state, ask))
        if transition is None:
            return ReturnCode.PRECONDITION_NOT_MET
        answer = self._call_all(member, transition)
        if answer == _OK or transition.refused is None:
            self._move(member, transition.to)
            return _OK
        if isinstance(transition.refused, Ask):
            # Observers are told of one change: from where it was to where the refusal leads.
            follows = TRANSITIONS[transition.to, transition.refused]
            self._call_all(member, follows)
            self._move(member, follows.to)
            return ReturnCode.PRECONDITION_NOT_MET
        self._move(member, transition.refused)
        return ReturnCode.RTC_ERROR

    def startup(self, members: Iterable[Member] | None = None) -> None:
        """The context runs from now on: on_startup of all, or of those who come later."""
        for member in self.members if members is None else members:
            self._call(member, "on_startup")
        if members is None:
            self._tell(ContextEvent(ContextEventKind.STARTUP))

    def shutdown(self) -> None:
        """The context stands still from now on: on_shutdown of all; their states stay."""
        for member in self.members:
            self._call(member, "on_shutdown")
        self._tell(ContextEvent(ContextEventKind.SHUTDOWN))

    def rate_changed(self) -> ReturnCode:
        """on_rate_changed of all; RTC_ERROR where one did not like it: that one is in Error if it was active."""
        result = _OK
        for member in self.members:
            if self._call(member, "on_rate_changed") != _OK:
                result = ReturnCode.RTC_ERROR
                self.ask(member, Ask.FAIL)
        self._tell(ContextEvent(ContextEventKind.RATE_CHANGED))
        return result

    def admit(self, member: Member) -> bool:
        """A component joins, inactive. False where it is here already: it is told to forget this handle."""
        if self.find(member.participant) is not None:
            if not member.owner:
                self._call(member, "detach_context")
            return False
        self.members = (*self.members, member)
        self._tell(ContextEvent(ContextEventKind.ADMITTED, member.participant, member.handle))
        return True

    def dismiss(self, member: Member, *, running: bool) -> None:
        """A component goes, as one that is deactivated and whose context stops. Nothing where it has gone already."""
        if member not in self.members:
            return
        self.ask(member, Ask.DEACTIVATE)
        if running:
            self._call(member, "on_shutdown")
        if not member.owner:
            self._call(member, "detach_context")
        self.members = tuple(other for other in self.members if other is not member)
        self._tell(ContextEvent(ContextEventKind.DISMISSED, member.participant, member.handle))

    # a pass

    def execute(self) -> None:
        """One pass over all members."""
        self.execute_group(self.members)

    def execute_group(self, members: Iterable[Member]) -> None:
        """One pass over some members; others may have theirs in other threads meanwhile."""
        for member in members:
            name = DO.get(member.state)
            if name is not None:
                member.failed = self._call(member, name) != _OK and member.state in POST_DO
        failed = False
        for member in members:
            name = POST_DO.get(member.state)
            if name is not None:
                if not member.failed:
                    member.failed = self._call(member, name) != _OK
                failed |= member.failed
        if failed:
            for member in members:
                if member.failed:
                    member.failed = False
                    self.ask(member, Ask.FAIL)

    # calling

    def _call_all(self, member: Member, transition: Transition) -> ReturnCode:
        """The calls of a transition; what the last one answered."""
        answer = _OK
        for name in transition.calls:
            answer = self._call(member, name)
        return answer

    def _call(self, member: Member, name: str) -> ReturnCode:
        """One callback; what it raises against the rules is an error of that component and of nobody else."""
        if member.lost:
            return ReturnCode.RTC_ERROR
        try:
            answer: ReturnCode = getattr(member.participant, name)(member.handle)
            return answer
        except PeerLostError as error:
            member.lost = self.has_lost = True
            self._report(
                Finding(
                    "rtc-member-lost",
                    self._who(),
                    f"{name_of(member.participant)} is no longer called",
                    str(error),
                    "Start that component again and add it to the context",
                    Severity.ERROR,
                    name_of(member.participant),
                )
            )
        except (Exception, SystemExit) as error:
            self._report(
                Finding(
                    "rtc-callback-raised",
                    self._who(),
                    f"{name} of {name_of(member.participant)} failed",
                    f"{type(error).__name__}: {error}",
                    severity=Severity.ERROR,
                    subject=name_of(member.participant),
                )
            )
        return ReturnCode.RTC_ERROR

    def _move(self, member: Member, state: LifeCycleState) -> None:
        old, member.state = member.state, state
        if old is not state:
            event = ContextEvent(
                ContextEventKind.STATE_CHANGED, member.participant, member.handle, old, state
            )
            self._tell(event)

    def _who(self) -> str:
        return self._name() or "execution context"
