"""What timers can do: begin later, change their period, be reset, and stop themselves.

    python timers.py local:

prints

    slow 1
    slow 2
    fast 1
    fast 2
    fast 3
    over
"""

from way import open_context

from muros.rclc import Executor

context = open_context()
node = context.node("timers")
calls = {"slow": 0, "fast": 0}


def slow() -> None:
    """Calls twice, then starts the fast one."""
    calls["slow"] += 1
    print("slow", calls["slow"])
    if calls["slow"] == 2:
        slow_timer.cancel()
        fast_timer.exchange_period(0.05)
        fast_timer.reset()


def fast() -> None:
    """Calls thrice, then ends the program."""
    calls["fast"] += 1
    print("fast", calls["fast"])
    if calls["fast"] == 3:
        print("over")
        context.close()


slow_timer = node.timer(0.3, slow)
fast_timer = node.timer(10.0, fast, autostart=False)
Executor(context).spin()
