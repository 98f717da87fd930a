"""Published detection methods, one small module each: they corroborate the verdict and do not make it."""

from app.engine.corroborate.area_ratio import area_ratio
from app.engine.corroborate.bicoherence import bicoherence
from app.engine.corroborate.corroboration import Corroboration
from app.engine.corroborate.he_curve import he_curve
from app.engine.corroborate.histogram import histogram
from app.engine.corroborate.horch_ccf import horch_ccf
from app.engine.corroborate.relay import relay
from app.engine.corroborate.still_pv import still_pv
from app.engine.features import Features, shape_windows
from app.engine.oscillation import Oscillation
from app.engine.recording import UniformRecord

__all__ = ["Corroboration", "corroborate"]


def corroborate(
    record: UniformRecord, oscillation: Oscillation, features: Features, integrating: bool | None = None
) -> tuple[Corroboration, ...]:
    """What every method says of one record; a method outside its assumptions says so.

    integrating: whether the process integrates, None where it is not known (taken as self-regulating then).
    """
    windows = shape_windows(record, oscillation, most=3)
    return (
        horch_ccf(features, oscillation, integrating),
        he_curve(features, oscillation, integrating),
        relay(windows, oscillation),
        area_ratio(windows, oscillation, integrating),
        bicoherence(features, len(windows)),
        histogram(windows, oscillation, integrating),
        still_pv(features, integrating),
    )
