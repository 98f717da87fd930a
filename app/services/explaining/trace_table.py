"""The table of `loopaudit explain --trace`: PV, the simulations and what they leave, a row a sample; and what is stored
of it, from which it is made again.
"""

from collections.abc import Sequence
from math import isfinite

import numpy as np

from app.engine.mismatch import Explanation
from app.engine.recording import FloatArray
from app.nanoseconds import NS_PER_S
from app.storage.samples import Samples

RESIDUAL = "residual_"


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
        f"{RESIDUAL}given",
        f"{RESIDUAL}refitted",
        f"{RESIDUAL}explained",
    ]
    return header, np.stack(columns, axis=1)


def stored_columns(explanation: Explanation) -> tuple[list[str], dict[str, FloatArray]]:
    """Header, and the columns (N,) by name from which `column` makes all: times stand beside, residuals are
    differences.
    """
    header, rows = trace_rows(explanation)
    return header, {name: rows[:, k] for k, name in enumerate(header) if name != "time" and not _is_residual(name)}


def column(signals: Samples, name: str) -> FloatArray:
    """A column of the table, (N,): the time in s, a signal, or PV less a simulation."""
    if name == "time":
        return signals.time_ns / NS_PER_S
    if _is_residual(name):
        return signals.signals["PV"] - signals.signals["PV_" + name.removeprefix(RESIDUAL)]
    return signals.signals[name]


def _is_residual(name: str) -> bool:
    return name.startswith(RESIDUAL)


def as_csv(header: Sequence[str], rows: FloatArray) -> str:
    """As text, eight digits a number; a cell stays empty where there is none, as where no simulation was given."""
    lines = (",".join(f"{value:.8g}" if isfinite(value) else "" for value in row) for row in rows.tolist())
    return "\n".join((",".join(header), *lines, ""))
