"""Resource limits of an endpoint (DDS 1.4, 2.2.3.19) in the terms of the cores; anything below 1 means no limit.

What a writer keeps counts, and what waits in a reader because it came early or was refused.
"""

from dataclasses import replace

from muros.rtps._qos import EndpointQos, History
from muros.rtps._settings import ReaderSettings, WriterSettings

__all__ = ["check_limits", "limited_reader", "limited_writer"]


def check_limits(qos: EndpointQos) -> None:
    """ValueError when the limits contradict each other or the history (an "inconsistent policy")."""
    if qos.limits is None:
        return
    samples, _, of_one = qos.limits
    if 0 < samples < of_one:
        raise ValueError(f"max_samples_per_instance is {of_one}, more than max_samples, which is {samples}")
    least = min((limit for limit in (samples, of_one) if limit > 0), default=qos.depth)
    if qos.history != History.KEEP_ALL and qos.depth > least:
        raise ValueError(f"the last {qos.depth} samples cannot be kept where the limit is {least}")


def limited_writer(settings: WriterSettings, qos: EndpointQos, *, keyed: bool) -> WriterSettings:
    """`settings` with the limits of a writer. A topic without a key has one instance."""
    if qos.limits is None:
        return settings
    samples, _, of_one = qos.limits
    if not keyed and of_one > 0:
        samples = of_one
    return replace(
        settings,
        limit=samples if samples > 0 else settings.limit,
        limit_of_one=max(0, of_one) if keyed else 0,
        strict=samples > 0,
    )


def limited_reader(settings: ReaderSettings, qos: EndpointQos) -> ReaderSettings:
    """`settings` with the limits of a reader."""
    if qos.limits is None:
        return settings
    samples, _, of_one = qos.limits
    return replace(settings, limit=max(0, samples), limit_of_one=max(0, of_one))
