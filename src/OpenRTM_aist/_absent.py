"""What is said to programs that ask for names of the original which have no counterpart under their old name."""

from __future__ import annotations

__all__ = ["what_instead"]

INSTEAD = (
    (
        ("Serializer", "CdrMemoryStream", "ByteDataStream"),
        "muros.rtc.data.register_serializer adds serializers",
    ),
    (
        (
            "InPortConsumer",
            "InPortProvider",
            "OutPortConsumer",
            "OutPortProvider",
            "InPortConnector",
            "OutPortConnector",
        ),
        "muros.rtc.data.register_transport adds ways for values",
    ),
    (("Publisher", "Buffer"), "the properties of a connection choose publishers and buffers"),
    (("ExecutionContext", "CompositeEC"), "muros.rtc.contexts has the contexts, CONTEXT_TYPES their names"),
    (("SdoService",), "muros.rtc.observers and muros.rtc.fsm have the services of components"),
    (("Timer", "PeriodicTask", "ClockManager", "TimeMeasure"), "threading and time of Python have the same"),
    (("CSP",), "ports are asked each (isNew), there is no select over several"),
    (("ActionListener",), "muros.rtc.listeners has what can be heard"),
    (("Macho", "StaticFSM_pyfsm"), "OpenRTM_aist.StaticFSM has state machines"),
)
"""Parts of names, and what does it."""


def what_instead(name: str) -> str:
    """The words of an AttributeError for `OpenRTM_aist.NAME`."""
    text = f"module 'OpenRTM_aist' of muros has no attribute {name!r}"
    for parts, instead in INSTEAD:
        if any(part in name for part in parts):
            return f"{text}: {instead}"
    return text
