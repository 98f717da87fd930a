"""A faulty sensor: it spikes, or it holds its value and jumps."""

import numpy as np
from numba import njit

from app.counting import counted
from app.engine.evidence import rising
from app.engine.fitness.signals import run_lengths
from app.engine.recording import BoolArray, FloatArray
from app.engine.rivals.rival import Rival, not_evaluated
from app.engine.rivals.scene import Scene
from app.engine.signals.sampled import medians_of_five

# Fixed beforehand, not fitted: nothing but the instrument holds PV to the last digit while OP moves.
_AGAINST_STICTION = 3.0
_FEWEST_SPIKES, _MOST_SPIKES_SHARE = 3, 0.05
_SPIKE_SIZE = 6.0
_OP_STAYS = 0.5
_FEWEST_SAMPLES = 16
_RETURNS_WITHIN = 0.3
SPIKE_SHARE = 0.5
_FEWEST_HELD = 4
_HELD_CYCLE_SHARE = 0.05
HELD_SHARE = 0.5
_COARSE = 0.1
_OP_HELD = 0.2


def spiking_sensor(scene: Scene) -> Rival:
    """Single samples leave PV by six times its usual step and come back: the share of PV's fast variance that they
    hold.

    The median serves as the yardstick, after Hampel (1974, J. Am. Stat. Assoc. 69, 383-393, doi
    10.1080/01621459.1974.10482962). Misleads if PV is sampled so slowly that real swings last one sample.
    """
    pieces = [_spikes(pv, op) for pv, op in zip(scene.raw_pv, scene.raw_op, strict=True)]
    count, samples = sum(n for n, _ in pieces), sum(map(len, scene.raw_pv))
    if count > _MOST_SPIKES_SHARE * samples:
        return not_evaluated("sensor_spikes", "more than a twentieth of all samples look like spikes")
    share = float(np.mean([share for _, share in pieces]))
    jump = counted(
        count,
        "single sample of PV jumps away and back; it makes up",
        "single samples of PV jump away and back; they make up",
    )
    text = f"{jump} {100 * share:.0f} % of its fast variance"
    strength = rising(share, 0.0, 2 * SPIKE_SHARE) if count >= _FEWEST_SPIKES else 0.0
    return Rival("sensor_spikes", strength, text, statistic=share, threshold=SPIKE_SHARE)


def sticking_sensor(scene: Scene) -> Rival:
    """PV holds exactly one value for a long time while OP moves, then jumps, and is not coarse: the sensor sticks.

    A process never holds PV to the last digit, and a stuck valve leaves the noise of the measurement. Not evaluated if
    OP is held too, as by a historian that stores exceptions, or if PV is coarse. Misleads if the historian compresses
    PV alone.
    """
    if scene.features.named("pv_quantum") > _COARSE:
        return not_evaluated("sensor_sticking", "PV is coarse, and coarse values repeat")
    if scene.features.named("op_held") > _OP_HELD:
        return not_evaluated("sensor_sticking", "OP is held too, which points to the recorder, not the sensor")
    longest = max(_FEWEST_HELD, _HELD_CYCLE_SHARE * scene.per_cycle)
    held = [run_lengths(pv) >= longest for pv in scene.raw_pv]
    share = float(np.mean([part.mean() for part in held]))
    moves = float(np.mean([_moved(op, part) for op, part in zip(scene.raw_op, held, strict=True)]))
    text = (
        f"PV repeats exactly the same value for {100 * share:.0f} % of the time, during which OP makes "
        f"{100 * moves:.0f} % of its travel"
    )
    return Rival(
        "sensor_sticking",
        rising(min(share, moves), 0.0, 2 * HELD_SHARE),
        text,
        _AGAINST_STICTION,
        statistic=share,
        threshold=HELD_SHARE,
    )


def _spikes(pv: FloatArray, op: FloatArray) -> tuple[int, float]:
    """How many spikes, and the share of the variance of PV about its running median that they hold."""
    if len(pv) < _FEWEST_SAMPLES:
        return 0, 0.0
    usual = float(np.median(np.abs(np.diff(pv))))
    off, beside = (pv - medians_of_five(pv))[2:-2], _range_beside(pv)
    spike = (np.abs(off) > _SPIKE_SIZE * usual) & (beside < _RETURNS_WITHIN * np.abs(off)) & (usual > 0.0)
    if spike.any():
        spike &= ~_op_stays(op)
    total = float(off @ off)
    return int(spike.sum()), float(off[spike] @ off[spike]) / total if total > 0.0 else 0.0


@njit(cache=True, nogil=True)
def _range_beside(x: FloatArray) -> FloatArray:
    """(n - 4,) what the two samples before each inner one of x (n,) and the two after it go over."""
    ranges = np.empty(len(x) - 4)
    for k in range(len(ranges)):
        a, b, c, d = x[k], x[k + 1], x[k + 3], x[k + 4]
        ranges[k] = max(max(a, b), max(c, d)) - min(min(a, b), min(c, d))
    return ranges


def _op_stays(op: FloatArray) -> BoolArray:
    """(n - 4,) where OP moves and stays moved: it answered a load that is there, not a value that was none."""
    after = np.abs(np.concatenate((op[5:], op[-1:])) - np.concatenate((op[:1], op[:-5])))
    return after > _OP_STAYS * np.ptp(_around(op), axis=0)


def _around(x: FloatArray) -> FloatArray:
    """(5, n - 4) the two samples before each inner one of x (n,), it and the two after it."""
    return np.stack([x[k : len(x) - 4 + k] for k in range(5)])


def _moved(op: FloatArray, where: BoolArray) -> float:
    steps = np.abs(np.diff(op, prepend=op[0]))
    total = float(steps.sum())
    return float(steps[where].sum()) / total if total > 0.0 else 0.0
