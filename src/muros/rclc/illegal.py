"""The error of managed nodes. ``code`` is the return code that the C library gives in its place."""

from muros.rclc.errors import RclError


class TransitionError(RclError):
    """A transition that the state of a node does not have. The node stays where it is."""
