"""Prints what the board floor costs today, beside what it may cost. Usage: make budgets"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from tests.micropython.budgets import BUDGETS  # noqa: E402
from tests.micropython.client_budgets import CLIENT_BUDGETS  # noqa: E402
from tests.micropython.message_budgets import MESSAGE_BUDGETS, costs, limit, shares  # noqa: E402

_DEAREST = 5  # message classes to show by name


def main() -> int:
    """Exit status 1 when a row is over its budget."""
    over = 0
    print(f"{'what':<60} {'today':>10} {'budget':>10}")
    for budget in (*BUDGETS, *CLIENT_BUDGETS, *MESSAGE_BUDGETS):
        figure = budget.measure()
        mark = "" if figure <= budget.limit else "  OVER"
        over += bool(mark)
        print(f"{budget.what:<60} {figure:>10,.0f} {budget.limit:>10,.0f} {budget.unit}{mark}")
    for _, name in shares()[:_DEAREST]:
        print(f"  {name:<58} {costs()[name]:>10,.0f} {limit(name):>10,.0f} B")
    return 1 if over else 0


if __name__ == "__main__":
    sys.exit(main())
