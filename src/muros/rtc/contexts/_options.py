"""What can be chosen for an execution context, as values; the texts of rtc.conf for it are read here."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from muros.rtc.codes import RtcError
from muros.rtc.properties import flag_of, number_of, seconds_of, split_list

__all__ = ["PATIENCE", "RATE", "TRANSITION_TIMEOUT", "ContextOptions", "rate_of"]

RATE: Final = 1000.0
"""Passes per second."""

TRANSITION_TIMEOUT: Final = 0.5
"""Seconds; OpenRTM-aist's default."""

PATIENCE: Final = 8.0
"""Seconds that a call waits for the truth; less than the 10 s after which callers over CORBA give up."""

_POLICIES: Final = {"fifo": "FIFO", "rr": "RR", "round_robin": "RR"}


@dataclass(frozen=True, slots=True)
class ContextOptions:
    """How a context changes states and runs its thread.

    A synchronous transition is waited for: the call answers what became of it. It answers an error only where there
    was one: a transition that has not begun when the wait is over is called off (a deactivation stands), one whose
    callback still runs is a finding.
    """

    sync_activation: bool = True
    sync_deactivation: bool = True
    sync_reset: bool = True
    activation_timeout: float = TRANSITION_TIMEOUT
    """Seconds; what is less than `patience` counts as `patience`, as slow callbacks are no errors."""
    deactivation_timeout: float = TRANSITION_TIMEOUT
    reset_timeout: float = TRANSITION_TIMEOUT
    patience: float = PATIENCE
    """Seconds that any call waits for callbacks, at least."""
    catch_up: int = 0
    """Missed passes that are made up for, at most; 0 leaves them out."""
    cpus: tuple[int, ...] = ()
    """Processors that the thread may run on; none named: all."""
    policy: str = ""
    """Scheduling by the system: "" as other threads, FIFO, RR."""
    switch_interval: float | None = None
    """Seconds after which a thread of Python that computes lets others on (`sys.setswitchinterval`, which holds for the
    process). None: short enough for the rate; 0: as it is."""
    priority: int = 0
    """With a real-time policy: 1 to 99; 0 takes the policy's usual one."""

    @classmethod
    def from_properties(cls, texts: Mapping[str, str]) -> ContextOptions:
        """Options of `sync_transition`, `sync_activation`, ..., `transition_timeout`, `activation_timeout`, ...,
        `transition_patience`, `catch_up`, `cpu_affinity: 0,1`, `scheduling: fifo:50` and `switch_interval`; others are
        not looked at.

        RtcError for a text that cannot be used.
        """
        sync = {
            ask: flag_of(texts, f"sync_{ask}", flag_of(texts, "sync_transition", True))
            for ask in ("activation", "deactivation", "reset")
        }
        every = seconds_of(texts, "transition_timeout", TRANSITION_TIMEOUT)
        timeout = {ask: seconds_of(texts, f"{ask}_timeout", every) for ask in sync}
        policy, priority = _policy(texts.get("scheduling", ""))
        return cls(
            sync_activation=sync["activation"],
            sync_deactivation=sync["deactivation"],
            sync_reset=sync["reset"],
            activation_timeout=timeout["activation"],
            deactivation_timeout=timeout["deactivation"],
            reset_timeout=timeout["reset"],
            patience=seconds_of(texts, "transition_patience", PATIENCE),
            catch_up=_whole(texts, "catch_up"),
            cpus=tuple(_cpu(word) for word in split_list(texts.get("cpu_affinity", ""))),
            switch_interval=(
                seconds_of(texts, "switch_interval", 0.0)
                if texts.get("switch_interval", "").strip()
                else None
            ),
            policy=policy,
            priority=priority,
        )


def rate_of(texts: Mapping[str, str], default: float = RATE) -> float:
    """The property `rate`. RtcError for one at which no context can run."""
    text = texts.get("rate", "").strip()
    rate = number_of(text) if text else default
    if not (math.isfinite(rate) and rate > 0):
        raise RtcError(f"rate: {text!r} is no rate; write passes per second, such as 1000")
    return rate


def _whole(texts: Mapping[str, str], key: str) -> int:
    text = texts.get(key, "").strip() or "0"
    if not (text.isascii() and text.isdigit()) or len(text) > 9:
        raise RtcError(f"{key}: {text!r} is no number of passes; write one such as 3, or 0 for none")
    return int(text)


def _cpu(word: str) -> int:
    if not (word.isascii() and word.isdigit()) or len(word) > 5:
        raise RtcError(f"cpu_affinity: {word!r} is no processor; write their numbers, such as 0,1")
    return int(word)


def _policy(text: str) -> tuple[str, int]:
    """`fifo`, `fifo:50`, `SCHED_RR 20`, and nothing for the system's default."""
    words = text.replace(":", " ").lower().split()
    if not words or words[0].removeprefix("sched_") == "other":
        return "", 0
    policy = _POLICIES.get(words[0].removeprefix("sched_"))
    number = words[1] if len(words) == 2 else "0" if len(words) == 1 else ""
    if policy is None or not (number.isascii() and number.isdigit()) or int(number) > 99:
        raise RtcError(f"scheduling: {text!r} is unknown; write fifo:PRIORITY or rr:PRIORITY (1 to 99)")
    return policy, int(number)
