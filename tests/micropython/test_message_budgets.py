"""The gate on what message classes cost on a board: all standard types, none left out."""

import pytest

from tests.micropython.message_budgets import costs, limit, shares
from tests.micropython.runtimes import require


@pytest.mark.timeout(300)  # half a minute where nothing else runs
def test_every_class_fits_its_budget() -> None:
    require("mpy-cross")
    require("gauge")
    assert len(costs()) > 230
    assert costs()["std_msgs/msg/Empty"] > 300
    over = [f"{name}: {costs()[name]} B of {limit(name)}" for share, name in shares() if share > 100]
    assert not over, "\n".join(over)


def test_limits_count_what_is_nested() -> None:
    assert limit("std_msgs/msg/Int64") == 1200
    assert limit("sensor_msgs/msg/Imu") == 1200 + 4 * 400
    assert limit("nav_msgs/msg/Odometry") == 1200 + 9 * 400
    assert limit("std_srvs/srv/Empty") == 2 * 1200
