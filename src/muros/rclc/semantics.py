"""What executors may be asked to do: the words of their arguments. Boards borrow this."""

RCLCPP = 0
"""Each handle takes what has come for it when its turn comes, so it sees what those before it have just done."""

LET = 1
"""Logical execution time: all take at the start of a period, and what they publish leaves at its end; see ``let``."""

ON_NEW_DATA = 0
"""The callback of a handle runs when something has come for it."""

ALWAYS = 1
"""The callback of a subscription runs in each pass, with None when nothing has come."""
