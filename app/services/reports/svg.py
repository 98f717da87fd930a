"""Charts of a report: small SVG of our own, so that a report is one file, prints well and runs no script."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

from markupsafe import Markup, escape

from app.services.axes import ticks

WIDTH, HEIGHT = 900, 220
LEFT, RIGHT, TOP, BOTTOM = 64, 14, 22, 34
Values = Sequence[float | None]


@dataclass(frozen=True)
class Line:
    """A line of a chart; None in its values breaks it. `dots`: its points are marked."""

    name: str
    values: Values
    colour: str
    dots: bool = False


@dataclass(frozen=True)
class Ends:
    """What the x axis spans, and what stands under its ends."""

    low: float
    high: float
    left: str
    right: str
    label: str = ""


def chart(x: Sequence[float], lines: Sequence[Line], ends: Ends, *, title: str, **more: object) -> Markup:
    """Lines over x. `more`: `shaded` (from, to) in units of x, `height` in px, `limits` (low, high) of y, `width`."""
    width, height = int(str(more.get("width", WIDTH))), int(str(more.get("height", HEIGHT)))
    known = [value for line in lines for value in line.values if value is not None]
    if not known:
        return Markup('<p class="weak">{}: nothing to show.</p>').format(title)
    low, high = cast("tuple[float, float] | None", more.get("limits")) or _limits(known)
    place = _Place(ends, low, high, width, height)
    body = [_frame(place, ends)]
    if more.get("shaded"):
        start, end = (min(max(at, ends.low), ends.high) for at in more["shaded"])  # type: ignore[attr-defined]
        body.append(
            f'<rect x="{place.x(start):.1f}" y="{TOP}" width="{place.x(end) - place.x(start):.1f}" '
            f'height="{height - TOP - BOTTOM}" fill="#0b5394" opacity="0.07"/>'
        )
    body += [_path(place, x, line) for line in lines]
    body.append(_legend(lines))
    head = f'<svg viewBox="0 0 {width} {height}" width="{width}" role="img" aria-label="{escape(title)}">'
    return Markup(f"{head}{''.join(body)}</svg>")  # noqa: S704 - every text in it is escaped


class _Place:
    def __init__(self, ends: Ends, low: float, high: float, width: int, height: int) -> None:
        self.low, self.high, self.width, self.height = low, high, width, height
        self._left, self._wide = ends.low, (ends.high - ends.low) or 1.0

    def x(self, value: float) -> float:
        return LEFT + (self.width - LEFT - RIGHT) * (value - self._left) / self._wide

    def y(self, value: float) -> float:
        return TOP + (self.height - TOP - BOTTOM) * (self.high - value) / ((self.high - self.low) or 1.0)


def _limits(values: Sequence[float]) -> tuple[float, float]:
    low, high = min(values), max(values)
    margin = 0.05 * (high - low) or abs(high) * 0.05 or 1.0
    return low - margin, high + margin


def _path(place: _Place, x: Sequence[float], line: Line) -> str:
    parts, pen_down = [], False
    for at, value in zip(x, line.values, strict=True):
        if value is not None:
            parts.append(f"{'L' if pen_down else 'M'}{place.x(at):.1f} {place.y(value):.1f}")
        pen_down = value is not None
    drawn = f'<path d="{"".join(parts)}" fill="none" stroke="{line.colour}" stroke-width="1.2"/>'
    if not line.dots:
        return drawn
    dots = (
        f'<circle cx="{place.x(at):.1f}" cy="{place.y(value):.1f}" r="2.5" fill="{line.colour}"/>'
        for at, value in zip(x, line.values, strict=True)
        if value is not None
    )
    return drawn + "".join(dots)


def _frame(place: _Place, ends: Ends) -> str:
    bottom, right = place.height - BOTTOM, place.width - RIGHT
    said = [f'<rect x="{LEFT}" y="{TOP}" width="{right - LEFT}" height="{bottom - TOP}" fill="none" stroke="#8794a3"/>']
    for value in ticks(place.low, place.high):
        y = place.y(value)
        said.append(f'<line x1="{LEFT}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}" stroke="#dde3ea"/>')
        said.append(_text(LEFT - 6, y + 4, f"{value:.6g}", "end"))
    said += [_text(LEFT, bottom + 15, ends.left, "start"), _text(right, bottom + 15, ends.right, "end")]
    return "".join([*said, _text((LEFT + right) / 2, bottom + 15, ends.label, "middle")])


def _legend(lines: Sequence[Line]) -> str:
    said, x = [], LEFT
    for line in lines:
        said.append(f'<line x1="{x}" x2="{x + 18}" y1="10" y2="10" stroke="{line.colour}" stroke-width="3"/>')
        said.append(_text(x + 24, 14, line.name, "start"))
        x += 44 + 7 * len(line.name)
    return "".join(said)


def _text(x: float, y: float, words: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>' if words else ""
