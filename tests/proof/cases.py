"""Makes blind cases whose effects can be seen: the energy that the best linear refit leaves, whitened, is 60 or
more.
"""

import copy
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from app.engine.recording import FloatArray
from tests.proof.concealing import CONCEAL
from tests.proof.generator import (
    EFFECTS,
    LEAST_ENERGY,
    NEED_A_MASS,
    NEED_SELF_REGULATION,
    SAME,
    Case,
    Loop,
    Run,
    Truth,
    coloured,
    make_loop,
    run,
)
from tests.proof.outside import NEED_ONE_LAG, NEED_TWO_LAGS, OUTSIDE
from tests.proof.plants import Process

TRIES, MOST_TRIES = 12, 200
HIDDEN = CONCEAL | OUTSIDE
SEEN_IN_PV_ALONE = ("sensor.quantization", "sensor.stuck", "sensor.saturation")
EXCITED_BY_SET_POINT = (
    "outside.", "process.", "valve.characteristic", "valve.saturation", "valve.slew_limit", "sensor.lag",
    "sensor.saturation",
)  # fmt: skip


def make_case(
    seed: int, effects: tuple[str, ...], foreign: bool, least: float = LEAST_ENERGY, samples: int | None = None
) -> Case:
    """The case of a seed: the first of some tries whose effects can be seen; of many where few loops suit them."""
    rng = np.random.default_rng(seed)
    case = attempt(rng, effects, foreign, seed, samples)
    for tried in range(MOST_TRIES):
        if case is not None and (tried >= TRIES or not effects or case.truth.energy >= least):
            return case
        case = attempt(rng, effects, foreign, seed, samples) or case
    if case is None:
        raise ValueError(f"no loop for {effects} from seed {seed}")
    return case


def attempt(
    rng: Generator, effects: tuple[str, ...], foreign: bool, seed: int, samples: int | None = None
) -> Case | None:
    loop = make_loop(rng, foreign, samples)
    self_regulating = not loop.process.integrating and len(loop.process.taus) == 1
    if any(e in NEED_SELF_REGULATION + NEED_ONE_LAG for e in effects) and not self_regulating:
        return None
    if any(e.startswith(EXCITED_BY_SET_POINT) for e in effects) and np.ptp(loop.sp) == 0.0:
        return None
    if any(e in NEED_TWO_LAGS for e in effects) and (loop.process.integrating or len(loop.process.taus) != 2):
        return None
    if any(e in NEED_A_MASS for e in effects) and not (loop.process.integrating or len(loop.process.taus) == 2):
        return None
    plain = copy.deepcopy(loop)
    alone: list[Loop] = []
    marks = []
    for effect in effects:
        alone.append(copy.deepcopy(plain))
        HIDDEN[effect](alone[-1], copy.deepcopy(rng), foreign)
        marks += HIDDEN[effect](loop, rng, foreign)
    fresh = copy.deepcopy(loop)
    recorded = run(loop)
    if not np.all(np.isfinite(recorded.pv)) or np.ptp(recorded.pv) > 400.0:
        return None
    case = dressed(rng, foreign, f"blind{seed:05d}", plain, fresh, recorded, effects, marks)
    if len(effects) == 2:
        case.truth.energy = min(case.truth.energy, *(beside(other, fresh, recorded) for other in alone))
    return case


def beside(other: Loop, both: Loop, recorded: Run) -> float:
    """What is seen of one of two effects beside the other: one that the other hides cannot be asked for."""
    without = run(copy.deepcopy(other), recorded.op, noisy=False).pv
    true = run(copy.deepcopy(both), recorded.op, noisy=False).pv
    clean = run(copy.deepcopy(both), recorded.op, noisy=False).clean
    return energy(true - without, without, recorded.op, recorded.pv - clean)


def dressed(
    rng: Generator,
    foreign: bool,
    name: str,
    plain: Loop,
    fresh: Loop,
    recorded: Run,
    effects: tuple[str, ...],
    marks: list,
) -> Case:
    """The recording in its units, with the engineer's simulation and the truth."""
    quiet_linear, quiet_true = copy.deepcopy(plain), copy.deepcopy(fresh)
    linear = run(quiet_linear, recorded.op, noisy=False).clean
    true = run(quiet_true, recorded.op, noisy=False).clean
    noise = recorded.pv - true
    truth = Truth(
        effects, windows(marks, recorded, plain), bool(marks), energy(true - linear, linear, recorded.op, noise)
    )
    if any(e in SEEN_IN_PV_ALONE for e in effects):
        truth.energy = max(truth.energy, LEAST_ENERGY) if len(effects) == 1 else truth.energy
    else:
        truth.noise = noise
    off = float(rng.uniform(0.04, 0.1)) if foreign else 0.07
    sim = engineers(rng, plain.process, off, foreign)
    trace = np.array([0.0, *(sim.step(float(u)) for u in recorded.op[:-1])])
    pv_scale = float(10.0 ** rng.uniform(-1.5, 2.0)) if foreign else 1.0
    op_scale = float(10.0 ** rng.uniform(-1.0, 0.3)) if foreign else 1.0
    pv_mid, op_mid = (float(rng.uniform(30.0, 70.0)) * s for s in (pv_scale, op_scale))
    truth.sizes = {name: op_scale * size for name, size in fresh.valve.sizes.items()}
    if len(effects) == 1 and not foreign:
        truth.sizes |= fresh.sizes
        if "limit" in fresh.sizes:
            truth.sizes["limit"] += op_mid if effects[0].startswith("valve.") else pv_mid
    truth.noise = None if truth.noise is None else truth.noise * pv_scale
    measured = (("AUX1", plain.aux + 40.0), ("AUX2", coloured(rng, plain.n, 0.95, 3.0, "gauss") + 45.0))
    return Case(
        name,
        plain.ts,
        pv_mid + pv_scale * plain.sp,
        np.round(op_mid + op_scale * recorded.op, 6),
        pv_mid + pv_scale * (recorded.pv if "sensor.quantization" in effects else np.round(recorded.pv, 4)),
        pv_mid + pv_scale * np.round(trace, 4),
        measured,
        truth,
    )


def engineers(rng: Generator, process: Process, off: float, foreign: bool) -> Process:
    """The linear simulation, its parameters a few per cent off."""
    gain, *taus = (v * (1.0 + rng.uniform(-off, off)) for v in (process.gain, *process.taus))
    late = process.dead_time * (1.0 + rng.uniform(-off, off) if foreign else 1.0)
    return Process(gain, tuple(taus), late, process.integrating, process.ts)


def energy(delta: FloatArray, linear: FloatArray, op: FloatArray, noise: FloatArray) -> float:
    """Whitened chi-square energy of what the effect changes and a linear refit cannot follow."""
    n = len(delta)
    order = 12
    lags = np.stack([noise[order - k - 1 : n - k - 1] for k in range(order)], axis=1)
    a = np.linalg.lstsq(lags, noise[order:], rcond=None)[0]

    def whitened(x: FloatArray) -> FloatArray:
        return x[order:] - sum(a[k] * x[order - k - 1 : n - k - 1] for k in range(order))

    moves = [linear, np.gradient(linear), np.gradient(np.gradient(linear)), np.ones(n)]
    basis = np.stack([whitened(m) for m in moves], axis=1)
    target = whitened(delta)
    left = target - basis @ np.linalg.lstsq(basis, target, rcond=None)[0]
    return float(np.sum(left**2) / np.var(whitened(noise)))


def windows(marks: list, recorded: Run, loop: Loop) -> tuple[tuple[float, float], ...]:
    """Stretches in s; those that depend on signals are read off the recorded run."""
    found = []
    for kind, value in marks:
        if kind == "op_beyond":
            mask = np.sign(value) * recorded.op > abs(value)
        elif kind == "pv_full":
            mask = recorded.clean >= value - 1e-3
        elif kind == "clean_above":
            mask = recorded.clean > value
        else:
            found.append((float(kind), float(value)))
            continue
        edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(int), [0]))))
        found += [(float(a * loop.ts), float(b * loop.ts)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return tuple(found)


def cut_out(case: Case, seed: int) -> Case:
    """The case without its first 5 to 15 %: the record of a loop that runs already, its stem anywhere in its band."""
    first = int(np.random.default_rng(seed).uniform(0.05, 0.15) * len(case.op))
    kept = {name: getattr(case, name)[first:] for name in ("sp", "op", "pv", "trace")}
    measured = tuple((name, signal[first:]) for name, signal in case.measured)
    late = first * case.ts
    moved = [(max(a - late, 0.0), b - late) for a, b in case.truth.windows if b > late]
    noise = None if case.truth.noise is None else case.truth.noise[first:]
    return replace(case, **kept, measured=measured, truth=replace(case.truth, windows=tuple(moved), noise=noise))


def planned(
    seed: int, count: int, clean_share: float, two_share: float, foreign: bool
) -> list[tuple[int, tuple[str, ...]]]:
    """Seed and effects of `count` cases: some clean, some with two effects, the rest with one, every effect in turn.
    The library's own plants are of first order and move no mass.
    """
    offered = EFFECTS if foreign else tuple(effect for effect in EFFECTS if effect not in NEED_A_MASS)
    rng = np.random.default_rng(seed)
    plans = []
    for k in range(count):
        draw = rng.random()
        if draw < clean_share:
            effects: tuple[str, ...] = ()
        elif draw < clean_share + two_share:
            effects = two_of(rng, offered)
        else:
            effects = (offered[k % len(offered)],)
        plans.append((seed * 100_000 + k, effects))
    return plans


def two_of(rng: Generator, offered: tuple[str, ...]) -> tuple[str, ...]:
    """Two effects of different places, neither hidden by the other's sensor fault."""
    while True:
        a, b = (str(e) for e in rng.choice(offered, 2, replace=False))
        together = {a, b}
        apart = a.split(".")[0] != b.split(".")[0] and b not in SAME.get(a, ())
        stages = {"sensor.drift", "sensor.step", "disturbance.oscillation", "disturbance.coupling"}
        if apart and len(together & stages) < 2 and not {"process.integrating", "process.outflow_law"} & together:
            return a, b
