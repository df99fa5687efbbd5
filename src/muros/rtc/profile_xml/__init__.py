"""RTC profiles (`RTC.xml`): what a component is, in the form that RTCBuilder and other editors read and write."""

from muros.rtc.profile_xml._component import profile_of
from muros.rtc.profile_xml._constraints import constraint_element, constraint_text
from muros.rtc.profile_xml._model import (
    ACTIONS,
    DataPortProfile,
    ParameterProfile,
    RtcProfile,
    ServiceInterfaceProfile,
    ServicePortProfile,
)
from muros.rtc.profile_xml._reader import ProfileError, read_profile_file, read_profile_untrusted
from muros.rtc.profile_xml._writer import write_profile

__all__ = [
    "ACTIONS",
    "DataPortProfile",
    "ParameterProfile",
    "ProfileError",
    "RtcProfile",
    "ServiceInterfaceProfile",
    "ServicePortProfile",
    "constraint_element",
    "constraint_text",
    "profile_of",
    "read_profile_file",
    "read_profile_untrusted",
    "write_profile",
]
