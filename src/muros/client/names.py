"""Names of ROS as DDS knows them: ``rt/chatter``, ``std_msgs::msg::dds_::String_``, with the limits of the agent."""

from muros.compat import const

_NAME = const(59)
_TYPE = const(99)


def resolve(name: str, namespace: str, node: str) -> str:
    """The full name of a topic or service: relative names are put in ``namespace``, ``~`` is the node.

    Raises ValueError for an empty name.
    """
    if not name:
        raise ValueError("a topic or service needs a name")
    if "{" in name or "~" in name or "/" in name:
        return _expanded(name, namespace, node)
    return _below(namespace, name)


def topic_name(prefix: str, name: str, suffix: str = "", limit: int = _NAME) -> str:
    """The topic in DDS of a full name: ``rt`` for topics, ``rq`` and ``rr`` with a suffix for services.

    Raises ValueError when it is longer than ``limit`` characters: the agent of micro-ROS takes no more.
    """
    return _limited(name, prefix + name + suffix, limit)


def dds_type(ros: str, suffix: str = "", limit: int = _TYPE) -> str:
    """The type in DDS: ``std_msgs/msg/String`` becomes ``std_msgs::msg::dds_::String_``; others stay as they are.

    Raises ValueError when it is not a type's name or longer than ``limit`` characters.
    """
    if "::" in ros:
        return ros
    parts = ros.split("/")
    if len(parts) != 3:
        raise ValueError("%r is no type: it should read like std_msgs/msg/String" % ros)
    return _limited("type " + ros, parts[0] + "::" + parts[1] + "::dds_::" + parts[2] + suffix + "_", limit)


def _expanded(name: str, namespace: str, node: str) -> str:
    """The full name for one that may be more than a word."""
    name = name.replace("{node}", node).replace("{namespace}", namespace).replace("{ns}", namespace)
    if name[0] == "~":
        name = node + name[1:]
    return name if name[0] == "/" else _below(namespace, name)


def _below(namespace: str, name: str) -> str:
    return "/" + name if namespace == "/" else namespace + "/" + name


def _limited(ros: str, made: str, limit: int) -> str:
    if len(made) > limit:
        raise ValueError("%s is too long: %d characters as %s, at most %d" % (ros, len(made), made, limit))
    return made
