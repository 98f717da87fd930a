"""The traces of a stored explanation: whole as CSV, thinned for a chart."""

from typing import Any

import numpy as np

from app.engine.signals.extremes import extremes
from app.services.audit_json.numbers import listed
from app.services.backend import Backend
from app.services.explaining.explanations import stored_answer
from app.services.explaining.line import FIGURES
from app.services.explaining.trace_table import as_csv, column
from app.services.moments import iso_utc, moment_of

SHOWN_WINDOWS = 200


def trace_csv(backend: Backend, tag: str, explanation_id: str) -> str:
    """What `loopaudit explain --trace` writes. Raises NotFoundError("not_explained") while there is no answer."""
    answer = stored_answer(backend, tag, explanation_id)
    assert answer.signals is not None  # noqa: S101 - an answer that is done has its traces
    header = answer.told["header"]
    return as_csv(header, np.stack([column(answer.signals, name) for name in header], axis=1))


def plot(backend: Backend, tag: str, explanation_id: str, points: int = 2000) -> dict[str, Any]:
    """Recording and simulations before and after, and the residuals against what triggers them."""
    answer = stored_answer(backend, tag, explanation_id)
    assert answer.signals is not None  # noqa: S101 - as above
    signals, line = answer.signals, answer.told["line"]
    n = len(signals)
    shown = [signals.signals[name] for name in ("PV", "PV_refitted", "PV_explained")]
    kept = np.arange(n) if n <= points else extremes(shown, n, points)
    given = signals.signals["PV_given"]
    some = np.arange(0, n, max(1, -(-n // points)))
    return {
        "start": iso_utc(moment_of(answer.told["start_ns"])),
        "time_s": listed(column(signals, "time")[kept], FIGURES),
        "recording": listed(shown[0][kept], FIGURES),
        "given": None if np.all(np.isnan(given)) else listed(given[kept], FIGURES),
        "refitted": listed(shown[1][kept], FIGURES),
        "explained": listed(shown[2][kept], FIGURES),
        "trigger_label": answer.told["trigger"],
        "trigger": listed(signals.signals["trigger"][some], FIGURES),
        "residual_before": listed(column(signals, "residual_refitted")[some], FIGURES),
        "residual_after": listed(column(signals, "residual_explained")[some], FIGURES),
        "windows": line["located"]["windows"][:SHOWN_WINDOWS],
        "held_out": line["fit"]["held_out"][:SHOWN_WINDOWS],
    }
