"""A board with what rclc has no calls for yet: parameters, and an action that counts Fibonacci numbers.

Run with the agent's UDP port, the domain and a folder that has test_msgs/action/Fibonacci.action.
"""

import sys
from typing import Any

from muros.client import Udp
from muros.interfaces import action, add_path, message, service
from muros.rclc import Context, Executor
from muros.rclc.service import Service

ACCEPTED, EXECUTING, SUCCEEDED, CANCELED = 1, 2, 4, 5
INTEGER = 2


class Parameters:
    """One parameter, the integer "speed"; anything else is refused."""

    def __init__(self, node: Any) -> None:
        self.speed = 5
        self.value = message("rcl_interfaces/msg/ParameterValue")
        self.result = message("rcl_interfaces/msg/SetParametersResult")
        self.get = service("rcl_interfaces/srv/GetParameters")
        self.set = service("rcl_interfaces/srv/SetParameters")
        node.service(self.get, "~/get_parameters", self.on_get)
        node.service(self.set, "~/set_parameters", self.on_set)

    def on_get(self, request: Any) -> Any:
        known = self.value(type=INTEGER, integer_value=self.speed)
        return self.get.Response(
            values=[known if name == "speed" else self.value() for name in request.names]
        )

    def on_set(self, request: Any) -> Any:
        results = []
        for parameter in request.parameters:
            fits = parameter.name == "speed" and parameter.value.type == INTEGER
            if fits:
                self.speed = parameter.value.integer_value
            results.append(
                self.result(successful=fits, reason="" if fits else "there is only an integer speed")
            )
        return self.set.Response(results=results)


class Counter:
    """The server of an action: three services and two topics."""

    def __init__(self, node: Any) -> None:
        self.kind: Any = action("test_msgs/action/Fibonacci")
        self.cancel = service("action_msgs/srv/CancelGoal")
        self.states: Any = message("action_msgs/msg/GoalStatusArray")
        self.state: Any = message("action_msgs/msg/GoalStatus")
        self.feedback = node.publisher(self.kind.FeedbackMessage, "count/_action/feedback")
        self.status = node.publisher(self.states, "count/_action/status", qos="status")
        node.service(self.kind.SendGoal, "count/_action/send_goal", self.on_goal)
        node.service(self.cancel, "count/_action/cancel_goal", self.on_cancel)
        self.result: Service = node.service(self.kind.GetResult, "count/_action/get_result", self.on_result)
        node.timer(0.05, self.step)
        self.goal: Any = None
        self.order, self.now, self.sequence = 0, 0, [0, 1]
        self.asked: bytes | None = None

    def on_goal(self, request: Any) -> Any:
        self.goal, self.order, self.sequence = request.goal_id, request.goal.order, [0, 1]
        self.tell(EXECUTING)
        return self.kind.SendGoal.Response(accepted=True)

    def on_cancel(self, request: Any) -> Any:
        response = self.cancel.Response()
        if self.now == EXECUTING:
            response.goals_canceling = [request.goal_info]
            self.order = -1
        return response

    def on_result(self, request: Any) -> Any:
        self.asked = self.result.identity
        return None

    def step(self) -> None:
        if self.now == EXECUTING:
            if len(self.sequence) - 2 < self.order:
                self.sequence.append(self.sequence[-1] + self.sequence[-2])
                feedback = self.kind.Feedback(sequence=self.sequence)
                self.feedback.publish(self.kind.FeedbackMessage(goal_id=self.goal, feedback=feedback))
            else:
                self.tell(CANCELED if self.order < 0 else SUCCEEDED)
        elif self.asked is not None:
            result = self.kind.Result(sequence=self.sequence)
            self.result.reply(self.asked, self.kind.GetResult.Response(status=self.now, result=result))
            self.asked = None

    def tell(self, state: int) -> None:
        self.now = state
        told = self.state(status=state)
        told.goal_info.goal_id = self.goal
        self.status.publish(self.states(status_list=[told]))


def main() -> None:
    """Serve until killed."""
    port, domain, folder = sys.argv[1:]
    add_path(folder)
    context = Context(Udp("127.0.0.1", int(port)), client_key=0xB0A2D, domain_id=int(domain))
    node = context.node("board", namespace="lab")
    Parameters(node)
    Counter(node)
    Executor(context).spin()


if __name__ == "__main__":
    main()
