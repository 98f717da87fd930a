"""All features of a record, averaged over its windows."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import chain

import numpy as np

from app.engine.features.legs import Legs, legs
from app.engine.features.limits import Limits, limits
from app.engine.features.quadrature import Quadrature, quadrature
from app.engine.features.shape import Shape, shape
from app.engine.features.steady import at_rest
from app.engine.features.travel import Travel, travel
from app.engine.features.window import MOST_WINDOWS, PER_CYCLE, ShapeWindow, shape_windows
from app.engine.freerun import FreeRun, free_run
from app.engine.oscillation import Oscillation, detect
from app.engine.recording import FloatArray, UniformRecord

_GROUPS = (Quadrature, Travel, Shape, Limits, FreeRun, Legs)
_MOST_REGULAR = 6.0
_LEAST_REGULAR = 0.2

NAMES: tuple[str, ...] = (
    *(field.name for group in _GROUPS for field in fields(group)),
    "oscillation_strength",
    "oscillation_regularity",
)


@dataclass(frozen=True, eq=False)
class Features:
    """values: (F,) in the order of NAMES, averaged over the W windows; table: (W, F) window by window.

    weights: (W,) what each of them counts in `values`, 1 in all. overlap: whether two of them share samples. windows:
    those of the whole record.
    """

    values: FloatArray
    table: FloatArray
    weights: FloatArray
    overlap: bool
    windows: tuple[ShapeWindow, ...]

    def named(self, name: str) -> float:
        return float(self.values[NAMES.index(name)])


def extract(record: UniformRecord, oscillation: Oscillation, most_windows: int = MOST_WINDOWS) -> Features | None:
    """The features of a record, or None where PV or OP does not vary.

    No feature changes with the unit, offset or sign of PV or OP, with the time unit, or with the set point.
    """
    windows = tuple(shape_windows(record, oscillation, most_windows))
    if not windows:
        return None
    regularity = math.log(min(max(oscillation.regularity, _LEAST_REGULAR), _MOST_REGULAR))
    table = np.array([[*_row(window), oscillation.strength, regularity] for window in windows])
    if not np.isfinite(table).all():
        np.nan_to_num(table, copy=False)
    weights = np.full(len(windows), 1.0 / len(windows))
    overlap = sum(len(window.raw_pv) for window in windows) > record.samples
    return Features(table.mean(axis=0), table, weights, overlap, windows)


@dataclass(frozen=True, eq=False)
class Part:
    """What features are taken of, and the oscillation on whose scale they are."""

    record: UniformRecord
    oscillation: Oscillation


def parts_of(record: UniformRecord, oscillation: Oscillation) -> tuple[Part, ...]:
    """A record, and where PV mostly follows a stepping set point, the rest of that with its own oscillation.

    The set point's own movement says little about the valve, and at its rest there is often little movement: neither
    half is trusted alone.
    """
    whole, rest = Part(record, oscillation), at_rest(record)
    return (whole,) if rest is None else (whole, Part(rest, detect(rest)))


def observe(record: UniformRecord, oscillation: Oscillation) -> Features | None:
    """The features of a record, the mean over its parts."""
    return observe_parts(parts_of(record, oscillation))


def observe_parts(parts: Sequence[Part]) -> Features | None:
    """The mean of the features of parts, the first of them the whole record; None where PV or OP does not vary in that.

    Of another part in which neither varies nothing is asked.
    """
    features, *others = (extract(part.record, part.oscillation) for part in parts)
    if features is None:
        return None
    found = [features, *(other for other in others if other is not None)]
    if len(found) == 1:
        return features
    return Features(
        values=np.mean([one.values for one in found], axis=0),
        table=np.concatenate([one.table for one in found]),
        weights=np.concatenate([one.weights for one in found]) / len(found),
        overlap=any(one.overlap for one in found),
        windows=features.windows,
    )


def _row(window: ShapeWindow) -> Iterator[float]:
    """In the order of NAMES, but for the oscillation."""
    groups = (
        quadrature(window),
        travel(window),
        shape(window),
        limits(window),
        free_run(window.even_pv, window.even_op, PER_CYCLE),
        legs(window),
    )
    return chain.from_iterable(vars(group).values() for group in groups)
