"""The graph as somebody looks at it: nodes, topics and services, and text, DOT and SVG made of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from muros.cli._layout import Layout, lay_out
from muros.cli._names import ros_services, ros_topics
from muros.cli.node import nodes_of

if TYPE_CHECKING:
    from muros.cli._tool import Tool
    from muros.space import Endpoint, Incompatible, ParticipantInfo

__all__ = ["Kind", "Link", "Thing", "View", "look", "to_dot", "to_svg", "to_text"]


class Kind(Enum):
    """What a thing in the picture is."""

    NODE = "node"
    TOPIC = "topic"
    SERVICE = "service"


@dataclass(frozen=True, slots=True)
class Thing:
    """A node, a topic or a service."""

    kind: Kind
    name: str


@dataclass(frozen=True, slots=True)
class Link:
    """A node writes a topic or asks a service (`away`), or reads the topic or serves the service."""

    node: Thing
    thing: Thing
    away: bool
    qos: str = ""

    @property
    def ends(self) -> tuple[Thing, Thing]:
        """From where data goes to where."""
        return (self.node, self.thing) if self.away else (self.thing, self.node)


@dataclass(slots=True)
class View:
    """What is shown. `misfits`: pairs of nodes on a topic that do not meet, with the reasons."""

    domain: int
    things: dict[Thing, str] = field(default_factory=dict)
    """Each with its types in words."""
    links: dict[Link, None] = field(default_factory=dict)
    misfits: list[tuple[Thing, Thing, Thing, str]] = field(default_factory=list)
    """Topic, writing node, reading node, reasons."""

    def of(self, kind: Kind) -> list[Thing]:
        """The things of one kind, by name."""
        return sorted((t for t in self.things if t.kind is kind), key=lambda t: t.name)


def look(tool: Tool, leave_out: Callable[[str], bool] | None) -> View:
    """What a space shows just now, without the names that are to be left out and without the command itself."""
    view = View(tool.domain)
    keep = leave_out or (lambda _: False)

    def node(owner: ParticipantInfo) -> Thing | None:
        thing = Thing(Kind.NODE, owner.full_name if owner.name else f"DDS {owner.gid[:12].hex()}")
        if keep(thing.name):
            return None
        view.things.setdefault(thing, "")
        return thing

    def connect(thing: Thing, endpoints: Iterable[Endpoint], away: bool) -> None:
        for endpoint in endpoints:
            if (owner := node(endpoint.participant)) is not None:
                view.links.setdefault(Link(owner, thing, away, str(endpoint.qos)))

    for each in nodes_of(tool):
        node(each)
    for topic in ros_topics(tool):
        _add(view, connect, Thing(Kind.TOPIC, topic.name), topic.types, topic.writers, topic.readers, keep)
        if not keep(topic.name):
            info = tool.graph.topic(topic.dds_name, tool.domain)
            view.misfits += _misfits(Thing(Kind.TOPIC, topic.name), info.incompatible if info else (), node)
    if leave_out is None:
        for plain in ros_topics(tool, plain_dds=True):
            if not plain.name.startswith(("rt/", "rq/", "rr/")):
                thing = Thing(Kind.TOPIC, f"DDS {plain.name}")
                _add(view, connect, thing, plain.types, plain.writers, plain.readers, keep)
    for service in ros_services(tool):
        thing = Thing(Kind.SERVICE, service.name)
        _add(view, connect, thing, service.types, service.clients, service.servers, keep)
    return view


def _add(
    view: View,
    connect: Callable[[Thing, Iterable[Endpoint], bool], None],
    thing: Thing,
    types: tuple[str, ...],
    sources: Iterable[Endpoint],
    sinks: Iterable[Endpoint],
    leave_out: Callable[[str], bool],
) -> None:
    if leave_out(thing.name):
        return
    view.things[thing] = ", ".join(types)
    connect(thing, sources, True)
    connect(thing, sinks, False)


def _misfits(
    topic: Thing, pairs: Iterable[Incompatible], node: Callable[[ParticipantInfo], Thing | None]
) -> Iterator[tuple[Thing, Thing, Thing, str]]:
    for pair in pairs:
        writer, reader = node(pair.writer.participant), node(pair.reader.participant)
        if writer is not None and reader is not None:
            yield topic, writer, reader, "; ".join(pair.reasons)


# ---- text ----

_VERBS: Final = {
    (Kind.TOPIC, True): ("writes", "->"),
    (Kind.TOPIC, False): ("reads", "<-"),
    (Kind.SERVICE, True): ("asks", "->"),
    (Kind.SERVICE, False): ("serves", "<-"),
}


def to_text(view: View) -> str:
    """For a terminal: each node with what it writes, reads, asks and serves, and who is at the other end."""
    counts = [(len(view.of(kind)), kind.value) for kind in Kind]
    lines = [
        f"domain {view.domain}: " + ", ".join(f"{n} {word}{'' if n == 1 else 's'}" for n, word in counts)
    ]
    links = list(dict.fromkeys((link.node, link.thing, link.away) for link in view.links))
    for node in view.of(Kind.NODE):
        lines += ["", node.name]
        own = [(thing, away) for at, thing, away in links if at == node]
        rows = []
        for (kind, away), (verb, arrow) in _VERBS.items():
            for thing in sorted((t for t, a in own if t.kind is kind and a is away), key=lambda t: t.name):
                there = sorted(
                    _far(view, node, n, thing) for n, t, a in links if t == thing and a is not away
                )
                rows.append((verb, thing.name, view.things[thing], f"{arrow} {', '.join(there) or 'nobody'}"))
        widths = [max((len(row[column]) for row in rows), default=0) for column in range(3)]
        for verb, name, types, far in rows:
            lines.append(f"  {verb:<6}  {name:<{widths[1]}}  {types:<{widths[2]}}  {far}")
        if not rows:
            lines.append("  (nothing)")
    lines += [""] if view.misfits else []
    lines += [f"no match on {t.name}: {w.name} -> {r.name}: {why}" for t, w, r, why in view.misfits]
    return "\n".join(lines) + "\n"


def _far(view: View, node: Thing, other: Thing, thing: Thing) -> str:
    """The node at the other end, marked if the two do not meet."""
    apart = any(t == thing and {w, r} == {node, other} for t, w, r, _ in view.misfits)
    return f"{other.name} (no match)" if apart else other.name


# ---- Graphviz ----

_SHAPES: Final = {Kind.NODE: "ellipse", Kind.TOPIC: "box", Kind.SERVICE: "hexagon"}


def to_dot(view: View) -> str:
    """In the language of Graphviz."""
    lines = ["digraph muros {", "  rankdir=LR;", '  node [fontname="sans-serif", fontsize=11];']
    names = {thing: f"{thing.kind.value} {thing.name}" for thing in view.things}
    broken = _broken(view)
    for thing, types in view.things.items():
        attributes = f"label={_quoted(thing.name)}, shape={_SHAPES[thing.kind]}"
        lines.append(f"  {_quoted(names[thing])} [{attributes}, tooltip={_quoted(types or thing.name)}];")
    for link in view.links:
        a, b = link.ends
        why = broken.get((a, b))
        look = f"tooltip={_quoted(why or link.qos)}" + (", style=dashed, color=red" if why else "")
        lines.append(f"  {_quoted(names[a])} -> {_quoted(names[b])} [{look}];")
    return "\n".join([*lines, "}", ""])


def _broken(view: View) -> dict[tuple[Thing, Thing], str]:
    """The lines from topics to readers that some writer does not reach, with the reasons."""
    broken: dict[tuple[Thing, Thing], str] = {}
    for topic, writer, reader, why in view.misfits:
        told = f"{writer.name} does not reach {reader.name}: {why}"
        before = broken.get((topic, reader))
        broken[topic, reader] = f"{before}\n{told}" if before else told
    return broken


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'


# ---- SVG ----

MARGIN: Final = 24.0
LETTER: Final = 7.3  # pixels of an average letter at the size below, on the safe side
HEIGHT: Final = 30.0

_STYLE: Final = """\
  svg { font: 13px system-ui, sans-serif; background: #fff; color-scheme: light dark }
  text { text-anchor: middle; dominant-baseline: central; fill: #1b2733 }
  .node { fill: #dcecff; stroke: #3a78b5 } .topic { fill: #fff4d6; stroke: #b58a2a }
  .service { fill: #e3f5e1; stroke: #4c9a45 }
  path { fill: none; stroke: #5d6b78; stroke-width: 1.3 } .misfit { stroke: #d12f2f; stroke-dasharray: 5 4 }
  @media (prefers-color-scheme: dark) {
    svg { background: #14181d } text { fill: #e6edf3 } path { stroke: #9aa7b3 } .misfit { stroke: #ff7b72 }
    .node { fill: #16324f } .topic { fill: #40340f } .service { fill: #173d1a }
  }
"""


def to_svg(view: View) -> str:
    """As a picture that needs no other program; hovering over a thing or a line tells its type or QoS."""
    sizes = {thing: (LETTER * len(thing.name) + 28, HEIGHT) for thing in view.things}
    layout = lay_out(sizes, [link.ends for link in view.links])
    width, height = layout.width + 2 * MARGIN, layout.height + 2 * MARGIN
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width:.0f}" height="{height:.0f}">',
        f"<title>domain {view.domain}</title>",
        f"<style>\n{_STYLE}</style>",
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
        'orient="auto-start-reverse"><path d="M0,0.5 L7,4 L0,7.5" style="stroke-width:1.4"/></marker></defs>',
        f'<g transform="translate({MARGIN:.0f} {MARGIN:.0f})">',
    ]
    broken = _broken(view)
    words: dict[tuple[Thing, Thing], list[str]] = {}
    for link in view.links:
        words.setdefault(link.ends, []).append(link.qos)
    for ends, qos in words.items():
        if ends in layout.routes:
            why = broken.get(ends)
            curve = _curve(ends, layout, sizes)
            lines.append(_path(curve, "misfit" if why else "", why or _described(ends, qos)))
    for thing, (x, y) in layout.centres.items():
        lines.append(_shape(thing, x, y, sizes[thing][0], view.things[thing]))
    return "\n".join([*lines, "</g>", "</svg>", ""])


def _described(ends: tuple[Thing, Thing], qos: list[str]) -> str:
    return f"{ends[0].name} -> {ends[1].name}: {' / '.join(dict.fromkeys(q for q in qos if q))}"


def _path(d: str, look: str, title: str) -> str:
    style = f' class="{look}"' if look else ""
    return f'<path d="{d}"{style} marker-end="url(#tip)"><title>{_escaped(title)}</title></path>'


def _curve(ends: tuple[Thing, Thing], layout: Layout, sizes: dict[Thing, tuple[float, float]]) -> str:
    """A smooth line from the side of one thing to that of the other, through the bends between."""
    points = layout.routes[ends]
    step = 1 if points[0][0] <= points[-1][0] else -1
    (x0, y0), (x1, y1) = points[0], points[-1]
    points = [(x0 + step * sizes[ends[0]][0] / 2, y0), *points[1:-1], (x1 - step * sizes[ends[1]][0] / 2, y1)]
    parts = [f"M{points[0][0]:.1f},{points[0][1]:.1f}"]
    for (ax, ay), (bx, by) in pairwise(points):
        middle = (ax + bx) / 2
        parts.append(f"C{middle:.1f},{ay:.1f} {middle:.1f},{by:.1f} {bx:.1f},{by:.1f}")
    return " ".join(parts)


def _shape(thing: Thing, x: float, y: float, width: float, types: str) -> str:
    left, top = x - width / 2, y - HEIGHT / 2
    style = f'class="{thing.kind.value}"'
    if thing.kind is Kind.SERVICE:
        corners = [(left, y), (left + 10, top), (left + width - 10, top), (left + width, y)]
        corners += [(left + width - 10, top + HEIGHT), (left + 10, top + HEIGHT)]
        body = f'<polygon {style} points="{" ".join(f"{px:.1f},{py:.1f}" for px, py in corners)}"/>'
    else:
        radius = HEIGHT / 2 if thing.kind is Kind.NODE else 4
        body = (
            f'<rect {style} x="{left:.1f}" y="{top:.1f}" width="{width:.1f}" height="{HEIGHT:.0f}" '
            f'rx="{radius:g}"/>'
        )
    title = f"{thing.kind.value} {thing.name}" + (f" [{types}]" if types else "")
    label = f'<text x="{x:.1f}" y="{y:.1f}">{_escaped(thing.name)}</text>'
    return f"<g>{body}{label}<title>{_escaped(title)}</title></g>"


def _escaped(text: str) -> str:
    from html import escape

    shown = "".join(c if c.isprintable() else "?" for c in text)  # XML has no place for control characters
    return escape(shown)
