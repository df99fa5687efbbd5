"""Small plots as SVG text, for the reports of benchmarks: lines, bars and distributions, without a plotting library.

    svg = lines("Round trips", "time in s", "RTT in ms", {"high": [(0.0, 1.2), ...], "low": [...]})

Each function returns a whole SVG document, drawn on white, of about 720 x 400. Colours can be told apart by those who
see few of them. Values that are no numbers, or beyond 1e12, are left out; a plot without any says "no data".
"""

import math
from collections.abc import Mapping, Sequence
from xml.sax.saxutils import escape

__all__ = ["bars", "distribution", "lines"]

Points = Sequence[tuple[float, float]]

_WIDTH, _HEIGHT = 720, 400
_LEFT, _RIGHT, _TOP, _BOTTOM = 72, 24, 56, 56
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#333333")
_MOST_POINTS = 2000
"""Points of one line; of more, the highest and lowest of each stretch are drawn."""
_LEAST, _MOST = 1e-12, 1e12
"""Values beyond have no place; smaller ones have none on a logarithmic axis."""


def lines(title: str, x: str, y: str, series: Mapping[str, Points], *, log: bool = False) -> str:
    """A line for each of ``series``, over axes named ``x`` and ``y``; ``log``: y is logarithmic, above 0 only."""
    kept = {
        name: _thin([(a, b) for a, b in points if _fits(a) and _fits(b, log)])
        for name, points in series.items()
    }
    plot = _Plot(title, x, y, list(kept))
    if not any(kept.values()):
        return plot.empty()
    xs = [a for points in kept.values() for a, _ in points]
    ys = [b for points in kept.values() for _, b in points]
    plot.scale_x(min(xs), max(xs))
    plot.scale_y(min(ys) if log else min(0.0, *ys), max(ys), log=log)
    for number, points in enumerate(kept.values()):
        plot.line(number, points)
    return plot.text()


def bars(title: str, y: str, groups: Sequence[str], series: Mapping[str, Sequence[float]]) -> str:
    """Bars in groups: ``series`` has for each name a value for each of ``groups``."""
    plot = _Plot(title, "", y, list(series))
    values = [value for row in series.values() for value in row if _fits(value)]
    if not values:
        return plot.empty()
    plot.scale_y(min(0.0, *values), max(0.0, *values), log=False)
    share = plot.width / len(groups)
    width = min(48.0, share * 0.8 / len(series))
    for place, group in enumerate(groups):
        middle = _LEFT + share * (place + 0.5)
        plot.label(middle, _HEIGHT - _BOTTOM + 18, group)
        for number, row in enumerate(series.values()):
            if _fits(row[place]):
                plot.bar(number, middle + (number - len(series) / 2) * width, width, row[place])
    return plot.text()


def distribution(title: str, x: str, samples: Mapping[str, Sequence[float]], *, log: bool = False) -> str:
    """How many percent of the samples are at most so large, a line for each of ``samples``.

    ``log``: x is logarithmic, and begins where one percent of the samples is behind.
    """
    kept = {name: sorted(v for v in values if _fits(v, log)) for name, values in samples.items()}
    plot = _Plot(title, x, "percent at most", list(kept))
    if not any(kept.values()):
        return plot.empty()
    every = [value for values in kept.values() for value in (values[len(values) // 100 :] if log else values)]
    plot.scale_x(min(every), max(every), log=log)
    plot.scale_y(0.0, 100.0, log=False)
    for number, values in enumerate(kept.values()):
        shares = [(v, 100.0 * (i + 1) / len(values)) for i, v in enumerate(values)]
        plot.line(number, _thin([point for point in shares if point[0] >= min(every)]))
    return plot.text()


class _Plot:
    """A document that grows: frame and legend first, then axes, then what is drawn."""

    width = _WIDTH - _LEFT - _RIGHT
    height = _HEIGHT - _TOP - _BOTTOM

    def __init__(self, title: str, x: str, y: str, names: Sequence[str]) -> None:
        self.parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" '
            f'height="{_HEIGHT}" font-family="sans-serif" font-size="12" fill="#333" text-anchor="middle">',
            f"<title>{escape(title)}</title>",
            f'<rect width="{_WIDTH}" height="{_HEIGHT}" fill="#fff"/>',
            f'<text x="{_LEFT}" y="22" font-size="15" font-weight="bold" text-anchor="start">{escape(title)}</text>',
            f'<text x="{_LEFT + self.width / 2}" y="{_HEIGHT - 14}">{escape(x)}</text>',
            f'<text x="16" y="{_TOP + self.height / 2}" '
            f'transform="rotate(-90 16 {_TOP + self.height / 2})">{escape(y)}</text>',
        ]
        self._x = self._y = (0.0, 1.0, False)
        at = float(_LEFT)
        for number, name in enumerate(names):
            self.parts.append(f'<rect x="{at:.0f}" y="33" width="12" height="12" fill="{_colour(number)}"/>')
            self.parts.append(f'<text x="{at + 17:.0f}" y="43" text-anchor="start">{escape(name)}</text>')
            at += 33 + 7 * len(name)

    def scale_x(self, low: float, high: float, *, log: bool = False) -> None:
        """The axis below, with its ticks."""
        self._x, ticks = _axis(low, high, log=log)
        if not log and high - low > 1e-9 * max(abs(low), abs(high), 1.0):
            self._x = low, high, False  # from the first value to the last
        for tick in ticks:
            at = self._at_x(tick)
            if not _LEFT - 1 <= at <= _WIDTH - _RIGHT + 1:
                continue
            self.parts.append(_stroke(at, _TOP, at, _HEIGHT - _BOTTOM))
            self.label(at, _HEIGHT - _BOTTOM + 18, _number(tick))

    def scale_y(self, low: float, high: float, *, log: bool) -> None:
        """The axis on the left."""
        self._y, ticks = _axis(low, high, log=log)
        for tick in ticks:
            at = self._at_y(tick)
            self.parts.append(_stroke(_LEFT, at, _WIDTH - _RIGHT, at))
            self.parts.append(
                f'<text x="{_LEFT - 8}" y="{at + 4:.1f}" text-anchor="end">{_number(tick)}</text>'
            )

    def line(self, number: int, points: Points) -> None:
        """A line through points; a single one is a dot."""
        colour = _colour(number)
        if len(points) == 1:
            x, y = points[0]
            self.parts.append(
                f'<circle cx="{self._at_x(x):.1f}" cy="{self._at_y(y):.1f}" r="3" fill="{colour}"/>'
            )
        elif points:
            path = " ".join(f"{self._at_x(x):.1f},{self._at_y(y):.1f}" for x, y in points)
            self.parts.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.5"/>')

    def bar(self, number: int, left: float, width: float, value: float) -> None:
        """A bar from 0 to ``value``, which stands above it."""
        top, foot = sorted((self._at_y(value), self._at_y(0.0)))
        self.parts.append(
            f'<rect x="{left:.1f}" y="{top:.1f}" width="{width - 1:.1f}" height="{max(foot - top, 0.5):.1f}" '
            f'fill="{_colour(number)}"/>'
        )
        self.label(left + width / 2, top - 4, _number(value, 3))

    def label(self, x: float, y: float, text: str) -> None:
        """A text around a place."""
        self.parts.append(f'<text x="{x:.1f}" y="{y:.1f}" font-size="11">{escape(text)}</text>')

    def empty(self) -> str:
        """The document of a plot without anything in it."""
        self.label(_WIDTH / 2, _HEIGHT / 2, "no data")
        return self.text()

    def text(self) -> str:
        """The document."""
        return "\n".join([*self.parts, "</svg>"]) + "\n"

    def _at_x(self, value: float) -> float:
        return _LEFT + self.width * _share(value, self._x)

    def _at_y(self, value: float) -> float:
        return _HEIGHT - _BOTTOM - self.height * _share(value, self._y)


def _axis(low: float, high: float, *, log: bool) -> tuple[tuple[float, float, bool], list[float]]:
    """An axis that reaches from ``low`` to ``high`` at least, and its ticks: round numbers, or powers of ten."""
    if log:
        first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
        last = max(last, first + 1)
        return (float(first), float(last), True), [10.0**n for n in range(first, last + 1)]
    if high - low < max(1e-9 * max(abs(low), abs(high)), _LEAST):
        high = low + (abs(low) if abs(low) > _LEAST else 1.0)
    rough = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in (1, 2, 5, 10) if power * factor >= rough * 0.999)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return (first * step, last * step, False), [n * step for n in range(first, last + 1)]


def _fits(value: float, log: bool = False) -> bool:
    """Whether a value has a place."""
    return abs(value) <= _MOST and (not log or value >= _LEAST)


def _share(value: float, axis: tuple[float, float, bool]) -> float:
    low, high, log = axis
    return ((math.log10(value) if log else value) - low) / (high - low)


def _thin(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Fewer points with the same look."""
    size = -(-2 * len(points) // _MOST_POINTS)
    if size <= 2:
        return points
    kept = []
    for start in range(0, len(points), size):
        part = points[start : start + size]
        kept += sorted({min(part, key=lambda p: p[1]), max(part, key=lambda p: p[1])})
    return kept


def _number(value: float, digits: int = 4) -> str:
    """A number with as many digits as a plot needs."""
    return f"{value:.0f}" if 10**digits / 10 <= abs(value) < 1e7 else f"{value + 0.0:.{digits}g}"


def _colour(number: int) -> str:
    return _COLOURS[number % len(_COLOURS)]


def _stroke(x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="#ddd"/>'
