"""The table of `loopaudit explain --trace`: PV, the simulations and what they leave, a row a sample."""

from collections.abc import Sequence
from math import isfinite

import numpy as np

from app.engine.mismatch import Explanation
from app.engine.recording import FloatArray


def trace_rows(explanation: Explanation) -> tuple[list[str], FloatArray]:
    """Header and (N, columns) of `--trace`: time, PV, the three simulations and their residuals."""
    t = explanation.traces
    missing = np.full(len(t.pv), np.nan)
    given = missing if t.given is None else t.given
    columns = [t.time_s, t.pv, given, t.refitted, t.explained, t.pv - given, t.pv - t.refitted, t.pv - t.explained]
    header = [
        "time",
        "PV",
        "PV_given",
        "PV_refitted",
        "PV_explained",
        "residual_given",
        "residual_refitted",
        "residual_explained",
    ]
    return header, np.stack(columns, axis=1)


def as_csv(header: Sequence[str], rows: FloatArray) -> str:
    """As text, eight digits a number; a cell stays empty where there is none, as where no simulation was given."""
    lines = (",".join(f"{value:.8g}" if isfinite(value) else "" for value in row) for row in rows.tolist())
    return "\n".join((",".join(header), *lines, ""))
