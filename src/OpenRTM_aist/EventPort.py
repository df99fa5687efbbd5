"""Ports for events, where programs look for them by their module: `import OpenRTM_aist.EventPort as EventPort`."""
# ruff: noqa: N999

from OpenRTM_aist.StaticFSM import EventInPort

__all__ = ["EventInPort"]
