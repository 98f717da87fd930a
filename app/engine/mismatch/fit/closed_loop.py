"""The loop closed again: the controller's law read off SP, PV and OP, and the model simulated from the recorded SP
alone, clean, with modelled noise, and as its sensor and historian show it.
"""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from app.engine.mismatch.fit.fitting import Fit
from app.engine.mismatch.fit.noise import coloured, compared_samples, whiten
from app.engine.mismatch.loop.block import Context, Part
from app.engine.mismatch.loop.chain import simulate
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.loop.law import Controller, Law, identify_law, tried_on
from app.engine.mismatch.loop.plant import Plant
from app.engine.oscillation import detect
from app.engine.recording import FloatArray, UniformRecord
from app.engine.reference.yper import compute

_IDENTIFIED = 0.9
_MOST_SAMPLES, _MOST_PASSES = 3000, 800
_SETTLED = 1e-6
_LEAST_YPER = 0.05
_WORTH_SAYING = 0.5
"""Share by which a step must bring Yper nearer to the recorded one to be named: another draw of the same noise moves
the Yper of a sticking loop by a quarter and more (standard deviation over 30 draws)."""
_LEFT_BY_OTHERS, _LEFT_TIMES = 0.01, 2.0  # a gain 10 % off leaves 0.01


@dataclass(frozen=True)
class LoopFigures:
    """What a loop shows. period_s is None where it does not oscillate; amplitude: standard deviation of PV - SP, unit
    of PV. shape: mean of abs(PV - SP) over its root mean square, mean taken off: 1 for a square wave, 0.90 for a sine,
    0.87 for a triangle, 0.80 for Gaussian noise.
    """

    period_s: float | None
    amplitude: float
    yper_pct: float
    shape: float


@dataclass(frozen=True)
class ClosedLoop:
    """The recorded loop beside loops simulated from SP alone: the simulation as given, the refitted one, the explained
    one, the explained one with the noise modelled, and that as sensor and historian show it. None: that simulation did
    not settle, or none was given.

    lacked: what the clean simulation lacked for Yper to come out as recorded, the largest share first. given_law: of
    the given simulation's own controller, where it has one, and how much of the recorded OP's moves it explains.
    """

    law: Law
    recorded: LoopFigures
    refitted: LoopFigures | None
    explained: LoopFigures | None
    with_noise: LoopFigures | None = None
    as_recorded: LoopFigures | None = None
    lacked: tuple[str, ...] = ()
    given: LoopFigures | None = None
    given_law: Law | None = None

    @property
    def controller_differs(self) -> bool:
        """Whether the given simulation's controller leaves more of OP's moves than the recorded one's own law."""
        if self.given_law is None:
            return False
        return 1.0 - self.given_law.explained > _LEFT_BY_OTHERS + _LEFT_TIMES * (1.0 - self.law.explained)


@njit(cache=True, nogil=True)
def _follow(e: FloatArray, kc: float, ki: float, kd: float, start: float, low: float, high: float) -> FloatArray:
    op = np.empty(len(e))
    op[0] = start
    for t in range(1, len(e)):
        before = e[t - 2] if t > 1 else e[t - 1]
        move = kc * (e[t] - e[t - 1]) + ki * e[t] + kd * (e[t] - 2.0 * e[t - 1] + before)
        op[t] = min(max(op[t - 1] + move, low), high)
    return op


def close(found: Fit, law: Law, sp: FloatArray, added: FloatArray | None = None) -> UniformRecord | None:
    """OP and PV of the closed loop, from SP (N,) alone and noise added to PV (N,); None where it has not settled on
    one answer.

    The model runs over whole signals, so the loop is solved by repetition: PV answers OP a sample later at the
    earliest, hence each pass makes at least one more sample right, and N passes make all.
    """
    record = found.record
    noise = np.zeros(record.samples) if added is None else added
    low, high = float(np.min(record.op)) - record.op_span, float(np.max(record.op)) + record.op_span
    op = np.full(record.samples, record.op[0])
    pv = np.full(record.samples, record.pv[0])
    for _ in range(min(record.samples, _MOST_PASSES)):
        pv = simulate(record.with_op(op), found.plant, found.parts) + record.pv_mid + noise
        error = np.ascontiguousarray(sp - pv)
        following = _follow(error, law.kc, law.ki, law.kd, float(record.op[0]), low, high)
        change = float(np.max(np.abs(following - op)))
        op = following
        if change < _SETTLED * record.op_span:
            break
    else:
        return None
    if not np.all(np.isfinite(pv)):
        return None
    return UniformRecord(record.sampling_interval_s, pv, op, sp, np.zeros(record.samples, dtype=np.bool_))


def _figures(record: UniformRecord) -> LoopFigures:
    """What the loop of a record of N samples shows, against SP where it was recorded, else against PV's mean.

    Yper is that of both signals at unit standard deviation, and 0 where PV or OP holds one value. Misleads where the
    record holds a few periods only: period and Yper of so few scatter.
    """
    error = record.pv - record.sp if record.sp is not None else record.pv
    moves = error - np.mean(error)
    spread = float(np.std(error))
    shape = float(np.mean(np.abs(moves)) / spread) if spread > 0.0 else 0.0
    period = detect(record).period_s
    if np.ptp(record.op) <= 0.0 or np.ptp(record.pv) <= 0.0:
        return LoopFigures(period, spread, 0.0, shape)
    yper = compute(record.pv, record.op, record.sampling_interval_s, "std").yper_pct
    return LoopFigures(period, spread, yper, shape)


def first_stretch(found: Fit) -> Fit:
    """The fit with as much of the record's start as the repetition is worth doing for."""
    record, n = found.record, min(found.record.samples, _MOST_SAMPLES)
    if n == record.samples:
        return found
    return replace(found, record=record.stretch(0, n), simulated=found.simulated[:n])


def modelled_noise(found: Fit, seed: int = 0) -> FloatArray:
    """Another course (N,) of the noise that the fit found: its innovations in another order, in the same colour."""
    e = whiten(found.residual, found.record.usable, found.noise)
    known = e[compared_samples(found.record.usable)]
    if len(known) == 0:
        return np.zeros(found.record.samples)
    drawn = np.random.default_rng(seed).choice(known - np.mean(known), found.record.samples)
    return coloured(drawn, found.noise)


def close_again(
    base: Fit,
    final: Fit,
    sensors: tuple[Part, ...] = (),
    acted: Experiment | None = None,
    given: Plant | None = None,
    controller: Controller | None = None,
) -> ClosedLoop | None:
    """The closed loop of a record beside its simulations; None where the law is not a PID of the error.

    sensors: what sensor and historian do to PV on its way to the record. acted: the record in which the controller
    acted, where that is at another interval than the models'; None: theirs. given: the linear model of the simulation
    as it came; controller: its own, where it has one, else it runs under the recorded law.
    """
    base, final = first_stretch(base), first_stretch(final)
    record = base.record
    acted = record if acted is None else acted
    recorded_sp = acted.sp if acted.sp is not None and np.all(np.isfinite(acted.sp)) else None
    found = identify_law(recorded_sp, acted.pv, acted.op, acted.usable)
    if found.explained < _IDENTIFIED:
        return None
    law = found.at_interval(acted.sampling_interval_s, record.sampling_interval_s)
    sp = np.full(record.samples, law.sp) if law.sp is not None or record.sp is None else record.sp
    still = np.zeros(record.samples, dtype=np.bool_)
    shown = _figures(UniformRecord(record.sampling_interval_s, record.pv, record.op, sp, still))
    clean = [close(fit, law, sp) for fit in (base, final)]
    noisy = close(final, law, sp, modelled_noise(final))
    seen = None if noisy is None else _seen_through(noisy, final, sensors)
    refitted, explained, with_noise, as_recorded = (
        None if loop is None else _figures(loop) for loop in (*clean, noisy, seen)
    )
    steps = (
        ("the physics that was named", explained),
        (noise_in_words(final), with_noise),
        (_in_words(sensors), as_recorded),
    )
    lacked = _what_lacked(shown, refitted, steps)
    own = None
    if controller is not None:
        asked_for = np.full(acted.samples, found.sp) if recorded_sp is None else recorded_sp
        own = tried_on(controller.law(acted.sampling_interval_s), asked_for, acted.pv, acted.op, acted.usable)
        own = own.at_interval(acted.sampling_interval_s, record.sampling_interval_s)
    as_given = None if given is None else close(replace(base, plant=given, parts=()), own or law, sp)
    figures_given = None if as_given is None else _figures(as_given)
    return ClosedLoop(
        law, shown, refitted, explained, with_noise, as_recorded, lacked=lacked, given=figures_given, given_law=own
    )


def _seen_through(loop: UniformRecord, found: Fit, sensors: tuple[Part, ...]) -> UniformRecord:
    """A loop as its sensor's levels and its historian leave PV."""
    pv, context = loop.pv - found.record.pv_mid, Context(found.record, found.plant)
    for part in sensors:
        if part.block.apply is not None and part.block.active is None:
            pv = part.block.apply(pv, part.values, context)
    return replace(loop, pv=pv + found.record.pv_mid)


def _distance(figures_: LoopFigures, recorded: LoopFigures) -> float:
    """How far a Yper is from the recorded one, in natural logarithms; below _LEAST_YPER all are alike."""
    return float(abs(np.log(max(figures_.yper_pct, _LEAST_YPER)) - np.log(max(recorded.yper_pct, _LEAST_YPER))))


def _what_lacked(
    recorded: LoopFigures, refitted: LoopFigures | None, steps: tuple[tuple[str, LoopFigures | None], ...]
) -> tuple[str, ...]:
    """The steps that bring Yper nearer to the recorded one, in the order of how much."""
    gains, before = [], refitted
    for name, after in steps:
        if before is not None and after is not None and name:
            gains.append((_distance(before, recorded) - _distance(after, recorded), name))
        before = after if after is not None else before
    return tuple(name for gain, name in sorted(gains, reverse=True) if gain > np.log(1.0 + _WORTH_SAYING))


def noise_in_words(found: Fit) -> str:
    """White or coloured, with the memory of its slowest pole."""
    slowest = max(found.noise.poles)
    if slowest < 0.5:
        return "measurement noise, nearly white"
    memory = -found.record.sampling_interval_s / np.log(slowest)
    return f"coloured noise of the load, its memory {memory:.3g} s"


def _in_words(sensors: tuple[Part, ...]) -> str:
    lasting = [part.block.code for part in sensors if part.block.active is None]
    return " and ".join(lasting)
