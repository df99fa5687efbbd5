"""A managed talker and a launcher that moves it: one source for boards (MicroPython) and computers (CPython).

    python managed_node.py dds:                      # then: muros lifecycle set /talker configure
    python managed_node.py udp 127.0.0.1 8888
    python managed_node.py dds: launch               # moves a talker that runs elsewhere, to the end

The talker counts only while it is active. Configured anew it begins again.
"""

import sys

from muros.rclc import Context, Executor, LifecycleClient

from std_msgs.msg import Int32

STEPS = ("configure", "activate", "deactivate", "cleanup", "shutdown")


class Talker:
    """A node that counts while it is active."""

    def __init__(self, context: "Context") -> None:
        self.count = 0
        node = context.node("talker")
        self.lifecycle = node.lifecycle(
            on_configure=self.on_configure,
            on_activate=lambda: print("activated"),
            on_deactivate=lambda: print("deactivated at", self.count),
            on_cleanup=lambda: print("cleaned up"),
            on_shutdown=lambda: print("shut down"),
        )
        self.publisher = self.lifecycle.publisher(Int32, "count")
        node.timer(0.1, self.tick)

    def on_configure(self) -> None:
        """Begins at 0."""
        self.count = 0
        print("configured")

    def tick(self) -> None:
        """Counts."""
        if self.lifecycle.active:
            self.count += 1
            self.publisher.publish(Int32(data=self.count))


def launch(context: "Context") -> None:
    """Moves the talker through its whole life."""
    talker = LifecycleClient(context.node("launcher"), "talker")
    while talker.state(timeout=1.0) is None:
        print("waiting for the talker")
    for step in STEPS:
        print(step, talker.change(step), talker.state())


def open_context(words: "list[str]") -> "Context":
    """The way into the graph that the words name."""
    if words[0] != "udp":
        return Context(words[0])
    from muros.client import Udp

    return Context(Udp(words[1], int(words[2])))


def main(words: "list[str]") -> None:
    """Is the talker, or the launcher."""
    launching = words[-1] == "launch"
    context = open_context(words)
    if launching:
        launch(context)
        context.close()
    else:
        Talker(context)
        Executor(context).spin()


if __name__ == "__main__":
    main(sys.argv[1:])
