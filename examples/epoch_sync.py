"""Asks the agent for its time: a board learns the date, and by how much it may be wrong.

    python epoch_sync.py udp:192.168.1.10:8888

prints

    2026-11-22, within 180 us
"""

from way import way

from muros.client import Session, TimeSync
from muros.rclc import Context, Executor

session = Session(way())
context = Context(session)
node = context.node("epoch_sync")
clock = TimeSync(session)


def tell() -> None:
    """Asks, and tells what is known by now."""
    clock.request()
    if clock.synchronized():
        seconds, _ = clock.time()
        year, month, day = date(seconds // 86400)
        print(f"{year}-{month:02d}-{day:02d}, within {clock.error()} us")


def date(days: int) -> "tuple[int, int, int]":
    """Year, month and day of a number of days since 1970. Boards count their years from elsewhere."""
    days += 719468  # days of the years from 0 to 1970, which begin in March here
    era, day = days // 146097, days % 146097
    year = (day - day // 1460 + day // 36524 - day // 146096) // 365
    day -= 365 * year + year // 4 - year // 100
    month = (5 * day + 2) // 153
    return year + era * 400 + (month > 9), month + 3 - 12 * (month > 9), day - (153 * month + 2) // 5 + 1


node.timer(0.2, tell)
Executor(context).spin()
