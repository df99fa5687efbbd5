"""A layered layout of a directed graph, from left to right (Sugiyama's method), for pictures without other programs.

Four steps. Edges that would close a circle are turned round. Each vertex gets a layer, so that edges go from lower
to higher ones, and an edge over several layers gets a bend in each between. The order inside the layers is improved
by putting vertices at the middle of their neighbours, to and fro, as long as edges cross less. At last positions
inside the layers are pulled towards neighbours, without overlap. Same input, same picture.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Final

__all__ = ["Layout", "lay_out"]

Point = tuple[float, float]
Vertex = Hashable
Edge = tuple[Vertex, Vertex]

SWEEPS: Final = 24
"""Times that the order is tried to improve."""

PULLS: Final = 12
"""Times that positions are pulled towards their neighbours."""

LAYER_GAP: Final = 70.0
"""Pixels between layers."""

VERTEX_GAP: Final = 18.0
"""Pixels between two vertices of a layer."""


@dataclass(slots=True)
class Layout:
    """Where everything is: centres of vertices, points on edges from their first to their last vertex."""

    width: float
    height: float
    centres: dict[Any, Point] = field(default_factory=dict)
    routes: dict[tuple[Any, Any], list[Point]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Bend:
    """Where an edge crosses a layer."""

    edge: Edge
    layer: int


def lay_out(sizes: Mapping[Any, Point], edges: Iterable[Edge]) -> Layout:
    """Place vertices of these sizes (width, height in pixels) so that edges between them are short and cross little.

    Edges from a vertex to itself, or of vertices that are not in `sizes`, are left out. Vertices keep their order
    where nothing speaks against it.
    """
    wanted = [(a, b) for a, b in dict.fromkeys(edges) if a != b and a in sizes and b in sizes]
    forward = _without_circles(list(sizes), wanted)
    layer_of = _layers(list(sizes), forward)
    chains = {edge: _chain(edge, layer_of) for edge in forward}
    rows = _ordered(_rows(list(sizes), layer_of, chains.values()), chains.values())
    heights = {vertex: sizes[vertex][1] if vertex in sizes else 0.0 for row in rows for vertex in row}
    across = _positions(rows, chains.values(), heights)
    along = _columns(rows, sizes)
    layout = Layout(0.0, 0.0)
    for number, row in enumerate(rows):
        for vertex in row:
            if vertex in sizes:
                layout.centres[vertex] = (along[number], across[vertex])
    for edge in wanted:
        chain = chains.get(edge) or list(reversed(chains[edge[1], edge[0]]))
        layout.routes[edge] = [
            (along[step.layer if isinstance(step, _Bend) else layer_of[step]], across[step]) for step in chain
        ]
    layout.width = max((x + sizes[v][0] / 2 for v, (x, _) in layout.centres.items()), default=0.0)
    layout.height = max((across[v] + heights[v] / 2 for v in across), default=0.0)
    return layout


def _without_circles(vertices: Sequence[Vertex], edges: Sequence[Edge]) -> list[Edge]:
    """The edges, those turned round that lead back to where a walk through the graph came from."""
    after: dict[Vertex, list[Vertex]] = {v: [] for v in vertices}
    entered = dict.fromkeys(vertices, 0)
    for a, b in edges:
        after[a].append(b)
        entered[b] += 1
    on_way: set[Vertex] = set()
    done: set[Vertex] = set()
    result: dict[Edge, None] = {}
    for start in sorted(vertices, key=lambda v: entered[v] > 0):  # begin where nothing leads to
        walk = [(start, iter(after[start]))] if start not in done else []
        on_way.update(v for v, _ in walk)
        while walk:
            vertex, rest = walk[-1]
            following = next(rest, None)
            if following is None:
                walk.pop()
                on_way.discard(vertex)
                done.add(vertex)
            elif following in on_way:
                result[following, vertex] = None
            else:
                result[vertex, following] = None
                if following not in done:
                    on_way.add(following)
                    walk.append((following, iter(after[following])))
    return list(result)


def _layers(vertices: Sequence[Vertex], edges: Sequence[Edge]) -> dict[Vertex, int]:
    """The layer of each vertex: as many steps as the longest way to it; who begins a way stands close to its next."""
    before: dict[Vertex, list[Vertex]] = {v: [] for v in vertices}
    after: dict[Vertex, list[Vertex]] = {v: [] for v in vertices}
    for a, b in edges:
        before[b].append(a)
        after[a].append(b)
    layer = dict.fromkeys(vertices, 0)
    left = {v: len(before[v]) for v in vertices}
    ready = [v for v in vertices if not left[v]]
    for vertex in ready:
        for following in after[vertex]:
            layer[following] = max(layer[following], layer[vertex] + 1)
            left[following] -= 1
            if not left[following]:
                ready.append(following)
    for vertex in reversed(ready):
        if after[vertex] and not before[vertex]:
            layer[vertex] = min(layer[following] for following in after[vertex]) - 1
    return layer


def _chain(edge: Edge, layer_of: Mapping[Vertex, int]) -> list[Vertex]:
    """The edge's vertices with a bend in each layer between."""
    first, last = edge
    bends = [_Bend(edge, layer) for layer in range(layer_of[first] + 1, layer_of[last])]
    return [first, *bends, last]


def _rows(
    vertices: Sequence[Vertex], layer_of: Mapping[Vertex, int], chains: Iterable[list[Vertex]]
) -> list[list[Vertex]]:
    rows: list[list[Vertex]] = [[] for _ in range(max(layer_of.values(), default=-1) + 1)]
    for vertex in vertices:
        rows[layer_of[vertex]].append(vertex)
    for chain in chains:
        for bend in chain[1:-1]:
            assert isinstance(bend, _Bend)
            rows[bend.layer].append(bend)
    return rows


def _neighbours(
    chains: Iterable[list[Vertex]],
) -> tuple[dict[Vertex, list[Vertex]], dict[Vertex, list[Vertex]]]:
    """Who stands before and behind each vertex or bend, in the layers next to it."""
    before: dict[Vertex, list[Vertex]] = {}
    after: dict[Vertex, list[Vertex]] = {}
    for chain in chains:
        for a, b in pairwise(chain):
            after.setdefault(a, []).append(b)
            before.setdefault(b, []).append(a)
    return before, after


def _ordered(rows: list[list[Vertex]], chains: Iterable[list[Vertex]]) -> list[list[Vertex]]:
    """The rows in the best order that was found."""
    before, after = _neighbours(chains)
    best, least = [row[:] for row in rows], _crossings(rows, after)
    rows = [row[:] for row in rows]
    for sweep in range(SWEEPS):
        if least == 0:
            break
        down = sweep % 2 == 0
        near, step = (before, -1) if down else (after, 1)
        numbers = range(1, len(rows)) if down else range(len(rows) - 2, -1, -1)
        for number in numbers:
            rows[number] = _by_middle(rows[number], rows[number + step], near)
        crossings = _crossings(rows, after)
        if crossings < least:
            best, least = [row[:] for row in rows], crossings
    return best


def _by_middle(
    row: Sequence[Vertex], beside: Sequence[Vertex], near: Mapping[Vertex, list[Vertex]]
) -> list[Vertex]:
    """A row in the order of the middles of its neighbours; who has none keeps its place."""
    place = {v: at for at, v in enumerate(beside)}
    middles = []
    for own, vertex in enumerate(row):
        places = [place[n] for n in near.get(vertex, ())]
        middles.append((sum(places) / len(places) if places else float(own), own))
    return [row[own] for _, own in sorted(middles)]


def _crossings(rows: Sequence[Sequence[Vertex]], after: Mapping[Vertex, list[Vertex]]) -> int:
    """Pairs of edges that cross, between all neighbouring layers."""
    count = 0
    for row, following in pairwise(rows):
        place = {v: at for at, v in enumerate(following)}
        seen: list[int] = []
        for vertex in row:
            ends = [place[n] for n in after.get(vertex, ())]
            count += sum(len(seen) - bisect_right(seen, end) for end in ends)
            for end in ends:
                insort(seen, end)
    return count


def _positions(
    rows: Sequence[Sequence[Vertex]], chains: Iterable[list[Vertex]], heights: Mapping[Vertex, float]
) -> dict[Vertex, float]:
    """Places inside the layers: near the middle of the neighbours, in the order of the row, with gaps between."""
    before, after = _neighbours(chains)
    place: dict[Vertex, float] = {}
    for row in rows:
        at = 0.0
        for vertex in row:
            place[vertex] = at + heights[vertex] / 2
            at += heights[vertex] + VERTEX_GAP
    for pull in range(PULLS):
        order = rows if pull % 2 == 0 else list(reversed(rows))
        for row in order:
            wanted = []
            for vertex in row:
                near = [place[n] for n in (*before.get(vertex, ()), *after.get(vertex, ()))]
                wanted.append(sum(near) / len(near) if near else place[vertex])
            for vertex, at in zip(row, _apart(row, wanted, heights), strict=True):
                place[vertex] = at
    top = min((at - heights[v] / 2 for v, at in place.items()), default=0.0)
    return {v: at - top for v, at in place.items()}


def _apart(row: Sequence[Vertex], wanted: Sequence[float], heights: Mapping[Vertex, float]) -> list[float]:
    """Places as near to the wanted ones as the gaps allow (isotonic regression, pooling those that would overlap)."""
    offsets = [0.0]
    for above, below in pairwise(row):
        offsets.append(offsets[-1] + heights[above] / 2 + VERTEX_GAP + heights[below] / 2)
    pools: list[tuple[float, int]] = []  # sum of the places, without their offsets, and how many
    for want, offset in zip(wanted, offsets, strict=True):
        total, number = want - offset, 1
        while pools and pools[-1][0] / pools[-1][1] > total / number:
            total, number = total + pools[-1][0], number + pools[-1][1]
            pools.pop()
        pools.append((total, number))
    bases = [total / number for total, number in pools for _ in range(number)]
    return [base + offset for base, offset in zip(bases, offsets, strict=True)]


def _columns(rows: Sequence[Sequence[Vertex]], sizes: Mapping[Vertex, Point]) -> list[float]:
    """The middle of each layer."""
    columns, at = [], 0.0
    for row in rows:
        width = max((sizes[v][0] for v in row if v in sizes), default=0.0)
        columns.append(at + width / 2)
        at += width + LAYER_GAP
    return columns
