"""Gates on what the client and rclc cost on a board."""

import pytest

from tests.micropython.budgets import Budget
from tests.micropython.client_budgets import CLIENT_BUDGETS
from tests.micropython.runtimes import require


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
