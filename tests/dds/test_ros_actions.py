"""Actions between muros and ROS 2. An action is three services and two topics; here their bytes are made by hand."""

import struct
import uuid
from collections.abc import Callable
from typing import Any

import pytest

from muros.space import Durability, Participant, Qos, Replier, Requester, Service, Topic, Writer
from tests.dds.bodies import goal_info, numbers, numbers_of
from tests.dds.domains import Domain
from tests.dds.peers import Peer
from tests.dds.rig import Rig, take_all

ROS = ("jazzy", "kilted")
Fetch = Callable[[str], Peer]

TYPE = "test_msgs/action/Fibonacci"
KIND = "test_msgs::action::dds_::Fibonacci"
FEEDBACK = Topic("rt/count/_action/feedback", f"{KIND}_FeedbackMessage_")
STATUS = Topic("rt/count/_action/status", "action_msgs::msg::dds_::GoalStatusArray_")
LATCHED = Qos(durability=Durability.TRANSIENT_LOCAL, depth=1)

EXECUTING, SUCCEEDED, CANCELED = 2, 4, 5


def service(name: str, kind: str) -> Service:
    """One of an action's services."""
    base = f"/count/_action/{name}"
    return Service(base, f"rq{base}Request", f"rr{base}Reply", f"{kind}_Request_", f"{kind}_Response_")


SEND_GOAL = service("send_goal", f"{KIND}_SendGoal")
CANCEL = service("cancel_goal", "action_msgs::srv::dds_::CancelGoal")
RESULT = service("get_result", f"{KIND}_GetResult")


class Counter:
    """An action server on the bare space: counts Fibonacci numbers until the order is reached or it is cancelled."""

    def __init__(self, node: Participant) -> None:
        self.feedback: Writer = node.writer(FEEDBACK, Qos(depth=10))
        self.status: Writer = node.writer(STATUS, LATCHED)
        self.goal = b""
        self.order = 0
        self.sequence: list[int] = []
        self.state = 0
        self.asked_for_result: bytes | None = None
        self.send_goal: Replier = node.replier(SEND_GOAL, on_request=self.on_goal)
        self.cancel: Replier = node.replier(CANCEL, on_request=self.on_cancel)
        self.result: Replier = node.replier(RESULT, on_request=self.on_result)

    def on_goal(self, identity: bytes, data: bytes) -> None:
        self.goal, self.order, self.sequence = data[:16], struct.unpack_from("<i", data, 16)[0], [0, 1]
        self.send_goal.reply(identity, struct.pack("<?xxxiI", True, 0, 0))
        self.set_state(EXECUTING)

    def on_cancel(self, identity: bytes, data: bytes) -> None:
        assert data[:16] in (self.goal, bytes(16))
        self.cancel.reply(identity, struct.pack("<bxxxI", 0, 1) + goal_info(self.goal))
        self.set_state(CANCELED)

    def on_result(self, identity: bytes, data: bytes) -> None:
        assert data[:16] == self.goal
        self.asked_for_result = identity
        self.finish()

    def set_state(self, state: int) -> None:
        self.state = state
        self.status.write(struct.pack("<I", 1) + goal_info(self.goal) + struct.pack("<b", state))
        self.finish()

    def step(self) -> None:
        """Another number."""
        if self.state != EXECUTING:
            return
        if len(self.sequence) >= self.order + 2:
            self.set_state(SUCCEEDED)
            return
        self.sequence.append(self.sequence[-1] + self.sequence[-2])
        self.feedback.write(self.goal + numbers(self.sequence))

    def finish(self) -> None:
        """Tell the result to who asked for it, when there is one."""
        if self.asked_for_result is not None and self.state in (SUCCEEDED, CANCELED):
            self.result.reply(
                self.asked_for_result, struct.pack("<bxxx", self.state) + numbers(self.sequence)
            )
            self.asked_for_result = None


@pytest.mark.parametrize("distro", ROS)
def test_ros_sends_goals_to_an_action_server_of_ours(
    distro: str, peer: Fetch, rig: Rig, domain: Domain
) -> None:
    ros = peer(distro)
    node = ros.do("node", name="client", domain=domain)
    counter = Counter(rig.space(domain).participant("counter"))
    client = rig.ask(ros, "action_client", node=node, name="/count", type=TYPE)

    def see_through(**goal: Any) -> Any:
        ros.begin("goal", client=client, **goal)
        while not ros.ready():
            counter.step()
            rig.run(0.02)
        return ros.result()

    outcome = see_through(goal={"order": 6})
    assert outcome["status"] == SUCCEEDED
    assert outcome["result"] == {"sequence": [0, 1, 1, 2, 3, 5, 8, 13]}
    assert [len(piece["sequence"]) for piece in outcome["feedback"]] == [3, 4, 5, 6, 7, 8]
    outcome = see_through(goal={"order": 1000}, cancel_after=2)
    assert (outcome["cancelled"], outcome["status"]) == (1, CANCELED)
    assert outcome["result"]["sequence"][:4] == [0, 1, 1, 2]
    assert rig.told == []


class Asker:
    """An action client on the bare space."""

    def __init__(self, node: Participant) -> None:
        self.replies: dict[int, bytes] = {}

        def requester(service: Service) -> Requester:
            return node.requester(
                service, on_reply=lambda n, data: self.replies.update({id(service) ^ n: data})
            )

        self.requesters = {
            service.name: (service, requester(service)) for service in (SEND_GOAL, CANCEL, RESULT)
        }
        self.feedback = node.reader(FEEDBACK, Qos(depth=50))
        self.status = node.reader(STATUS, LATCHED.replace(depth=50))

    def ask(self, service: Service, body: bytes) -> int:
        """Send a request; its number among all replies."""
        known, requester = self.requesters[service.name]
        return id(known) ^ requester.send(body)


@pytest.mark.parametrize("distro", ROS)
def test_we_send_goals_to_an_action_server_of_ros(distro: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer(distro)
    node = ros.do("node", name="server", domain=domain)
    ros.do("action_server", node=node, name="/count", type=TYPE)
    asker = Asker(rig.space(domain).participant("asker"))
    rig.matched(asker.feedback)
    rig.matched(asker.status)

    def see_through(order: int, cancel_after: int | None) -> tuple[int, list[int], list[list[int]]]:
        goal = uuid.uuid4().bytes
        sent = asker.ask(SEND_GOAL, goal + struct.pack("<i", order))
        rig.until(lambda: sent in asker.replies, "the goal to be accepted")
        assert asker.replies[sent][0] == 1
        wanted = asker.ask(RESULT, goal)
        feedback: list[list[int]] = []
        cancelled = None

        def done() -> bool:
            nonlocal cancelled
            for body in take_all(asker.feedback):
                assert body[:16] == goal
                feedback.append(numbers_of(body, 16))
            if cancel_after is not None and cancelled is None and len(feedback) >= cancel_after:
                cancelled = asker.ask(CANCEL, goal_info(goal))
            return wanted in asker.replies

        rig.until(done, "the result")
        if cancelled is not None:
            rig.until(lambda: cancelled in asker.replies, "the answer to the cancelling")
            assert struct.unpack_from("<bxxxI", asker.replies[cancelled]) == (0, 1)
        reply = asker.replies[wanted]
        return reply[0], numbers_of(reply, 4), feedback

    status, sequence, feedback = see_through(5, None)
    assert (status, sequence) == (SUCCEEDED, [0, 1, 1, 2, 3, 5, 8])
    assert [len(piece) for piece in feedback] == [3, 4, 5, 6, 7]
    status, sequence, _ = see_through(500, 2)
    assert status == CANCELED
    assert sequence[:4] == [0, 1, 1, 2]
    assert asker.status.pending
    assert rig.told == []
