"""The plot of an explanation: recording, simulation and explained simulation, windows marked, residuals, in one HTML
file.
"""

from html import escape
from textwrap import wrap

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from app.engine.mismatch import Explanation
from app.engine.recording import FloatArray
from app.services.explaining.wording import VERDICT_WORDS

COLOURS = {"recording": "#222222", "given": "#b0b0b0", "refitted": "#d98200", "explained": "#0b6fb8"}

HEIGHT, LINE = 940, 22  # px: without the title; a line of text
ROOM_ABOVE, ROOM_BELOW = 6 * LINE, 70  # px; above the first plot its title and the names of its lines, two rows each
LONGEST_LINE = 42  # letters; as many as a telephone shows

# What a plant recorded is not offered to the cloud of those who make the library.
CONFIG = {"displaylogo": False, "showSendToCloud": False, "plotlyServerURL": ""}


def as_many(op: FloatArray, count: int) -> FloatArray:
    """As many samples of OP (N,), equally apart, as the traces have."""
    return op[np.arange(count) * len(op) // count]


def explanation_html(explanation: Explanation, op: FloatArray) -> str:
    """A self-contained page. op: (N,) as recorded, the residual is drawn against it."""
    return str(figure_of(explanation, op).to_html(CONFIG, include_plotlyjs=True, full_html=True))


def figure_of(explanation: Explanation, op: FloatArray) -> go.Figure:
    """What the page shows. op: as in `explanation_html`."""
    figure = make_subplots(
        rows=3,
        cols=1,
        row_heights=[0.5, 0.25, 0.25],
        vertical_spacing=0.12,
        subplot_titles=(
            "PV: recording and simulations<br>shaded: where they differ",
            "Residual over time<br>framed: held out of the fit",
            "Residual against OP",
        ),
    )
    traces = explanation.traces
    op = as_many(op, len(traces.pv))
    lines = [
        ("recording", traces.pv),
        ("given", traces.given),
        ("refitted", traces.refitted),
        ("explained", traces.explained),
    ]
    for label, signal in lines:
        if signal is not None:
            figure.add_trace(
                go.Scattergl(x=traces.time_s, y=signal, name=label, line={"color": COLOURS[label], "width": 1.3}),
                row=1,
                col=1,
            )
    for label, signal in lines[2:]:
        if signal is not None:
            add_residual(figure, traces.time_s, op, traces.pv - signal, label)
    mark_windows(figure, explanation)
    named = ", ".join(e.code for e in explanation.effects) or VERDICT_WORDS[explanation.verdict]
    fit = explanation.fit
    gain = f"held-out RMSE {fit.refitted.rmse:.4g} refitted, {fit.explained.rmse:.4g} explained"
    told = [line for text in (f"{explanation.name}: {named}", gain) for line in wrap(text, LONGEST_LINE)]
    text, room = "<br>".join(escape(line, quote=False) for line in told), LINE * len(told)
    figure.update_layout(
        title={"text": text, "font": {"size": 14}, "y": 1, "yanchor": "top", "pad": {"t": LINE}},
        template="plotly_white",
        height=HEIGHT + room,
        legend={"orientation": "h", "y": 1 + 2.5 * LINE / (HEIGHT - ROOM_ABOVE - ROOM_BELOW), "yanchor": "bottom"},
        margin={"t": ROOM_ABOVE + room, "b": ROOM_BELOW, "l": 60, "r": 30},
    )
    figure.update_xaxes(title_text="time [s]", row=2, col=1)
    figure.update_xaxes(title_text="OP", row=3, col=1)
    return figure


def add_residual(figure: go.Figure, time_s: FloatArray, op: FloatArray, residual: FloatArray, label: str) -> None:
    line = {"color": COLOURS[label], "width": 1.0}
    figure.add_trace(
        go.Scattergl(x=time_s, y=residual, name=f"residual, {label}", line=line, showlegend=False), row=2, col=1
    )
    dots = {"color": COLOURS[label], "size": 3, "opacity": 0.5}
    figure.add_trace(go.Scattergl(x=op, y=residual, mode="markers", marker=dots, showlegend=False), row=3, col=1)


def mark_windows(figure: go.Figure, explanation: Explanation) -> None:
    """Located windows in blue, the held-out stretch framed."""
    for window in explanation.located.windows[:40]:
        figure.add_vrect(
            x0=window.start_s, x1=window.end_s, fillcolor="#0b6fb8", opacity=0.07, line_width=0, row=1, col=1
        )
    for window in explanation.fit.held_out:
        figure.add_vrect(
            x0=window.start_s,
            x1=window.end_s,
            line={"dash": "dot", "width": 1, "color": "#566372"},
            fillcolor="rgba(0, 0, 0, 0)",
            row=2,
            col=1,
        )
