"""Programs import this so that the stubs of OpenRTM-aist are found; muros' own are found in any case."""
# ruff: noqa: N999
