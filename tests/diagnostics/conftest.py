"""The ways that diagnostics go."""

from tests.rclc_space.conftest import dds_url, stage

__all__ = ["dds_url", "stage"]
