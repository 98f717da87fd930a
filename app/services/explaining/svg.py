"""The plot of an explanation as a small picture for documents: a window of the record, its residuals, and the residual
against OP.
"""

import numpy as np

from app.engine.mismatch import Explanation
from app.engine.recording import FloatArray
from app.services.axes import Plane, ticks
from app.services.explaining.plot import COLOURS, as_many
from app.services.explaining.wording import VERDICT_WORDS

WIDTH, HEIGHT = 860, 450
LEFT, TOP, GAP = 62, 34, 52
DIFFERS, UNSEEN = "#e6b800", "#0b6fb8"
TICKS = 5
WIDE, SIDE = 540, 180
PANEL = 150
MOST_POINTS, MOST_DOTS = 700, 350


def explanation_svg(explanation: Explanation, op: FloatArray) -> str:
    """One SVG, its text as text. op: (N,) as recorded."""
    t = explanation.traces
    op = as_many(op, len(t.pv))
    given = [] if t.given is None else [("given", np.asarray(t.given))]
    lines = [("recording", t.pv), *given, ("refitted", t.refitted), ("explained", t.explained)]
    residuals = [(name, t.pv - signal) for name, signal in lines if name in ("refitted", "explained")]
    named = ", ".join(e.code for e in explanation.effects) or VERDICT_WORDS[explanation.verdict]
    fit = explanation.fit
    title = f"{explanation.name}: {named}; held-out RMSE {fit.refitted.rmse:.3g} refitted, {fit.explained.rmse:.3g}"
    body = [text(LEFT, 16, title + " explained", 13)]
    marks = [(w.start_s, w.end_s) for w in explanation.located.windows[:60]]
    body += panel((LEFT, TOP), (WIDE, PANEL), t.time_s, lines, "PV", marks, DIFFERS)
    held = [(w.start_s, w.end_s) for w in fit.held_out]
    body += panel(
        (LEFT, TOP + PANEL + GAP), (WIDE, PANEL), t.time_s, residuals, "residual, PV less simulation", held, UNSEEN
    )
    body += scatter((LEFT + WIDE + GAP, TOP + PANEL + GAP), (SIDE, PANEL), op, residuals)
    body += legend(LEFT + WIDE + GAP, TOP + 12, [name for name, _ in lines])
    body.append(text(LEFT + WIDE / 2, HEIGHT - 8, "time [s]", 11))
    body.append(text(LEFT + WIDE + GAP + 60, HEIGHT - 8, "residual against OP", 11))
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif">'
    return "\n".join([head, f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>', *body, "</svg>"]) + "\n"


def text(x: float, y: float, words: str, size: int) -> str:
    safe = words.replace("&", "&amp;").replace("<", "&lt;")
    return f'<text x="{x:.0f}" y="{y:.0f}" font-size="{size}" fill="#222">{safe}</text>'


def panel(
    at: tuple[float, float],
    size: tuple[float, float],
    time_s: FloatArray,
    lines: list[tuple[str, FloatArray]],
    label: str,
    marks: list[tuple[float, float]],
    colour: str,
) -> list[str]:
    """A frame with lines over time, its marked stretches shaded in a colour, and ticks at round numbers."""
    last = float(time_s[-1]) or 1.0
    plane = Plane(*at, *size, (0.0, last), limits([signal for _, signal in lines]))
    stride = max(len(time_s) // MOST_POINTS, 1)
    said = [
        f'<rect x="{plane.x(a):.1f}" y="{plane.top}" width="{size[0] * (min(b, last) - a) / last:.1f}" '
        f'height="{plane.tall}" fill="{colour}" opacity="0.16"/>'
        for a, b in marks
    ]
    said += frame(plane, label)
    for name, signal in lines:
        drawn = zip(time_s[::stride], np.clip(signal[::stride], *plane.y_span), strict=True)
        points = " ".join(f"{plane.x(float(t)):.1f},{plane.y(float(v)):.1f}" for t, v in drawn)
        said.append(f'<polyline fill="none" stroke="{COLOURS[name]}" stroke-width="1" points="{points}"/>')
    for tick in ticks(0.0, last, TICKS):
        x, bottom = plane.x(tick), plane.bottom
        said.append(f'<line x1="{x:.1f}" y1="{bottom}" x2="{x:.1f}" y2="{bottom + 4}" stroke="#999"/>')
        said.append(text(x - 8, bottom + 15, f"{tick:g}", 10))
    return said


def scatter(
    at: tuple[float, float], size: tuple[float, float], op: FloatArray, residuals: list[tuple[str, FloatArray]]
) -> list[str]:
    left, right = float(np.min(op)), float(np.max(op))
    plane = Plane(*at, *size, (left, right), limits([signal for _, signal in residuals]))
    said = frame(plane, "residual")
    stride = max(len(op) // MOST_DOTS, 1)
    for name, signal in residuals:
        for u, v in zip(op[::stride], np.clip(signal[::stride], *plane.y_span), strict=True):
            at_x, at_y = f"{plane.x(u):.1f}", f"{plane.y(v):.1f}"
            said.append(f'<circle cx="{at_x}" cy="{at_y}" r="1.2" fill="{COLOURS[name]}" opacity="0.5"/>')
    said.append(text(plane.left, plane.bottom + 13, f"{left:.4g}", 10))
    said.append(text(plane.right - 36, plane.bottom + 13, f"{right:.4g}", 10))
    return said


def frame(plane: Plane, label: str) -> list[str]:
    left, top = plane.left, plane.top
    box = f'<rect x="{left}" y="{top}" width="{plane.wide}" height="{plane.tall}" fill="none" stroke="#999"/>'
    marked = [(tick, plane.y(tick)) for tick in ticks(*plane.y_span, TICKS)]
    said = [text(left - 42, y + 3, f"{tick:g}", 10) for tick, y in marked]
    lines = [f'<line x1="{left}" y1="{y:.1f}" x2="{plane.right}" y2="{y:.1f}" stroke="#ddd"/>' for _, y in marked]
    return [*lines, box, *said, text(left + 4, top - 4, label, 11)]


def legend(x: float, y: float, names: list[str]) -> list[str]:
    said = []
    for k, name in enumerate(names):
        row = y + 18 * k
        said.append(f'<line x1="{x}" y1="{row}" x2="{x + 22}" y2="{row}" stroke="{COLOURS[name]}" stroke-width="2"/>')
        said.append(text(x + 28, row + 4, name, 11))
    for k, (words, colour) in enumerate((("where they differ", DIFFERS), ("held out of the fit", UNSEEN)), len(names)):
        row = y + 18 * k
        said.append(f'<rect x="{x}" y="{row - 6}" width="22" height="12" fill="{colour}" opacity="0.3"/>')
        said.append(text(x + 28, row + 4, words, 11))
    return said


def limits(signals: list[FloatArray]) -> tuple[float, float]:
    low = min(float(np.quantile(signal, 0.002)) for signal in signals)
    high = max(float(np.quantile(signal, 0.998)) for signal in signals)
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin
