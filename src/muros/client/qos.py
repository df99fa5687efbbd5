"""Quality of service of writers and readers, and the profiles of ROS by name."""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import TypeAlias

    from muros.xrce.create import Asked

    AnyQos: TypeAlias = "str | Qos"

_RELIABLE = const(0x01)
_KEEP_LAST = const(0x02)
_LONGEST = const(0xFFFFFFFF)  # ms
_DURABILITIES = ("volatile", "transient_local", "transient", "persistent")


class Qos:
    """What a writer offers or a reader asks for. Times are in ms, 0 means none; depth 0 leaves it to the agent.

    ``asked`` has flags, depth, deadline and lifespan as the agent is asked for them. Entities keep that: an object of
    this class would keep its module in a board's memory. Raises ValueError for a durability that does not exist, and
    for numbers that are negative or that the wire has no room for: a depth of 65536, a time of 2**32.
    """

    def __init__(
        self,
        reliable: bool = True,
        depth: int = 10,
        durability: str = "volatile",
        keep_all: bool = False,
        deadline: int = 0,
        lifespan: int = 0,
    ) -> None:
        if durability not in _DURABILITIES:
            raise ValueError("durability is one of " + ", ".join(_DURABILITIES))
        within("depth", depth, 0xFFFF)
        within("deadline", deadline, _LONGEST)
        within("lifespan", lifespan, _LONGEST)
        self.flags = (4 << _DURABILITIES.index(durability)) & ~4
        if reliable:
            self.flags |= _RELIABLE
        if not keep_all:
            self.flags |= _KEEP_LAST
        self.depth = 0 if keep_all else depth
        self.deadline = deadline
        self.lifespan = lifespan
        self.asked: "Asked" = (self.flags, self.depth, deadline, lifespan)


def within(name: str, value: int, last: int) -> None:
    """Raises ValueError unless ``value`` is an integer from 0 to ``last``."""
    if not isinstance(value, int) or not 0 <= value <= last:
        raise ValueError("%s is %r: it must be an integer from 0 to %d" % (name, value, last))


def profile(name: "str | Qos") -> Qos:
    """The QoS of a profile by name: default, sensor_data, best_effort, services, parameters, status, rosout.

    A ``Qos`` is given back as it is. Raises ValueError for an unknown name.
    """
    if not isinstance(name, str):
        return name
    found = _made.get(name)
    if found is None:
        if name == "default" or name == "services":
            found = Qos()
        elif name == "sensor_data" or name == "best_effort":
            found = Qos(False, 5)
        elif name == "parameters":
            found = Qos(True, 1000)
        elif name == "status":
            found = Qos(True, 1, "transient_local")
        elif name == "rosout":
            found = Qos(True, 1000, "transient_local", False, 0, 10000)
        else:
            raise ValueError(
                "no QoS profile " + repr(name) + ": default, sensor_data, best_effort, services, "
                "parameters, status, rosout or Qos(...)"
            )
        _made[name] = found
    return found


_made: "dict[str, Qos]" = {}
