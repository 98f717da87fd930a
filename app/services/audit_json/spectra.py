"""The spectra behind Yper, as they are stored and drawn."""

from functools import lru_cache
from typing import Any

import numpy as np

from app.engine.reference.yper import YperResult
from app.services.audit_json.numbers import short_together

STORED_FREQUENCIES = 256


def spectra(yper: YperResult) -> dict[str, Any]:
    """Of each group of neighbouring frequencies the highest line of PV, OP and the threshold."""
    groups = _groups(len(yper.frequency_hz))
    names = ("pv_amplitude", "op_amplitude", "threshold_amplitude")
    highest = {name: np.maximum.reduceat(getattr(yper, name), groups) for name in names}
    return {
        **short_together(frequency_hz=yper.frequency_hz[groups], **highest),
        "significant": np.logical_or.reduceat(yper.significant, groups).tolist(),
    }


@lru_cache(maxsize=16)
def _groups(count: int) -> np.ndarray:
    """Where each group of neighbouring frequencies starts: at most STORED_FREQUENCIES groups."""
    groups = np.unique(np.linspace(0, count, min(count, STORED_FREQUENCIES), endpoint=False).astype(int))
    groups.flags.writeable = False
    return groups
