"""The plots of benchmarks are well-formed SVG in which every value has its place."""

import re
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench import _plots as plots

SVG = "{http://www.w3.org/2000/svg}"
WIDTH, HEIGHT = 720.0, 400.0


def parsed(text: str) -> ElementTree.Element:
    """The document."""
    return ElementTree.fromstring(text)


def texts(root: ElementTree.Element) -> list[str]:
    """All that is written in it."""
    return [element.text or "" for element in root.iter(SVG + "text")]


def places(root: ElementTree.Element) -> list[list[tuple[float, float]]]:
    """The points of its lines."""
    return [
        [(float(x), float(y)) for x, y in re.findall(r"([-\d.]+),([-\d.]+)", line.attrib["points"])]
        for line in root.iter(SVG + "polyline")
    ]


def test_lines_have_axes_names_and_places_in_order() -> None:
    series = {"high <1>": [(0.0, 0.0), (5.0, 20.0), (10.0, 10.0)], "low": [(0.0, 5.0), (10.0, 15.0)]}
    root = parsed(plots.lines("Round & round", "time in s", "ms", series))
    assert {"Round & round", "time in s", "ms", "high <1>", "low", "0", "10", "20"} <= set(texts(root))
    high, low = places(root)
    assert [x for x, _ in high] == sorted(x for x, _ in high)
    assert high[0][1] > high[2][1] > high[1][1], "larger values are higher up"
    assert low[0][0] == high[0][0]


def test_a_logarithmic_axis_has_powers_of_ten() -> None:
    root = parsed(plots.lines("t", "x", "y", {"a": [(0, 0.5), (1, 5.0), (2, 50.0), (3, 0.0)]}, log=True))
    assert {"0.1", "1", "10", "100"} <= set(texts(root))
    (line,) = places(root)
    assert len(line) == 3, "0 has no place"
    assert line[0][1] - line[1][1] == pytest.approx(line[1][1] - line[2][1], abs=0.2)


def test_bars_stand_in_groups_with_their_values() -> None:
    root = parsed(
        plots.bars("Sent", "%", ["high", "low"], {"ours": [99.0, 80.0], "theirs": [50.0, float("nan")]})
    )
    assert {"high", "low", "ours", "theirs", "99", "80", "50"} <= set(texts(root))
    drawn = [r for r in root.iter(SVG + "rect") if float(r.attrib.get("y", 0)) > 50]
    heights = sorted(float(r.attrib["height"]) for r in drawn)
    assert heights[2] / heights[0] == pytest.approx(99 / 50, rel=0.01)


def test_distributions_rise_to_all() -> None:
    root = parsed(plots.distribution("Jitter", "us", {"a": [3.0, 1.0, 2.0, 4.0]}))
    (line,) = places(root)
    assert [y for _, y in line] == sorted((y for _, y in line), reverse=True)
    assert line[-1][1] == 56.0, "100 percent is at the top"


@pytest.mark.parametrize(
    "text",
    [
        plots.lines("t", "x", "y", {"a": []}),
        plots.bars("t", "y", ["g"], {}),
        plots.distribution("t", "x", {}),
    ],
)
def test_nothing_to_draw_is_said(text: str) -> None:
    assert "no data" in texts(parsed(text))


def test_many_points_are_thinned_and_peaks_stay() -> None:
    points = [(float(i), 1.0) for i in range(100_000)]
    points[77_777] = (77_777.0, 9.0)
    root = parsed(plots.lines("t", "x", "y", {"a": points}))
    (line,) = places(root)
    assert len(line) <= 2000
    assert len([y for _, y in line if y == min(y for _, y in line)]) == 1


@given(st.lists(st.tuples(st.floats(), st.floats()), max_size=50), st.booleans())
def test_any_values_give_a_document_within_its_frame(points: list[tuple[float, float]], log: bool) -> None:
    for text in (
        plots.lines("t", "x", "y", {"a": points}, log=log),
        plots.bars("t", "y", [str(n) for n in range(len(points))], {"a": [y for _, y in points]}),
        plots.distribution("t", "x", {"a": [y for _, y in points]}, log=log),
    ):
        for line in places(parsed(text)):
            assert all(-1 <= x <= WIDTH + 1 and -1 <= y <= HEIGHT + 1 for x, y in line)
