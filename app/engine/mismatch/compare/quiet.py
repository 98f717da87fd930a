"""Stretches in which PV stands and its noise is gone: a transmitter that froze, beside the noise of what reads it."""

import numpy as np
from scipy.ndimage import uniform_filter1d

from app.engine.mismatch.loop import causing
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.recording import BoolArray, FloatArray
from app.engine.signals.runs import runs_of

_WINDOW = 15  # samples over which noise is looked at
_LEAST = 2 * _WINDOW
_QUIET = 0.35  # of the usual noise: over a window white noise itself hardly ever has less than half of it
_STEADY = 0.6  # of the median: elsewhere nine windows in ten have more, or PV's noise comes and goes anyway
_MOST_QUIET = 0.25  # of the record
_STANDS = 8.0  # standard deviations of what is left of the noise, which may be coloured
_TRAVELS = 5.0  # so much farther PV goes in as many samples elsewhere, mostly
_BEYOND = 0.02  # of the record: so much of PV lies above where it stands, and below, or that may be the end of a range


def quiet_stretches(record: Experiment) -> tuple[tuple[int, int], ...]:
    """First and last samples of the stretches in which PV stands but for a noise that is far less than its usual one;
    none where PV's noise is not steady elsewhere, or where these are no exception.

    Noise is told by second differences, of which a slow process makes little. Where OP moves a fast one they are moves
    of PV, which a valve that stays put takes away too: so noise has to be gone beside what OP and PV foretell as well.
    """
    noise = _local_noise(record)
    heard = np.isfinite(noise)
    usual = float(np.median(noise[heard])) if heard.any() else 0.0
    quiet = noise < _QUIET * usual
    if not quiet.any() or np.mean(quiet) > _MOST_QUIET or np.quantile(noise[heard & ~quiet], 0.1) < _STEADY * usual:
        return ()
    starts, ends = runs_of(quiet)
    cores = zip(starts.tolist(), (ends - 1).tolist(), strict=True)
    found = dict.fromkeys(_grown(record, first, last) for first, last in cores)
    stand = [(a, b) for a, b in found if b - a >= _LEAST and _stands(record, a, b)]
    most = _QUIET * _unforeseen(record, stand) if stand else 0.0
    return tuple((a, b) for a, b in stand if _noise_of(record.pv[a : b + 1]) < most)


def within_range(record: Experiment, first: int, last: int) -> bool:
    """Whether PV lies now and then above where it stands from `first` to `last`, and below: it rests at no limit."""
    level, reach = _level_and_reach(record.pv[first : last + 1])
    known_pv = record.pv[record.usable]
    return bool(min(np.mean(known_pv > level + reach), np.mean(known_pv < level - reach)) > _BEYOND)


def between_known(record: Experiment) -> BoolArray:
    """(N - 2,) whether a sample and both beside it are known, for second differences."""
    known = record.usable
    return known[:-2] & known[1:-1] & known[2:]


def _unforeseen(record: Experiment, stretches: list[tuple[int, int]]) -> float:
    """Standard deviation, by the median, of what OP's and PV's last samples leave of PV outside these stretches."""
    outside = record.usable.copy()
    for first, last in stretches:
        outside[first : last + 1] = False
    kept = causing.known(record.comparing(outside))
    columns = np.concatenate([causing.past(x)[:, : causing.LATEST] for x in (record.pv, record.op)], axis=1)
    return float(np.median(np.abs(causing.rest_of(record.pv[kept], columns[kept]))) / 0.6745)


def _local_noise(record: Experiment) -> FloatArray:
    """(N,) standard deviation of PV's noise around each sample; infinite where fewer samples are known."""
    around = uniform_filter1d(np.diff(record.pv, 2) ** 2, _WINDOW, mode="nearest")
    heard = uniform_filter1d(between_known(record).astype(np.float64), _WINDOW, mode="nearest") > 1.0 - 0.5 / _WINDOW
    return np.pad(np.where(heard, np.sqrt(np.maximum(around, 0.0) / 6.0), np.inf), 1, mode="edge")


def _grown(record: Experiment, first: int, last: int) -> tuple[int, int]:
    """The stretch with what stands at its ends where it stands; the windows at its ends hear what lies outside."""
    level, reach = _level_and_reach(record.pv[first : last + 1])
    there = record.usable & (np.abs(record.pv - level) <= reach)
    before, after = np.flatnonzero(~there[:first]), np.flatnonzero(~there[last + 1 :])
    return (int(before[-1]) + 1 if len(before) else 0, last + int(after[0]) if len(after) else record.samples - 1)


def _level_and_reach(pv: FloatArray) -> tuple[float, float]:
    return float(np.median(pv)), _STANDS * _noise_of(pv)


def _noise_of(pv: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.diff(pv, 2) ** 2) / 6.0)) if len(pv) > 2 else 0.0


def _stands(record: Experiment, first: int, last: int) -> bool:
    pv, samples = record.pv[first : last + 1], last - first + 1
    level, reach = _level_and_reach(pv)
    parts = [record.pv[a : a + samples] for a in range(0, record.samples - samples + 1, samples)]
    return bool(
        np.max(np.abs(pv - level)) <= reach and float(np.median([np.ptp(x) for x in parts])) > _TRAVELS * np.ptp(pv)
    )
