"""What goes wrong with a ROS 1 graph."""


class Ros1Error(Exception):
    """Something is wrong with the graph, the master or a name; the text says what and what to do."""
