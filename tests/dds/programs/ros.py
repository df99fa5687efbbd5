"""A ROS 2 process under remote control, run by a Python that has rclpy (`tests/dds/peers.py` starts it).

Reads one command a line from its standard input and answers each with one line: ``{"do": name, ...arguments}``
is answered by ``{"result": ...}`` or ``{"error": text}``. The methods of `Ros` are the commands. Things made are
known by the numbers returned. Messages travel as JSON objects, long arrays of bytes as ``{"size", "sum"}``, where
sum is zlib's CRC-32.
"""

import importlib
import itertools
import json
import os
import sys
import threading
import time
import traceback
import zlib
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import MultiThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message

WAIT = 30.0  # seconds that something may take on a machine that is busy
LONG = 64  # bytes of an array that are worth writing out


class Ros:
    """What the other side can ask for. Waits are in seconds and end early when there is what was waited for."""

    def __init__(self) -> None:
        self.things: dict[int, Any] = {}
        self.numbers = itertools.count(1)
        self.changed = threading.Condition()
        self.contexts: list[tuple[Any, Any]] = []

    # Nodes

    def node(
        self, name: str, domain: int, namespace: str = "/", parameters: dict[str, Any] | None = None
    ) -> int:
        """A node in a context (so: DDS participant) of its own."""
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domain)
        node = rclpy.create_node(
            name,
            namespace=namespace,
            context=context,
            parameter_overrides=[Parameter(key, value=value) for key, value in (parameters or {}).items()],
            automatically_declare_parameters_from_overrides=True,
        )
        executor = MultiThreadedExecutor(3, context=context)
        executor.add_node(node)
        threading.Thread(target=executor.spin, daemon=True).start()
        self.contexts.append((context, node))
        return self._keep(node)

    def reset(self) -> None:
        """Close everything, politely."""
        for context, node in self.contexts:
            for thing in list(self.things.values()):
                if isinstance(thing, (ActionServer, ActionClient)) and thing._node is node:
                    thing.destroy()
            rclpy.shutdown(context=context)
            node.destroy_node()
            context.try_shutdown()
        self.contexts.clear()
        self.things.clear()

    def destroy(self, thing: int) -> None:
        """Take a publisher, subscription, client or server out."""
        entity = self.things.pop(thing)
        inner = getattr(entity, "inner", entity)
        kind = next(
            kind
            for kind in ("publisher", "subscription", "client", "service")
            if kind in type(inner).__name__.lower()
        )
        for _, node in self.contexts:
            getattr(node, f"destroy_{kind}")(inner)

    # Topics

    def publisher(self, node: int, topic: str, type: str, qos: dict[str, Any] | int = 10) -> int:
        """A publisher."""
        problems: list[str] = []
        events = PublisherEventCallbacks(
            incompatible_qos=lambda event: self._happened(problems, str(event.last_policy_kind))
        )
        thing = self.things[node].create_publisher(find(type), topic, profile(qos), event_callbacks=events)
        thing.problems = problems
        return self._keep(thing)

    def publish(
        self, publisher: int, message: dict[str, Any], count: int = 1, period: float = 0.0, number: str = ""
    ) -> None:
        """Publish a message `count` times; `number` names a field that counts from 0 (text: appended)."""
        thing = self.things[publisher]
        made = make(thing.msg_type, message)
        start = getattr(made, number) if number else ""
        for n in range(count):
            if number:
                setattr(made, number, f"{start}{n}" if isinstance(start, str) else n)
            thing.publish(made)
            if period:
                time.sleep(period)

    def publish_raw(self, publisher: int, data: str) -> None:
        """Publish serialized bytes (hexadecimal, with encapsulation)."""
        self.things[publisher].publish(bytes.fromhex(data))

    def publish_bytes(self, publisher: int, size: int, count: int = 1, period: float = 0.0) -> None:
        """Publish messages whose `data` is `size` bytes: 0, 1, ... 250, 0, ..., first byte = number."""
        thing = self.things[publisher]
        for n in range(count):
            message = thing.msg_type()
            data = bytearray((bytes(range(251)) * (size // 251 + 1))[:size])
            data[0] = n % 251
            message.data = data
            thing.publish(message)
            if period:
                time.sleep(period)

    def subscription(self, node: int, topic: str, type: str, qos: dict[str, Any] | int = 10) -> int:
        """A subscription, which keeps what it gets for `take`."""
        return self._keep(Subscription(self, self.things[node], find(type), topic, profile(qos)))

    def take(self, subscription: int, count: int = 1, wait: float = WAIT) -> list[Any]:
        """Take what has come: waits for `count` messages."""
        got = self.things[subscription].got
        self._wait(lambda: len(got) >= count, wait)
        taken, got[:] = got[:], []
        return [plain(message) for message in taken]

    def matched(self, thing: int, count: int = 1, wait: float = WAIT) -> int:
        """How many counterparts a publisher, subscription or client has: waits until it is `count`."""
        entity = self.things[thing]

        def present() -> int:
            if hasattr(entity, "get_subscription_count"):
                return int(entity.get_subscription_count())
            if hasattr(entity, "inner"):
                return int(entity.inner.get_publisher_count())
            if hasattr(entity, "wait_for_server"):
                return int(entity.server_is_ready())
            return int(entity.service_is_ready())

        self._wait(lambda: present() == count, wait)
        return present()

    def problems(self, thing: int, count: int = 1, wait: float = WAIT) -> list[str]:
        """The policies of incompatible counterparts seen: waits for `count`."""
        seen = self.things[thing].problems
        self._wait(lambda: len(seen) >= count, wait)
        return list(seen)

    def events(self, subscription: int, last: str, wait: float = WAIT) -> list[str]:
        """What a subscription was told of its publishers, "deadline" or "1 alive": waits for `last` to be the last."""
        seen = self.things[subscription].events
        self._wait(lambda: seen[-1:] == [last], wait)
        return list(seen)

    # Services

    def service(self, node: int, name: str, type: str, rule: str = "{}") -> int:
        """A server; its answer is what `rule`, a Python expression over `request`, says."""
        kind = find(type)

        def answer(request: Any, response: Any) -> Any:
            values = eval(rule, {}, {"request": request})
            for key, value in values.items():
                setattr(response, key, value)
            return response

        return self._keep(self.things[node].create_service(kind, name, answer))

    def client(self, node: int, name: str, type: str) -> int:
        """A client."""
        kind = find(type)
        thing = self.things[node].create_client(kind, name)
        thing.kind = kind
        return self._keep(thing)

    def call(
        self,
        client: int,
        request: dict[str, Any],
        count: int = 1,
        wait: float = WAIT,
        number: str = "",
        window: int = 5,
    ) -> list[Any]:
        """Wait for the server and call it `count` times, `window` at once; None for what is not answered in time."""
        thing = self.things[client]
        end = time.monotonic() + wait
        if not thing.wait_for_service(wait):
            raise TimeoutError(f"no server of {thing.srv_name} within {wait} s")
        made = make(thing.kind.Request, request)
        futures: list[Any] = []
        for n in range(count):
            if n >= window:
                self._result(futures[n - window], end)
            if number:
                setattr(made, number, n)
            futures.append(thing.call_async(made))
        answers = [self._result(future, end) for future in futures]
        return [None if answer is None else plain(answer) for answer in answers]

    # Actions

    def action_server(self, node: int, name: str, type: str, period: float = 0.05) -> int:
        """A server that counts Fibonacci numbers, one every `period` seconds, and can be cancelled."""
        kind = find(type)

        def execute(goal: Any) -> Any:
            feedback = kind.Feedback()
            sequence = [0, 1]
            result = kind.Result()
            for _ in range(goal.request.order):
                if goal.is_cancel_requested:
                    goal.canceled()
                    result.sequence = sequence
                    return result
                sequence.append(sequence[-1] + sequence[-2])
                feedback.sequence = sequence
                goal.publish_feedback(feedback)
                time.sleep(period)
            goal.succeed()
            result.sequence = sequence
            return result

        return self._keep(
            ActionServer(
                self.things[node],
                kind,
                name,
                execute,
                callback_group=ReentrantCallbackGroup(),
                cancel_callback=lambda _: CancelResponse.ACCEPT,
            )
        )

    def action_client(self, node: int, name: str, type: str) -> int:
        """A client of an action."""
        thing = ActionClient(self.things[node], find(type), name)
        thing.kind = find(type)
        return self._keep(thing)

    def goal(
        self, client: int, goal: dict[str, Any], cancel_after: int | None = None, wait: float = WAIT
    ) -> dict[str, Any]:
        """Send a goal, see it through; `cancel_after` so many pieces of feedback."""
        thing = self.things[client]
        end = time.monotonic() + wait
        feedback: list[Any] = []
        if not thing.wait_for_server(wait):
            raise TimeoutError("no server of the action")
        sent = thing.send_goal_async(
            make(thing.kind.Goal, goal),
            feedback_callback=lambda message: self._happened(feedback, message.feedback),
        )
        handle = self._result(sent, end)
        if handle is None:
            raise TimeoutError("no answer to the goal")
        if not handle.accepted:
            return {"accepted": False}
        wanted = handle.get_result_async()
        cancelled = None
        if cancel_after is not None:
            self._wait(lambda: len(feedback) >= cancel_after, end - time.monotonic())
            answer = self._result(handle.cancel_goal_async(), end)
            if answer is None:
                raise TimeoutError("no answer to the cancelling")
            cancelled = len(answer.goals_canceling)
        outcome = self._result(wanted, end)
        if outcome is None:
            raise TimeoutError(f"no result of the goal; {len(feedback)} pieces of feedback came")
        return {
            "accepted": True,
            "feedback": [plain(piece) for piece in feedback],
            "cancelled": cancelled,
            "status": outcome.status,
            "result": plain(outcome.result),
        }

    # The graph

    def nodes(self, node: int, names: list[str] | None = None, wait: float = WAIT) -> list[str]:
        """Full names of all nodes, sorted: waits until all of `names` are there."""
        thing = self.things[node]

        def present() -> list[str]:
            found = thing.get_node_names_and_namespaces()
            return sorted(f"{namespace.rstrip('/')}/{name}" for name, namespace in found)

        self._wait(lambda: set(names or ()) <= set(present()), wait)
        return present()

    def nodes_without(self, node: int, names: list[str], wait: float = WAIT) -> list[str]:
        """Full names of all nodes: waits until none of `names` is there."""
        self._wait(lambda: not set(names) & set(self.nodes(node)), wait)
        return self.nodes(node)

    def topics(self, node: int, names: list[str] | None = None, wait: float = WAIT) -> dict[str, list[str]]:
        """Types by topic: waits until all of `names` are there."""
        thing = self.things[node]
        self._wait(lambda: set(names or ()) <= {name for name, _ in thing.get_topic_names_and_types()}, wait)
        return dict(thing.get_topic_names_and_types())

    def services(self, node: int, names: list[str] | None = None, wait: float = WAIT) -> dict[str, list[str]]:
        """Types by service: waits until all of `names` are there."""
        thing = self.things[node]
        self._wait(
            lambda: set(names or ()) <= {name for name, _ in thing.get_service_names_and_types()}, wait
        )
        return dict(thing.get_service_names_and_types())

    def of_node(
        self, node: int, name: str, namespace: str = "/", names: Sequence[str] = (), wait: float = WAIT
    ) -> dict[str, dict[str, list[str]]]:
        """What a node publishes, subscribes, serves and calls: waits until all of `names` are among it."""
        thing = self.things[node]

        def present() -> dict[str, dict[str, list[str]]]:
            return {
                "publishers": dict(thing.get_publisher_names_and_types_by_node(name, namespace)),
                "subscribers": dict(thing.get_subscriber_names_and_types_by_node(name, namespace)),
                "services": dict(thing.get_service_names_and_types_by_node(name, namespace)),
                "clients": dict(thing.get_client_names_and_types_by_node(name, namespace)),
            }

        self._wait(lambda: set(names) <= {each for kind in present().values() for each in kind}, wait)
        return present()

    def endpoints(
        self, node: int, topic: str, publishers: int = 0, subscriptions: int = 0, wait: float = WAIT
    ) -> dict[str, list[dict[str, Any]]]:
        """Endpoint info of a topic, as `ros2 topic info -v`: waits for so many."""
        thing = self.things[node]

        def present() -> tuple[list[Any], list[Any]]:
            return thing.get_publishers_info_by_topic(topic), thing.get_subscriptions_info_by_topic(topic)

        self._wait(lambda: len(present()[0]) >= publishers and len(present()[1]) >= subscriptions, wait)
        found = present()
        return {
            side: [
                {
                    "node": f"{info.node_namespace.rstrip('/')}/{info.node_name}",
                    "type": info.topic_type,
                    "hash": str(info.topic_type_hash),
                    "gid": bytes(info.endpoint_gid).hex(),
                    "reliability": info.qos_profile.reliability.name,
                    "durability": info.qos_profile.durability.name,
                }
                for info in infos
            ]
            for side, infos in zip(("publishers", "subscriptions"), found, strict=True)
        }

    def without_publishers(self, node: int, topic: str, wait: float = WAIT) -> list[str]:
        """The nodes that publish a topic: waits until there is none."""
        thing = self.things[node]
        self._wait(lambda: not thing.get_publishers_info_by_topic(topic), wait)
        return [info.node_name for info in thing.get_publishers_info_by_topic(topic)]

    # Everything else

    def serialized(self, type: str, message: dict[str, Any]) -> str:
        """A message in CDR, hexadecimal, with encapsulation."""
        return bytes(serialize_message(make(find(type), message))).hex()

    def deserialized(self, type: str, data: str) -> Any:
        """The message that CDR says."""
        return plain(deserialize_message(bytes.fromhex(data), find(type)))

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
            while not condition() and (left := end - time.monotonic()) > 0:
                self.changed.wait(min(left, 0.02))

    def _result(self, future: Any, end: float) -> Any:
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        done.wait(max(0.0, end - time.monotonic()))
        return future.result() if future.done() else None


class Subscription:
    """A subscription and what it got."""

    def __init__(self, ros: Ros, node: Any, type: Any, topic: str, qos: QoSProfile) -> None:
        self.got: list[Any] = []
        self.problems: list[str] = []
        self.events: list[str] = []
        events = SubscriptionEventCallbacks(
            incompatible_qos=lambda event: ros._happened(self.problems, str(event.last_policy_kind)),
            deadline=lambda event: ros._happened(self.events, "deadline"),
            liveliness=lambda event: ros._happened(self.events, f"{event.alive_count} alive"),
        )
        self.inner = node.create_subscription(
            type, topic, lambda message: ros._happened(self.got, message), qos, event_callbacks=events
        )


def find(name: str) -> Any:
    """The class of "package/msg/Name"."""
    package, kind, short = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), short)


def profile(qos: dict[str, Any] | int) -> QoSProfile:
    """A profile from its policies' names, or a depth."""
    if isinstance(qos, int):
        return QoSProfile(depth=qos)
    words = ("history", "reliability", "durability", "liveliness")
    named = {word: f"{word.capitalize()}Policy" for word in words}
    values: dict[str, Any] = {}
    for key, value in qos.items():
        if key in named:
            values[key] = getattr(getattr(importlib.import_module("rclpy.qos"), named[key]), value.upper())
        elif key == "depth":
            values[key] = value
        else:
            values[key] = rclpy.duration.Duration(seconds=value)
    return QoSProfile(**values)


def make(kind: Any, values: dict[str, Any]) -> Any:
    """A message from JSON."""
    message = kind()
    for key, value in values.items():
        inner = getattr(message, key)
        if isinstance(value, dict):
            setattr(message, key, make(type(inner), value))
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            element = (
                kind.get_fields_and_field_types()[key].removeprefix("sequence<").split(">")[0].split("[")[0]
            )
            package, short = element.split("/")
            setattr(message, key, [make(find(f"{package}/msg/{short}"), item) for item in value])
        else:
            setattr(message, key, value)
    return message


def plain(value: Any) -> Any:
    """A message as JSON."""
    if hasattr(value, "get_fields_and_field_types"):
        return {key: plain(getattr(value, key)) for key in value.get_fields_and_field_types()}
    if isinstance(value, (bytes, bytearray)) or (hasattr(value, "typecode") and value.typecode == "B"):
        data = bytes(value)
        return list(data) if len(data) <= LONG else {"size": len(data), "sum": zlib.crc32(data)}
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        if len(value) > LONG and isinstance(value[0], (bytes, int)):
            data = b"".join(value) if isinstance(value[0], bytes) else bytes(value)
            return {"size": len(data), "sum": zlib.crc32(data)}
        return [plain(item) for item in value]
    return value


def main() -> None:
    """Serve until there are no more commands."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # what libraries print is no answer
    ros = Ros()
    for line in sys.stdin:
        command = json.loads(line)
        try:
            method = getattr(ros, command.pop("do"))
            answer = {"result": method(**command)}
        except Exception:
            answer = {"error": traceback.format_exc()}
        answers.write(json.dumps(answer) + "\n")
    ros.reset()


if __name__ == "__main__":
    main()
