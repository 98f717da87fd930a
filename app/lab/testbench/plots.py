"""The bench as one page of small plots, plain SVG that needs nothing else to be shown."""

from collections.abc import Callable, Sequence
from html import escape

from app.lab.testbench.tables import FEWEST_FOUND, MOST_ACCUSED, Group, Row, factors

_COLUMNS, _WIDTH, _HEIGHT = 2, 470, 250
_LEFT, _RIGHT, _TOP, _BOTTOM = 46, 12, 30, 66
_STICKY, _HEALTHY, _QUIET, _INK = "#b3541e", "#22668d", "#9aa3a8", "#22282c"
_HEAD = 58


def page(table: Sequence[Row]) -> str:
    """A plot for each factor with more than one level: share called stiction, and wrong though called reliable."""
    names = [name for name in factors(table) if sum(row.factor == name for row in table) > 2]
    lines = -(-len(names) // _COLUMNS)
    width, height = _COLUMNS * _WIDTH, _HEAD + lines * _HEIGHT
    panels = [_panel(k, name, [r for r in table if r.factor == name]) for k, name in enumerate(names)]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        f'font-family="system-ui, sans-serif" font-size="11" fill="{_INK}">'
        f'<rect width="{width}" height="{height}" fill="#ffffff"/>{_legend()}{"".join(panels)}</svg>\n'
    )


def _legend() -> str:
    entries = (
        (_STICKY, "", "sticky valves called stiction"),
        (_HEALTHY, "", "healthy valves called stiction"),
        (_STICKY, "4 3", "sticky: wrong though called reliable"),
        (_HEALTHY, "4 3", "healthy: wrong though called reliable"),
    )
    parts = []
    for k, (colour, dash, text) in enumerate(entries):
        x, y = 20 + 240 * (k % 2), 20 + 18 * (k // 2)
        parts.append(f'<path d="M{x} {y} h26" stroke="{colour}" stroke-width="2.5" stroke-dasharray="{dash}"/>')
        parts.append(f'<text x="{x + 34}" y="{y + 4}">{text}</text>')
    return "".join(parts)


def _panel(k: int, name: str, table: Sequence[Row]) -> str:
    x, y = (k % _COLUMNS) * _WIDTH, _HEAD + (k // _COLUMNS) * _HEIGHT
    curves = (
        _curve(table, _STICKY, "", lambda row: (row.sticky, row.sticky.called)),
        _curve(table, _HEALTHY, "", lambda row: (row.healthy, row.healthy.called)),
        _curve(table, _STICKY, "4 3", lambda row: (row.sticky, row.sticky.wrong_reliable)),
        _curve(table, _HEALTHY, "4 3", lambda row: (row.healthy, row.healthy.wrong_reliable)),
    )
    title = f'<text x="{_LEFT}" y="18" font-size="13" font-weight="600">{escape(name)}</text>'
    return f'<g transform="translate({x} {y})">{title}{_frame(table)}{"".join(curves)}</g>'


def _frame(table: Sequence[Row]) -> str:
    right = _WIDTH - _RIGHT
    parts = []
    for share in (0.0, 0.5, 1.0):
        parts.append(f'<path d="M{_LEFT} {_up(share):.1f} H{right}" stroke="{_QUIET}" stroke-width="0.5"/>')
        parts.append(f'<text x="{_LEFT - 6}" y="{_up(share) + 4:.1f}" text-anchor="end">{100 * share:.0f} %</text>')
    for share, colour in ((FEWEST_FOUND, _STICKY), (MOST_ACCUSED, _HEALTHY)):
        parts.append(f'<path d="M{_LEFT} {_up(share):.1f} H{right}" stroke="{colour}" stroke-width="0.5"/>')
    for i, row in enumerate(table):
        at = f"{_along(i, len(table)):.1f} {_HEIGHT - _BOTTOM + 14}"
        x, y = at.split()
        parts.append(f'<text x="{x}" y="{y}" text-anchor="end" transform="rotate(-32 {at})">{escape(row.level)}</text>')
    return "".join(parts)


def _curve(table: Sequence[Row], colour: str, dash: str, pick: Callable[[Row], tuple[Group, float | None]]) -> str:
    points = []
    for i, row in enumerate(table):
        found, share = pick(row)
        if share is not None and found.loops:
            points.append((_along(i, len(table)), _up(share)))
    if not points:
        return ""
    line = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    dots = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.6" fill="{colour}"/>' for x, y in points)
    stroke = f'stroke="{colour}" stroke-width="1.8" stroke-dasharray="{dash}"'
    return f'<polyline points="{line}" fill="none" {stroke}/>{dots}'


def _along(i: int, count: int) -> float:
    return _LEFT + 14 + i * (_WIDTH - _LEFT - _RIGHT - 28) / max(count - 1, 1)


def _up(share: float) -> float:
    return _HEIGHT - _BOTTOM - share * (_HEIGHT - _BOTTOM - _TOP)
