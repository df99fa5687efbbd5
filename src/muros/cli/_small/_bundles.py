"""Which modules of the board floor are in memory together."""

HOME = "muros"
MOVED, TO = "muros.xrce.", "muros.xrce_"
"""The modules of this package stand beside it: that saves the package."""

_WAYS = r"\bmuros\.(client|rclc)\b"
_SERIAL = r"\b(Serial|Uart|framing)\b"
_CALLED = r"\.%s\("

RESIDENT: tuple[tuple[str, str], ...] = (
    ("muros.compat", ""),
    ("muros.xrce.streams", _WAYS),
    ("muros.xrce.session", _WAYS),
    ("muros.client.session", _WAYS),
    ("muros.xrce._codec", _SERIAL),
    ("muros.xrce.serial", _SERIAL),
    ("muros.client.custom", r"\bCustom\b"),
    ("muros.client.stream", r"\b(Udp|Tcp)\b"),
    ("muros.client.udp", r"\bUdp\b"),
    ("muros.rclc.context", r"\bmuros\.rclc\b"),
    ("muros.rclc.executor", r"\bExecutor\b"),
    ("muros.rclc.subscription", _CALLED % "subscription"),
    ("muros.rclc.timer", _CALLED % "timer"),
    ("muros.client.services", _CALLED % "(service|client)"),
    ("muros.rclc.service", _CALLED % "service"),
    ("muros.rclc.client", _CALLED % "client"),
    ("muros.client.timesync", r"\bTimeSync\b"),
    ("muros.client.exchange", r"\bTimeSync\b"),
    ("muros.client.echo", _CALLED % "ping"),
)
"""Modules in the order of their need, and what a program says that keeps the module while it is connected."""

PLAIN = "muros.xrce._codec"  # not needed where native code does the same

OF_MESSAGES = ("muros.cdr", "muros.cdr_texts", "muros.cdr_lists", "muros.cdr_rows")
"""Modules that are kept when a message class imports them."""

BORROWED: dict[str, tuple[str, ...]] = {
    "muros.shared": (
        "muros.client.chance",
        "muros.client.names",
        "muros.xrce.requests",
        "muros.client.entities",
    ),
    "muros.start": (
        "muros.xrce.beginning",
        "muros.client.start",
    ),
    "muros.make": (
        "muros.client.qos",
        "muros.client.making",
        "muros.rclc.node",
        "muros.rclc.contexts",
    ),
    "muros.link": (
        "muros.client.hello",
        "muros.xrce.create",
        "muros.client.creating",
        "muros.client.link",
    ),
    "muros.trouble": (
        "muros.xrce.mending",
        "muros.xrce.fragments",
        "muros.client.backlog",
    ),
}
"""Modules that are borrowed together: to begin a session; to make things in it; to connect; what all of these need;
and for messages that got lost, are longer than one datagram, or have to wait."""
