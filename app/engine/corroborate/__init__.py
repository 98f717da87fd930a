"""Published detection methods, one small module each: they corroborate the verdict and do not make it.

The papers' texts were not at hand: definitions and thresholds are those by which the methods are commonly known, and
each module says what was left open and how it was filled. No figure of a paper has been reproduced with them.
"""

from collections.abc import Callable

from app.engine.corroborate.area_ratio import area_ratio
from app.engine.corroborate.bicoherence import bicoherence
from app.engine.corroborate.case import Case
from app.engine.corroborate.corroboration import Corroboration
from app.engine.corroborate.cross_correlation import cross_correlation
from app.engine.corroborate.curve_fitting import curve_fitting
from app.engine.corroborate.histogram import histogram
from app.engine.corroborate.movement_patterns import movement_patterns
from app.engine.corroborate.relay import relay
from app.engine.corroborate.shape_analysis import shape_analysis
from app.engine.corroborate.sigmoid import sigmoid
from app.engine.corroborate.slope_ratio import slope_ratio
from app.engine.features import ShapeWindow, shape_windows
from app.engine.oscillation import Oscillation
from app.engine.recording import UniformRecord

__all__ = ["METHODS", "Case", "Corroboration", "corroborate"]

METHODS: tuple[Callable[[Case], Corroboration], ...] = (
    cross_correlation,
    curve_fitting,
    relay,
    shape_analysis,
    area_ratio,
    histogram,
    movement_patterns,
    slope_ratio,
    sigmoid,
    bicoherence,
)


def corroborate(
    record: UniformRecord,
    oscillation: Oscillation,
    integrating: bool | None = None,
    windows: tuple[ShapeWindow, ...] | None = None,
) -> tuple[Corroboration, ...]:
    """What every method says of one loop, in the order of METHODS; a method outside its assumptions says so.

    oscillation: of this record. integrating: whether the process integrates; None where it is not known, in which case
    it is taken as self-regulating, and the texts say so. windows: the record's, where they are at hand. Nothing changes
    with the unit, offset or sign of PV or OP, nor with the time unit.
    """
    if windows is None:
        windows = tuple(shape_windows(record, oscillation))
    case = Case(record, oscillation, windows, integrating)
    return tuple(method(case) for method in METHODS)
