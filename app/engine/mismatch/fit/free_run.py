"""Fits judged by their free run, and made by it alone.

A linear loop of our own knows of no load, and the free run of the right physics stands off by it, farther than that of
a loop that hardly follows OP: what a load leaves is told apart from what a model does.
"""

import numpy as np
from scipy.ndimage import median_filter

from app.engine.mismatch.fit.fitting import STILL, Fit, descend, finish, noise_left, polish, quiet_noise, task_of
from app.engine.mismatch.fit.noise import NoiseModel, whiten
from app.engine.mismatch.loop.block import Context
from app.engine.mismatch.loop.chain import signal_after
from app.engine.mismatch.physics.valve_stiction import CODE as STICTION
from app.engine.recording import BoolArray, FloatArray

_SLOW_POLE, _SETTLED = 0.9, 0.85
_SLIPS = 0.15  # J / S. Measured: docs/PROOF.md
_LEAST_SWING = 8  # samples
CLEARLY = 0.5  # 0.58 is left behind a sound valve where a square load makes a swing with every step


def free_run_error(fit: Fit, swing: int | None = None) -> float:
    """Standard deviation of PV less its free run, in the unit of PV, over the samples that are compared; beside what a
    load does where the samples of a swing are given.

    An integrating process makes a random walk of any load, and a right free run stands far off by chance: there it is
    the deviation of what quiet noise leaves of it, which a walk is hardly seen in.
    """
    if swing is not None or not fit.given.integrating:
        return error_left(fit, swing)
    seen = fit.record.usable
    return float(np.std(whiten(fit.residual, seen, quiet_noise(fit.record, fit.given))[seen]))


def error_left(found: Fit, swing: int | None) -> float:
    """What the free run leaves of PV, also of an integrating process; beside a load where a swing is given: in the
    middle one of all swings then, because a load that steps is felt in some of them, and a wrong model in each.
    """
    left = left_by(found, swing)
    if swing is None:
        return float(np.std(left))
    swings = np.array_split(left, max(len(left) // swing, 1))
    return float(np.sqrt(np.median([np.mean(piece * piece) for piece in swings])))


def runs_nearer(one: Fit, other: Fit, swing: int | None, share: float = 1.0) -> bool:
    """Whether the free run of one fit leaves less than a share of what that of another does; beside a load in the
    middle one of all swings, and clearly there or over all of them too.
    """
    left, beside = free_run_error(one, swing), free_run_error(other, swing)
    if swing is None or left < CLEARLY * beside:
        return left < share * beside
    return left < share * beside and float(np.std(left_by(one, swing))) < share * float(np.std(left_by(other, swing)))


def left_by(found: Fit, swing: int | None) -> FloatArray:
    """What the free run leaves of PV at the samples that are compared, beside a load where a swing is given."""
    seen = found.record.usable
    return beside_load(found.residual, seen, swing)[seen]


def beside_load(left: FloatArray, seen: BoolArray, swing: int | None) -> FloatArray:
    """What a free run leaves of PV (N,) less its median over a swing of the stem about each sample, of those that are
    `seen` (N,): a median keeps the edges of a load that steps. All of it where no swing is given.
    """
    if swing is None or not np.any(seen):
        return left
    known = np.interp(np.arange(len(left)), np.flatnonzero(seen), left[seen])
    return left - median_filter(known, 2 * (swing // 2) + 1, mode="reflect")


def stem_swing(found: Fit) -> int | None:
    """Samples of a mean swing (two turns) of the stem behind which a linear loop of our own was found, where the stem
    slips: no load makes such edges, but one makes what a stem does that only lags behind OP. None otherwise: a loop
    that was found from OP has as much of the load as OP could take. None too where noise turns the stem every few
    samples: less their median over so few nothing tells two free runs apart.
    """
    stems = [part for part in found.parts if part.block.code == STICTION and part.values[1] >= _SLIPS]
    if not stems or not found.given.behind_stem:
        return None
    moves = np.diff(signal_after(found.record, found.plant, found.parts, stems[0]))
    ways = np.sign(moves[moves != 0.0])
    turns = int(np.count_nonzero(np.diff(ways)))
    swing = round(2.0 * found.record.samples / max(turns, 1))
    return swing if swing >= _LEAST_SWING else None


def settle(found: Fit) -> Fit:
    """The same model fitted by its free run alone, where the likelihood had taken what is left for slow noise.

    A process that the library describes only nearly leaves slow errors; a noise model that is nearly a random walk then
    hides the free run's error from the fit. Kept only where the free run is better by more than _SETTLED, and where
    every part that was what its code says still is.
    """
    if max(found.noise.poles) < _SLOW_POLE or not found.parts:
        return found
    other, swing = finish(task_of(found), white_fit(found), found.noise), stem_swing(found)
    better = error_left(other, swing) < _SETTLED * error_left(found, swing)
    return other if better and _sense_kept(found, other) else found


def _sense_kept(before: Fit, after: Fit) -> bool:
    """Whether each part whose values were what its code says still has such, in another fit of the same parts."""
    was, now = Context(before.record, before.plant), Context(after.record, after.plant)
    pairs = zip(before.parts, after.parts, strict=True)
    return all(new.makes_sense(now) or not old.makes_sense(was) for old, new in pairs)


def by_free_run(found: Fit) -> Fit:
    """The same model fitted by its free run alone, with the noise that it then leaves."""
    task = task_of(found)
    x = white_fit(found)
    return finish(task, x, noise_left(task, x))


def white_fit(found: Fit) -> FloatArray:
    """Coordinates of the same model where its free run is nearest to PV."""
    task, record = task_of(found), found.record
    # Of exact data nothing may be left.
    white = NoiseModel(deviation=max(float(np.std(found.residual[record.usable])), STILL * record.pv_span))
    return descend(task, polish(task, found.x, white), white, 30)
