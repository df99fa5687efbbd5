"""A ROS 1 process under remote control, run by a Python that has rospy (`tests/ros1/peers.py` starts it).

Reads one command a line from its standard input and answers each with one line: ``{"do": name, ...arguments}`` is
answered by ``{"result": ...}`` or ``{"error": text}``. The methods of `Ros1` are the commands. Things made are known by
the numbers returned. Messages travel as JSON objects; times as {"secs", "nsecs"}.
"""

import importlib
import io
import itertools
import json
import os
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from typing import Any

import genpy
import rosgraph
import rospy


class Ros1:
    """What the other side can ask for. Waits are in seconds and end early when there is what was waited for."""

    def __init__(self) -> None:
        self.things: dict[int, Any] = {}
        self.numbers = itertools.count(1)
        self.changed = threading.Condition()

    def node(self, name: str) -> str:
        """Make this process a node."""
        rospy.init_node(name, disable_signals=True)
        self.master = rosgraph.Master(rospy.get_name())
        return str(rospy.get_name())

    # Topics

    def publisher(self, topic: str, type: str, latch: bool = False) -> int:
        return self._keep(rospy.Publisher(topic, find(type), queue_size=10000, latch=latch))

    def wait_for_subscribers(self, publisher: int, count: int = 1, wait: float = 10.0) -> int:
        """How many there are, once there are so many."""
        thing = self.things[publisher]
        self._wait(lambda: thing.get_num_connections() >= count, wait)
        return int(thing.get_num_connections())

    def publish(self, publisher: int, message: dict[str, Any], times: int = 1) -> None:
        """Publish a message so many times."""
        thing = self.things[publisher]
        made = fill(thing.data_class(), message)
        for _ in range(times):
            thing.publish(made)

    def begin_publishing(self, publisher: int, message: dict[str, Any], period: float = 0.1) -> None:
        """Publish a message again and again, until `end_publishing`."""
        thing = self.things[publisher]
        made = fill(thing.data_class(), message)
        self.over = threading.Event()

        def publish() -> None:
            while not self.over.wait(period):
                thing.publish(made)

        self.thread = threading.Thread(target=publish)
        self.thread.start()

    def end_publishing(self) -> None:
        self.over.set()
        self.thread.join(10)

    def subscriber(self, topic: str, type: str) -> int:
        got: list[Any] = []
        thing = rospy.Subscriber(
            topic, find(type), lambda message: self._happened(got, message), tcp_nodelay=True
        )
        number = self._keep(thing)
        self.things[-number] = got
        return number

    def wait_for_publishers(self, subscriber: int, count: int = 1, wait: float = 10.0) -> int:
        thing = self.things[subscriber]
        self._wait(lambda: thing.get_num_connections() >= count, wait)
        return int(thing.get_num_connections())

    def take(self, subscriber: int, count: int = 1, wait: float = 10.0) -> list[Any]:
        """The messages that came, at least so many if they come in time; they are forgotten then."""
        got = self.things[-subscriber]
        self._wait(lambda: len(got) >= count, wait)
        with self.changed:
            taken, got[:] = got[:], []
        return [plain(message) for message in taken]

    def count(self, subscriber: int, count: int = 1, wait: float = 10.0) -> int:
        """How many came, without showing them."""
        got = self.things[-subscriber]
        self._wait(lambda: len(got) >= count, wait)
        return len(got)

    def destroy(self, thing: int) -> None:
        made = self.things.pop(thing)
        made.unregister() if hasattr(made, "unregister") else made.shutdown()

    # Services

    def call(self, service: str, type: str, request: dict[str, Any], wait: float = 10.0) -> Any:
        """Call a service; the error's text if it fails."""
        rospy.wait_for_service(service, wait)
        return plain(
            rospy.ServiceProxy(service, find(type, "srv"))(fill(find(type, "srv")._request_class(), request))
        )

    def serve(self, service: str, type: str, answer: dict[str, Any]) -> int:
        """A service that always gives one answer, and keeps what it was asked."""
        got: list[Any] = []
        kind = find(type, "srv")

        def on_request(request: Any) -> Any:
            self._happened(got, request)
            return fill(kind._response_class(), answer)

        number = self._keep(rospy.Service(service, kind, on_request))
        self.things[-number] = got
        return number

    # Everything else

    def set_param(self, name: str, value: Any) -> None:
        rospy.set_param(name, value)

    def delete_param(self, name: str) -> None:
        rospy.delete_param(name)

    def state(
        self,
        publishers: Sequence[str] = (),
        subscribers: Sequence[str] = (),
        services: Sequence[str] = (),
        wait: float = 10.0,
    ) -> dict[str, dict[str, list[str]]]:
        """Who publishes, hears and serves what: waits until these names are there."""
        wanted = [set(publishers), set(subscribers), set(services)]

        def now() -> list[dict[str, list[str]]]:
            return [dict(side) for side in self.master.getSystemState()]

        self._wait(lambda: all(want <= set(have) for want, have in zip(wanted, now(), strict=True)), wait)
        return dict(zip(("publishers", "subscribers", "services"), now(), strict=True))

    def gone(self, node: str, wait: float = 10.0) -> bool:
        """Whether a node has left the graph: waits for it."""

        def present() -> bool:
            return any(node in nodes for side in self.master.getSystemState() for _, nodes in side)

        self._wait(lambda: not present(), wait)
        return not present()

    def topics(self) -> dict[str, str]:
        return dict(self.master.getTopicTypes())

    def serialized(self, type: str, message: dict[str, Any]) -> str:
        """A message in ROS 1 bytes, hexadecimal."""
        buffer = io.BytesIO()
        fill(find(type)(), message).serialize(buffer)
        return buffer.getvalue().hex()

    def definition(self, type: str) -> str:
        return str(find(type)._full_text)

    def _keep(self, thing: Any) -> int:
        number = next(self.numbers)
        self.things[number] = thing
        return number

    def _happened(self, seen: list[Any], what: Any) -> None:
        with self.changed:
            seen.append(what)
            self.changed.notify_all()

    def _wait(self, condition: Callable[[], object], wait: float) -> None:
        end = time.monotonic() + wait
        with self.changed:
            while not condition() and time.monotonic() < end:
                self.changed.wait(0.02)


def find(name: str, kind: str = "msg") -> Any:
    """The class of "package/Name"."""
    package, short = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), short)


def fill(message: Any, values: dict[str, Any]) -> Any:
    """Set a message's fields."""
    for name, value in (values or {}).items():
        current = getattr(message, name)
        if isinstance(current, genpy.TVal):
            setattr(message, name, type(current)(**value))
        elif isinstance(current, genpy.Message):
            fill(current, value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            kind = message._slot_types[message.__slots__.index(name)].partition("[")[0]
            inner = find(kind)
            setattr(message, name, [fill(inner(), each) for each in value])
        else:
            setattr(message, name, value)
    return message


def plain(value: Any) -> Any:
    """A message as JSON has it."""
    if isinstance(value, genpy.TVal):
        return {"secs": value.secs, "nsecs": value.nsecs}
    if isinstance(value, genpy.Message):
        return {name: plain(getattr(value, name)) for name in value.__slots__}
    if isinstance(value, bytes):
        return list(value)
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    return value


def main() -> None:
    """Carry out commands until there are no more."""
    ros = Ros1()
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # what libraries print does not belong among the answers
    for line in sys.stdin:
        command = json.loads(line)
        name = command.pop("do")
        try:
            answer = {"result": getattr(ros, name)(**command)}
        except Exception as error:
            traceback.print_exc()
            answer = {"error": f"{type(error).__name__}: {error}"}
        answers.write(json.dumps(answer) + "\n")
    rospy.signal_shutdown("told to leave")
    os._exit(0)


if __name__ == "__main__":
    main()
