"""Components, where programs look for them by their module: `OpenRTM_aist.RTObject.RTObject_impl`."""
# ruff: noqa: N999

from OpenRTM_aist._components import RTObject_impl
from OpenRTM_aist.CORBA_RTCUtil import PARTICIPATING as ECOTHER_OFFSET

__all__ = ["ECOTHER_OFFSET", "RTObject_impl"]
