"""Logs of boards on every runtime: what is published on /rosout, and what is shown."""

from muros.client import Qos
from muros.compat import const
from tests.board.broker import Broker

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any


class Logged:
    """A logger, and who hears it."""

    def __init__(self) -> None:
        from rcl_interfaces.msg import Log

        self.broker = Broker()
        self.shown: "list[str]" = []
        node = self.broker.context().node("camera", "lab")
        self.log = node.logger(time=lambda: (12, 34), show=self.shown.append)
        self.heard: "list[Any]" = []
        hearing = self.broker.context().node("host")
        hearing.subscription(Log, "/rosout", self.hear, Qos(depth=10, durability="transient_local"))

    def hear(self, message: "Any") -> None:
        """Keeps what is heard."""
        self.heard.append(
            (message.level, message.name, message.msg, message.stamp.sec, message.stamp.nanosec)
        )


def test_what_is_heard_and_shown() -> None:
    logged = Logged()
    logged.broker.settle()
    log = logged.log
    for method in (log.info, log.warn, log.error, log.fatal):
        assert method("hällo")
        logged.broker.run(10)
    assert not log.debug("not worth knowing")
    logged.broker.run(10)
    assert logged.heard == [(level, "lab.camera", "hällo", 12, 34) for level in (20, 30, 40, 50)]
    assert logged.shown == [
        "[%s] [12.000000034] [lab.camera]: hällo" % level for level in ("INFO", "WARN", "ERROR", "FATAL")
    ]
    assert log.lost == 0


def test_what_cannot_be_published_is_shown_and_counted() -> None:
    logged = Logged()
    assert not logged.log.warn("nobody is there")
    assert (len(logged.shown), logged.log.lost) == (1, 1)
    logged.broker.settle()
    assert logged.heard == []
    logged.log.show = None
    assert logged.log.warn("x" * 1000)
    logged.broker.until(lambda: logged.heard)
    assert len(logged.shown) == 1
    assert len(logged.heard[0][2]) == 1000
