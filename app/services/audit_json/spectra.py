"""The spectra behind Yper, as they are stored and drawn."""

from typing import Any

import numpy as np

from app.engine.reference.yper import YperResult
from app.services.audit_json.numbers import short

STORED_FREQUENCIES = 256


def spectra(yper: YperResult) -> dict[str, Any]:
    """Of each group of neighbouring frequencies the highest line of PV, OP and the threshold."""
    groups = _groups(len(yper.frequency_hz))
    amplitudes = (yper.pv_amplitude, yper.op_amplitude, yper.threshold_amplitude)
    pv, op, threshold = (short(np.maximum.reduceat(amplitude, groups)) for amplitude in amplitudes)
    return {
        "frequency_hz": short(yper.frequency_hz[groups]),
        "pv_amplitude": pv,
        "op_amplitude": op,
        "threshold_amplitude": threshold,
        "significant": np.logical_or.reduceat(yper.significant, groups).tolist(),
    }


def _groups(count: int) -> np.ndarray:
    """Where each group of neighbouring frequencies starts: at most STORED_FREQUENCIES groups."""
    return np.unique(np.linspace(0, count, min(count, STORED_FREQUENCIES), endpoint=False).astype(int))
