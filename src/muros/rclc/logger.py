"""Logging to /rosout, where `ros2 topic echo`, rqt_console and the like find it.

log = node.logger()
log.warn("battery low")
"""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc._types import Publisher

DEBUG = const(10)
INFO = const(20)
WARN = const(30)
ERROR = const(40)
FATAL = const(50)

_NAMES = ("DEBUG", "INFO", "WARN", "ERROR", "FATAL")
_FATAL = const(50)
_STEP = const(10)


class Logger:
    """Made by ``Node.logger``. Each method publishes a text and shows it; whether it was published.

    What is below ``level`` is left alone. ``show(line)`` prints, None shows nothing. ``time()`` is (seconds,
    nanoseconds). ``lost`` counts texts that were shown but could not be published, no agent being there for instance.
    """

    def __init__(
        self,
        name: str,
        publisher: "Publisher",
        kind: "Any",
        level: int,
        time: "Callable[[], tuple[int, int]] | None",
        show: "Callable[[str], object] | None",
    ) -> None:
        self.name = name
        self.publisher = publisher
        self.level = level
        self.time = time
        self.show = show
        self.lost = 0
        self._kind = kind
        self._busy = False

    def debug(self, text: str) -> bool:
        """Something for those who look for a fault."""
        return self.log(DEBUG, text)

    def info(self, text: str) -> bool:
        """Something worth knowing."""
        return self.log(INFO, text)

    def warn(self, text: str) -> bool:
        """Something that may go wrong."""
        return self.log(WARN, text)

    def error(self, text: str) -> bool:
        """Something that went wrong."""
        return self.log(ERROR, text)

    def fatal(self, text: str) -> bool:
        """Something after which nothing goes on."""
        return self.log(FATAL, text)

    def log(self, level: int, text: str) -> bool:
        """Publishes a text of a level, one of ROS 2's numbers from DEBUG = 10 to FATAL = 50."""
        if level < self.level:
            return False
        message = self._kind()
        message.level = level
        message.name = self.name
        message.msg = text
        if self.time is not None:
            message.stamp.sec, message.stamp.nanosec = self.time()
        self.locate(message)
        if self.show is not None:
            self.show(
                "[%s] [%d.%09d] [%s]: %s"
                % (
                    _NAMES[max(min(level, _FATAL) // _STEP, 1) - 1],
                    message.stamp.sec,
                    message.stamp.nanosec,
                    self.name,
                    text,
                )
            )
        # A problem that publishing meets may be logged in turn: that is shown, and no more.
        taken = False
        if not self._busy:
            self._busy = True
            try:
                taken = self.publisher.publish(message)
            finally:
                self._busy = False
        if not taken:
            self.lost += 1
        return taken

    def locate(self, message: "Any") -> None:
        """Says where in the program this is: on hosts alone, see ``host.logger``."""


def begin(
    made: "type[Logger]",
    node: "Any",
    kind: "Any",
    level: int,
    time: "Callable[[], tuple[int, int]] | None",
    show: "Callable[[str], object] | None",
) -> "Logger":
    """Makes a logger of a node; ``made`` is its class, ``kind`` that of what it publishes, None the board's."""
    if kind is None:
        kind = __import__("rcl_interfaces.msg", None, None, ("Log",)).Log
    return made(name_of(node), node.publisher(kind, "/rosout", "rosout"), kind, level, time, show)


def name_of(node: "Any") -> str:
    """What the logger of a node is called."""
    space = node.namespace[1:].replace("/", ".")
    name: str = space + "." + node.name if space else node.name
    return name
