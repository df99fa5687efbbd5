"""What `muros doctor` looks at in the graph: nodes, topics, types, QoS, services, and what the engine noticed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from muros import interfaces
from muros.cli._diagnosis import Result, fine, note, wrong
from muros.cli._host_checks import domains_in_use
from muros.cli._names import RosTopic, node_name, ros_services, ros_topics
from muros.cli.graph import is_noise
from muros.cli.node import nodes_of
from muros.findings import Severity
from muros.space import mismatches

if TYPE_CHECKING:
    from muros.cli._tool import Tool
    from muros.space import Endpoint, Incompatible, ParticipantInfo

__all__ = ["clients_of", "graph_checks"]

SHOWN: Final = 8
"""Names in a list; the others are counted."""


def graph_checks(tool: Tool) -> Iterator[Result]:
    """All of them, on what discovery has found."""
    nodes, topics = nodes_of(tool), ros_topics(tool)
    own = tool.participant.gid
    others = [p for p in tool.graph.participants if p.domain == tool.domain and p.gid != own]
    if not others:
        busy = [str(d) for d in domains_in_use() if d != tool.domain]
        if busy:
            yield note(
                f"nobody else is in domain {tool.domain}, but processes of this host are in domain {', '.join(busy)}",
                f"muros doctor -d {busy[0]} looks there; ROS_DOMAIN_ID={busy[0]} takes all commands there",
            )
            return
        yield note(
            f"nobody else is in domain {tool.domain}",
            "If somebody should be: the same ROS_DOMAIN_ID there? The same network, without a firewall between?",
        )
        return
    services = ros_services(tool)
    hosts = sorted({_host(p) for p in others if p.host})
    yield fine(
        f"{_count(len(nodes), 'node')}, {_count(len(topics), 'topic')} and {_count(len(services), 'service')} "
        f"in domain {tool.domain}" + (f", on {_listed(hosts)}" if len(hosts) > 1 else "")
    )
    yield from _node_checks(tool, nodes, others)
    yield from _topic_checks(tool, topics)
    lonely = [s.name for s in services if not s.servers and not is_noise(s.name)]
    if lonely:
        yield note(f"nobody serves {_listed(lonely)}, though somebody would ask")
    yield from finding_checks(tool)


def _node_checks(
    tool: Tool, nodes: Iterable[ParticipantInfo], others: Iterable[ParticipantInfo]
) -> Iterator[Result]:
    twice = [name for name, number in Counter(n.full_name for n in nodes).items() if number > 1]
    for name in twice:
        yield wrong(
            f"several nodes are called {name}: parameters and services of one are taken for the other's",
            "Start one of them with another name or namespace (ros2 run ... --ros-args -r __node:=NAME)",
        )
    busy = {e.participant.gid for e in (*tool.graph.writers, *tool.graph.readers)}
    silent = [p for p in others if p.gid not in busy]
    if silent:
        yield note(
            f"{_listed([_who(p) for p in silent])}: there, but without writers and readers",
            "If it stays so, a firewall keeps unicast UDP of that host from this one",
        )


def _topic_checks(tool: Tool, topics: list[RosTopic]) -> Iterator[Result]:
    before = 0
    for topic in topics:
        for result in (*_type_checks(topic), *_qos_checks(tool, topic)):
            before += 1
            yield result
    if topics and not before:
        yield fine("types and QoS fit on every topic")
    shown = [t for t in topics if not is_noise(t.name)]
    for title, without in (
        ("written, but nobody listens", [t.name for t in shown if not t.readers]),
        ("listened to, but nobody writes", [t.name for t in shown if not t.writers]),
    ):
        if without:
            yield note(f"{title}: {_listed(without)}")


def _type_checks(topic: RosTopic) -> Iterator[Result]:
    endpoints = (*topic.writers, *topic.readers)
    if len(topic.types) > 1:
        told = _by(endpoints, lambda e: e.type_name)
        yield wrong(
            f"{topic.name} has several types, and those of different types do not meet: {told}",
            "Give one of the two topics another name, or both sides one type",
        )
        return
    hashes = {e.type_hash for e in endpoints if e.type_hash}
    kind = topic.types[0]
    if len(hashes) > 1:
        told = _by(endpoints, lambda e: e.type_hash and e.type_hash[:15] + "...")
        yield wrong(
            f"{topic.name}: {kind} is defined differently: {told}",
            f"Build all of them with the same definition of {kind}",
        )
    elif hashes and interfaces.known(kind):
        own = interfaces.rihs01(kind)
        if hashes != {own}:
            yield note(
                f"{topic.name}: {kind} is defined there in another way than here, so echo may show nonsense",
                "Name their definition with --types FOLDER, or their distribution with $MUROS_DISTRO",
            )


def _qos_checks(tool: Tool, topic: RosTopic) -> Iterator[Result]:
    info = tool.graph.topic(topic.dds_name, tool.domain)
    own = tool.participant.gid
    for pair in info.incompatible if info else ():
        if own not in (pair.writer.participant.gid, pair.reader.participant.gid):
            writer, reader = node_name(pair.writer.participant), node_name(pair.reader.participant)
            why = "; ".join(pair.reasons)
            yield wrong(f"{topic.name}: {reader} hears nothing of {writer}: {why}", _cure(pair))


def _cure(pair: Incompatible) -> str:
    remedies = [m.remedy for m in mismatches(pair.writer.qos, pair.reader.qos)]
    return "; ".join(remedies) or "Make the QoS of both fit"


def finding_checks(tool: Tool) -> Iterator[Result]:
    """What the engine noticed while we looked."""
    for finding in tool.space.findings.snapshot():
        what = (
            replace(finding, new=finding.count)
            .format()
            .partition("\n")[0]
            .removeprefix("finding: ")
            .rstrip(".")
        )
        if finding.severity is Severity.INFO:
            yield note(what, finding.remedy)
        else:
            yield wrong(what, finding.remedy or "See docs/space.md")


def clients_of(tool: Tool, holder: str) -> list[str]:
    """The nodes that a process of this host has in the graph; `holder` is "name (pid 4711)"."""
    pid = holder.rpartition("(pid ")[2].rstrip(")")
    return [n.full_name for n in nodes_of(tool) if pid and n.pid == pid]


def _by(endpoints: Iterable[Endpoint], key: Callable[[Endpoint], str]) -> str:
    """Who says what: "a of /x, /y; b of /z"."""
    groups: dict[str, list[str]] = {}
    for endpoint in endpoints:
        if what := key(endpoint):
            groups.setdefault(what, []).append(node_name(endpoint.participant))
    return "; ".join(f"{what} of {_listed(sorted(set(names)))}" for what, names in groups.items())


def _who(participant: ParticipantInfo) -> str:
    place = ", ".join(
        part
        for part in (participant.vendor, participant.host, participant.pid and f"pid {participant.pid}")
        if part
    )
    return node_name(participant) + (f" ({place})" if place else "")


def _host(participant: ParticipantInfo) -> str:
    """The name of its machine, without the number that some put behind it."""
    return participant.host.partition(":")[0]


def _listed(names: list[str]) -> str:
    rest = len(names) - SHOWN
    return ", ".join(names[:SHOWN]) + (f" and {rest} more" if rest > 0 else "")


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"
