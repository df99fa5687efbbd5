"""The ways that diagnostics go, and whom they meet there."""

from tests.rclc_space.conftest import dds_url, ros, stage, way

__all__ = ["dds_url", "ros", "stage", "way"]
