"""QoS on the command line: the options of `ros2 topic`, and fitting a reader to the writers that are there."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from muros.space import (
    PRESETS,
    Durability,
    Endpoint,
    History,
    Liveliness,
    Qos,
    Reliability,
)

__all__ = ["add_qos_options", "chosen_qos", "fitted_qos", "has_choice"]

PROFILES = (
    "default", "sensor_data", "system_default", "services_default", "parameters", "parameter_events",
    "action_status_default", "rosout_default", "best_available", "unknown",
)  # fmt: skip

_UNSAID = ("system_default", "unknown", "best_available")
"""Values that leave a policy as the profile has it."""


def add_qos_options(parser: argparse.ArgumentParser, default: str) -> None:
    """The `--qos-...` options; `default` is the profile they start from."""
    group = parser.add_argument_group("quality of service")
    add = group.add_argument
    add("--qos-profile", choices=PROFILES, default=default, help=f"where to start from (default: {default})")
    add("--qos-depth", type=int, metavar="N", help="samples kept with keep_last")
    add("--qos-history", choices=("keep_last", "keep_all", *_UNSAID[:2]))
    add("--qos-reliability", choices=("reliable", "best_effort", *_UNSAID))
    add("--qos-durability", choices=("volatile", "transient_local", *_UNSAID))
    add("--qos-liveliness", choices=("automatic", "manual_by_topic", *_UNSAID))
    add("--qos-liveliness-lease-duration-seconds", type=float, metavar="S", dest="qos_lease")


def has_choice(arguments: argparse.Namespace) -> bool:
    """Whether the user chose more than a profile, so that nothing may be fitted."""
    names = ("depth", "history", "reliability", "durability", "liveliness", "lease")
    return any(getattr(arguments, f"qos_{name}") is not None for name in names)


def chosen_qos(arguments: argparse.Namespace) -> Qos:
    """The QoS that the options name. ValueError if a number makes no sense."""
    qos = PRESETS.get(arguments.qos_profile, PRESETS["default"])
    if (reliability := arguments.qos_reliability) not in (None, *_UNSAID):
        qos = qos.replace(reliability=Reliability[reliability.upper()])
    if (durability := arguments.qos_durability) not in (None, *_UNSAID):
        qos = qos.replace(durability=Durability[durability.upper()])
    if (history := arguments.qos_history) not in (None, *_UNSAID):
        qos = qos.replace(history=History[history.upper()])
    if (liveliness := arguments.qos_liveliness) not in (None, *_UNSAID):
        qos = qos.replace(liveliness=Liveliness[liveliness.upper()])
    if arguments.qos_depth is not None:
        qos = qos.replace(depth=arguments.qos_depth)
    if arguments.qos_lease is not None:
        qos = qos.replace(lease=round(arguments.qos_lease * 1e9))
    return qos


def fitted_qos(qos: Qos, writers: Sequence[Endpoint]) -> tuple[Qos, list[str]]:
    """The most that all `writers` offer of reliability and durability, and remarks where they differ."""
    if not writers:
        return qos, []
    notes = []
    reliable = [w.qos.reliability >= Reliability.RELIABLE for w in writers]
    local = [w.qos.durability >= Durability.TRANSIENT_LOCAL for w in writers]
    if any(reliable) and not all(reliable):
        notes.append("some publishers are reliable, others best effort: listening best effort, to hear all")
    if any(local) and not all(local):
        notes.append("some publishers are transient local, others volatile: listening volatile, to hear all")
    return (
        qos.replace(
            reliability=Reliability.RELIABLE if all(reliable) else Reliability.BEST_EFFORT,
            durability=Durability.TRANSIENT_LOCAL if all(local) else Durability.VOLATILE,
            ownership=writers[0].qos.ownership,
        ),
        notes,
    )
