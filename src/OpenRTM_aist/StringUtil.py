"""Functions for texts, where programs look for them by their module: `OpenRTM_aist.StringUtil.normalize(...)`."""
# ruff: noqa: F403, N999

from OpenRTM_aist._strings import *
