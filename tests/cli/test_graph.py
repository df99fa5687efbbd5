"""`muros graph`: text, DOT and SVG of one scene; and the layout, on graphs that hypothesis makes."""

import itertools
import re
from collections.abc import Awaitable, Callable
from pathlib import Path
from xml.etree import ElementTree

from hypothesis import given
from hypothesis import strategies as st

from muros.cli._layout import VERTEX_GAP, lay_out
from muros.cli._names import service_of
from tests.cli.scene import Scene, play

ADD = "example_interfaces/srv/AddTwoInts"
INT = "std_msgs/msg/Int32"


def greenhouse(check: Callable[[Scene], Awaitable[None]]) -> None:
    async def scenario(scene: Scene) -> None:
        scene.writer("/house/thermometer", "/house/temperature", INT, "sensor_data")
        scene.reader("/fan", "/house/temperature", INT, "sensor_data")
        scene.reader("/logger", "/house/temperature", INT)
        scene.server("/adder", "/add", ADD, lambda request: request)
        scene.node("/fan").requester(service_of("/add", ADD))
        scene.writer("/fan", "/rosout", "rcl_interfaces/msg/Log")
        scene.node("/_hidden")
        scene.node("/idle")
        await check(scene)

    play(scenario)


def test_text() -> None:
    async def check(scene: Scene) -> None:
        assert (await scene.muros("graph")).out == (
            """\
domain 0: 5 nodes, 1 topic, 1 service

/adder
  serves  /add  example_interfaces/srv/AddTwoInts  <- /fan

/fan
  reads   /house/temperature  std_msgs/msg/Int32                 <- /house/thermometer
  asks    /add                example_interfaces/srv/AddTwoInts  -> /adder

/house/thermometer
  writes  /house/temperature  std_msgs/msg/Int32  -> /fan, /logger (no match)

/idle
  (nothing)

/logger
  reads   /house/temperature  std_msgs/msg/Int32  <- /house/thermometer (no match)

no match on /house/temperature: /house/thermometer -> /logger: the reader wants reliable, the writer offers best effort
"""
        )
        everything = (await scene.muros("graph --all")).out
        assert "/_hidden" in everything
        assert "/rosout" in everything

    greenhouse(check)


def test_dot() -> None:
    async def check(scene: Scene) -> None:
        dot = (await scene.muros("graph --dot")).out
        assert dot.startswith("digraph muros {\n")
        assert '"node /house/thermometer" -> "topic /house/temperature" [tooltip=' in dot
        assert '"topic /house/temperature" -> "node /logger" ' in dot
        assert "style=dashed, color=red" in dot
        assert '"node /fan" -> "service /add"' in dot
        assert '"service /add" -> "node /adder"' in dot
        assert dot.count("{") == dot.count("}")

    greenhouse(check)


def test_svg(tmp_path: Path) -> None:
    async def check(scene: Scene) -> None:
        file = tmp_path / "graph.svg"
        done = await scene.muros(f"graph -o {file}")
        assert done == ("", "", "", 0)
        root = ElementTree.fromstring(file.read_text())
        space = "{http://www.w3.org/2000/svg}"
        labels = {text.text for text in root.iter(f"{space}text")}
        assert labels == {
            "/house/thermometer",
            "/house/temperature",
            "/fan",
            "/logger",
            "/adder",
            "/add",
            "/idle",
        }
        lines = [path for path in root.iter(f"{space}path") if path.get("marker-end")]
        assert len(lines) == 5
        (broken,) = [path for path in lines if path.get("class") == "misfit"]
        title = broken.find(f"{space}title")
        assert title is not None
        assert str(title.text).startswith("/house/thermometer does not reach /logger: ")
        for title in root.iter(f"{space}title"):
            assert title.text
        done = await scene.muros(f"graph -o {tmp_path / 'no' / 'graph.svg'}")
        assert done.error.endswith("graph.svg: No such file or directory")

    greenhouse(check)


def test_an_empty_graph_is_a_picture_too() -> None:
    async def scenario(scene: Scene) -> None:
        ElementTree.fromstring((await scene.muros("graph --svg")).out)
        assert (await scene.muros("graph")).out == "domain 0: 0 nodes, 0 topics, 0 services\n"

    play(scenario)


def test_a_chain_goes_from_left_to_right_in_one_line() -> None:
    layout = lay_out(dict.fromkeys("abcd", (20.0, 10.0)), [("a", "b"), ("b", "c"), ("c", "d")])
    places = [layout.centres[name] for name in "abcd"]
    assert [x for x, _ in places] == sorted(x for x, _ in places)
    assert len({y for _, y in places}) == 1


def test_edges_that_need_not_cross_do_not() -> None:
    layout = lay_out(dict.fromkeys("abcxyz", (20.0, 10.0)), [("a", "z"), ("b", "y"), ("c", "x")])
    order = sorted("abc", key=lambda n: layout.centres[n][1])
    there = sorted("xyz", key=lambda n: layout.centres[n][1])
    assert [{"a": "z", "b": "y", "c": "x"}[n] for n in order] == there


def test_a_circle_is_drawn_with_every_edge_in_its_direction() -> None:
    edges = [("a", "b"), ("b", "a")]
    layout = lay_out({"a": (20.0, 10.0), "b": (30.0, 10.0)}, edges)
    for a, b in edges:
        assert layout.routes[a, b][0] == layout.centres[a]
        assert layout.routes[a, b][-1] == layout.centres[b]


vertices = st.integers(0, 9)


@given(st.lists(st.tuples(vertices, vertices), max_size=30), st.integers(0, 10))
def test_any_graph(edges: list[tuple[int, int]], count: int) -> None:
    sizes = {v: (20.0 + v, 10.0 + v) for v in range(count)}
    layout = lay_out(sizes, edges)
    assert set(layout.centres) == set(sizes)
    wanted = {(a, b) for a, b in edges if a != b and a < count and b < count}
    assert set(layout.routes) == wanted
    for (a, b), points in layout.routes.items():
        assert points[0] == layout.centres[a]
        assert points[-1] == layout.centres[b]
        steps = [x1 - x0 for (x0, _), (x1, _) in itertools.pairwise(points)]
        assert all(step > 0 for step in steps) or all(step < 0 for step in steps)
    for v, (x, y) in layout.centres.items():
        assert y - sizes[v][1] / 2 + 1e-6 >= 0
        assert y + sizes[v][1] / 2 <= layout.height + 1e-6
        assert x + sizes[v][0] / 2 <= layout.width + 1e-6
        for other, (ox, oy) in layout.centres.items():
            if other != v and abs(ox - x) < 1e-6:
                assert abs(oy - y) >= (sizes[v][1] + sizes[other][1]) / 2 + VERTEX_GAP - 1e-6
    assert lay_out(sizes, edges) == layout


def test_names_from_others_cannot_break_the_picture() -> None:
    async def scenario(scene: Scene) -> None:
        scene.space.participant('a"b<&>\x07', namespace="/")
        svg = (await scene.muros("graph --svg")).out
        ElementTree.fromstring(svg)
        assert re.search(r'label="/a\\"b<&>', (await scene.muros("graph --dot")).out)

    play(scenario)
