"""Charts of a report: small SVG of our own, so that a report is one file, prints well and runs no script."""

from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup, escape

from app.services.axes import Plane, ticks

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


def chart(
    x: Sequence[float],
    lines: Sequence[Line],
    ends: Ends,
    *,
    title: str,
    shaded: tuple[float, float] | None = None,
    limits: tuple[float, float] | None = None,
    width: int = WIDTH,
    height: int = HEIGHT,
) -> Markup:
    """Lines over x. shaded: from, to, in units of x; limits: of y, the least and the greatest that is drawn; width,
    height: in px."""
    known = [value for line in lines for value in line.values if value is not None]
    if not known:
        return Markup('<p class="weak">{}: nothing to show.</p>').format(title)
    size = (width - LEFT - RIGHT, height - TOP - BOTTOM)
    plane = Plane(LEFT, TOP, *size, (ends.low, ends.high), limits or _limits(known))
    body = [_frame(plane, ends)]
    if shaded is not None:
        start, end = (plane.x(min(max(at, ends.low), ends.high)) for at in shaded)
        body.append(
            f'<rect x="{start:.1f}" y="{plane.top}" width="{end - start:.1f}" height="{plane.tall}" fill="#0b5394" '
            'opacity="0.07"/>'
        )
    body += [_path(plane, x, line) for line in lines]
    body.append(_legend(lines))
    head = f'<svg viewBox="0 0 {width} {height}" width="{width}" role="img" aria-label="{escape(title)}">'
    return Markup(f"{head}{''.join(body)}</svg>")  # noqa: S704 - every text in it is escaped


def _limits(values: Sequence[float]) -> tuple[float, float]:
    low, high = min(values), max(values)
    margin = 0.05 * (high - low) or abs(high) * 0.05 or 1.0
    return low - margin, high + margin


def _path(plane: Plane, x: Sequence[float], line: Line) -> str:
    parts, pen_down = [], False
    for at, value in zip(x, line.values, strict=True):
        if value is not None:
            parts.append(f"{'L' if pen_down else 'M'}{plane.x(at):.1f} {plane.y(value):.1f}")
        pen_down = value is not None
    drawn = f'<path d="{"".join(parts)}" fill="none" stroke="{line.colour}" stroke-width="1.2"/>'
    if not line.dots:
        return drawn
    dots = (
        f'<circle cx="{plane.x(at):.1f}" cy="{plane.y(value):.1f}" r="2.5" fill="{line.colour}"/>'
        for at, value in zip(x, line.values, strict=True)
        if value is not None
    )
    return drawn + "".join(dots)


def _frame(plane: Plane, ends: Ends) -> str:
    left, right, bottom = plane.left, plane.right, plane.bottom
    box = f'<rect x="{left}" y="{plane.top}" width="{plane.wide}" height="{plane.tall}" fill="none" stroke="#8794a3"/>'
    said = [box]
    for value in ticks(*plane.y_span):
        y = plane.y(value)
        said.append(f'<line x1="{left}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}" stroke="#dde3ea"/>')
        said.append(_text(left - 6, y + 4, f"{value:.6g}", "end"))
    said += [_text(left, bottom + 15, ends.left, "start"), _text(right, bottom + 15, ends.right, "end")]
    return "".join([*said, _text((left + right) / 2, bottom + 15, ends.label, "middle")])


def _legend(lines: Sequence[Line]) -> str:
    said, x = [], LEFT
    for line in lines:
        said.append(f'<line x1="{x}" x2="{x + 18}" y1="10" y2="10" stroke="{line.colour}" stroke-width="3"/>')
        said.append(_text(x + 24, 14, line.name, "start"))
        x += 44 + 7 * len(line.name)
    return "".join(said)


def _text(x: float, y: float, words: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>' if words else ""
