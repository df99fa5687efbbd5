"""The fixtures of the tests with foreign peers are good here too."""

from tests.dds.conftest import domain, peer, rig, running

__all__ = ["domain", "peer", "rig", "running"]
