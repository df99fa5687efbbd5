"""Which of the values that wait are sent: the push policies, pure.

    policy   one pass sends
    all      every value, oldest first
    fifo     the oldest one
    skip     every (skip_count + 1)-th, counted over all passes
    new      the newest one; those before it are dropped

A value that could not be sent stays, and the next pass begins with it.
"""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple

__all__ = ["PushPolicy", "Selector", "Step"]


class PushPolicy(Enum):
    """`dataport.publisher.push_policy`"""

    ALL = "all"
    FIFO = "fifo"
    SKIP = "skip"
    NEW = "new"


class Step(NamedTuple):
    """What to do next with the values that wait."""

    drop: int
    """So many of the oldest are not sent: remove them first."""
    send: bool
    """Then send the oldest of the rest."""


class Selector:
    """The state of one connector's policy. `skip_count`: values passed over between two that are sent."""

    def __init__(self, policy: PushPolicy, skip_count: int = 0) -> None:
        if skip_count < 0:
            raise ValueError(f"skip_count is 0 or more, not {skip_count}")
        self.policy: Final = policy
        self.skip_count: Final = skip_count
        self.goes_on: Final = policy in (PushPolicy.ALL, PushPolicy.SKIP)
        """Whether a pass takes another step after a value was sent."""
        self._passed = 0

    def step(self, waiting: int) -> Step:
        """The next step, with `waiting` values there."""
        if self.policy is PushPolicy.NEW:
            return Step(max(waiting - 1, 0), waiting > 0)
        if self.policy is not PushPolicy.SKIP:
            return Step(0, waiting > 0)
        needed = self.skip_count - self._passed
        if waiting > needed:
            self._passed = self.skip_count
            return Step(needed, True)
        self._passed += waiting
        return Step(waiting, False)

    def sent(self) -> None:
        """The step's value has been sent."""
        self._passed = 0
