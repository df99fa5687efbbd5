"""What engines say of services and of pairs that do not fit: one wording, whatever the engine."""

from muros.space._core import Core
from muros.space._qos import Mismatch, duration

__all__ = [
    "mismatched",
    "no_server",
    "reply_unmatched",
    "request_overwritten",
    "request_unanswered",
    "server_too_slow",
    "several_servers",
    "types_differ",
]


def types_differ(offered: str, wanted: str) -> Mismatch:
    """A writer and a reader of one topic have different types."""
    return Mismatch(
        "type", f"type {offered}", f"type {wanted}", "Use one type for one topic, or another topic name"
    )


def mismatched(
    core: Core, reader: str, writer: str, topic: str, reasons: tuple[Mismatch, ...], *, who: str = ""
) -> None:
    """The reader and the writer (named by their owners) do not fit; that is `who`'s matter, else the reader's."""
    core.report(
        "type-mismatch" if reasons[0].policy == "type" else "qos-mismatch",
        who=who or reader,
        subject=topic,
        what=f"{reader} gets no {topic} from {writer}",
        why="; ".join(str(reason) for reason in reasons),
        remedy="; ".join(reason.remedy for reason in reasons),
    )


def no_server(core: Core, who: str, service: str, n: int, waited: int = 0) -> None:
    """Requests were given up: no server came in the time they waited, ns (0: they were not to wait)."""
    core.report(
        "no-server",
        who=who,
        subject=service,
        what=f"{{n}} request{{s}} of {who} to {service} given up",
        why=f"no server for {service}" + (f" within {duration(waited)}" if waited else ""),
        remedy=f"Start a server for {service}, or look at its name, type, domain and QoS",
        n=n,
    )


def server_too_slow(core: Core, who: str, service: str, n: int, waited: int = 0) -> None:
    """Requests were given up: the server took none in the time they waited, ns (0: they were not to wait)."""
    core.report(
        "server-too-slow",
        who=who,
        subject=service,
        what=f"{{n}} request{{s}} of {who} to {service} given up",
        why="the server did not take them" + (f" within {duration(waited)}" if waited else " at once"),
        remedy="Ask less often, or make the server take its requests faster",
        n=n,
    )


def request_unanswered(core: Core, who: str, service: str, n: int) -> None:
    """The server has gone, or vanished, with requests that it had not answered."""
    core.report(
        "request-unanswered",
        who=who,
        subject=service,
        what=f"{{n}} request{{s}} of {who} to {service} will not be answered",
        why="the server they were given to has gone",
        remedy="Ask again; a server that died is noticed only when its lease is over",
        n=n,
    )


def request_overwritten(core: Core, who: str, service: str, limit: int, n: int) -> None:
    """Requests were dropped: more waited than the QoS keeps."""
    core.report(
        "request-overwritten",
        who=who,
        subject=service,
        what=f"{{n}} request{{s}} of {who} to {service} dropped",
        why=f"no server took them, and only {limit} can wait",
        remedy=f"Wait for the server before asking, or give the client of {service} a greater depth",
        n=n,
    )


def several_servers(core: Core, who: str, service: str, servers: int) -> None:
    """More than one server answers each request."""
    core.report(
        "several-servers",
        who=who,
        subject=service,
        what=f"each request of {who} to {service} is answered more than once",
        why=f"{servers} servers offer {service}",
        remedy=f"Stop all but one of the servers of {service}",
    )


def reply_unmatched(core: Core, who: str, service: str, n: int) -> None:
    """Replies were for nobody."""
    core.report(
        "reply-unmatched",
        who=who,
        subject=service,
        what=f"{{n}} time{{s}} a reply of {who} from {service} went to nobody",
        why="the client that asked is gone, or the reply does not name a request",
        remedy="Nothing, if the client was stopped; else return the identity that came with the request",
        n=n,
    )
