"""What every valve model asks of its inputs: one finite row of OP, bands that are not negative and of one length."""

import numpy as np

from app.engine.recording import FloatArray
from app.errors import DataError


def check_signal(op: FloatArray) -> None:
    """Raises DataError("op_not_a_signal") unless OP is one finite row with at least one sample."""
    if op.ndim != 1 or len(op) == 0 or not np.isfinite(op).all():
        raise DataError("op_not_a_signal", f"OP must be a row of finite samples, got shape {op.shape}; fill gaps first")


def check_bands(**bands: FloatArray) -> None:
    """Raises DataError("stiction_band") unless the bands are (M,) of one length, finite and not negative."""
    for name, band in bands.items():
        if not _are_bands(band):
            raise DataError("stiction_band", f"{name} must be a row of values that are not negative, got {band!r}")
    if len({len(band) for band in bands.values()}) > 1:
        lengths = ", ".join(f"{name}: {len(band)}" for name, band in bands.items())
        raise DataError("stiction_band", f"the bands of a grid must have one length, got {lengths}")


def _are_bands(band: FloatArray) -> bool:
    if band.shape == (1,):
        return 0.0 <= band.item() < np.inf  # of one valve, as a search asks for it thousands of times
    return band.ndim == 1 and bool(((band >= 0.0) & (band < np.inf)).all())


def first_positions(op: FloatArray, S: FloatArray, start: FloatArray | None) -> FloatArray:
    """Where the valve of each of the grid's points begins (M,); at u(0) where that is not told."""
    return np.full(len(S), float(op[0])) if start is None else np.ascontiguousarray(start, dtype=np.float64)
