"""Coupling: another measured signal moves PV, through a gain, a lag and a dead time; for good, or until the loop that
it disturbs first has answered, so that only its moves are felt. A process that integrates adds up what enters it.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, grid
from app.engine.mismatch.loop.causing import causes_pv
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.loop.plant import delay, lag, run_process
from app.engine.mismatch.physics.scales import slowness
from app.engine.recording import FloatArray

_ROUNDING = 1e-12  # of the largest value
_PASSING, _ENTERING = ", passing", ", entering"
_LEAST_OF_OP = 0.1  # of what passes


def condition_of(name: str) -> str:
    """When a coupling acts, in words: of every form of one signal alike."""
    return f"when {name} moves"


def _arriving(name: str, middle: float, values: FloatArray, context: Context) -> FloatArray:
    """What a measured signal adds to PV (N,) through gain, lag and dead time."""
    ts, cause = context.record.sampling_interval_s, dict(context.record.measured)[name] - middle
    return values[0] * lag(delay(cause, values[2], ts), values[1], ts)


def _block(name: str, source: FloatArray, middle: float) -> Block:
    spread = _spread_of(source)

    def parameters(context: Context) -> tuple[Parameter, ...]:
        ts, unit = context.record.sampling_interval_s, context.record.pv_span / spread
        slow = slowness(context)
        return (
            Parameter("gain", f"PV/{name}", -20.0 * unit, 20.0 * unit, 0.1 * unit, linear=True),
            Parameter("tau", "s", 0.1 * ts, 20.0 * slow, ts, log=True),
            Parameter("delay", "s", 0.0, 10.0 * slow, ts),
        )

    def starts(context: Context, _: FloatArray) -> FloatArray:
        ts, slow = context.record.sampling_interval_s, slowness(context)
        return grid(
            np.zeros(1), np.geomspace(0.3 * ts, 6.0 * slow, 7), np.concatenate(([0.0], np.geomspace(ts, 4.0 * slow, 6)))
        )

    def apply(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
        return signal + _arriving(name, middle, values, context)

    return Block(
        "disturbance.coupling",
        "disturbance",
        "output",
        condition_of(name),
        parameters,
        starts,
        apply=apply,
        form=name,
        penalty=15.0,
        affine=True,
    )


def _passing(lasting: Block, name: str, middle: float, form: str) -> Block:
    """As the coupling that lasts, but what arrives dies away again with a time of its own."""

    def parameters(context: Context) -> tuple[Parameter, ...]:
        ts, slow = context.record.sampling_interval_s, slowness(context)
        return (*lasting.parameters(context), Parameter("washout", "s", 2.0 * ts, 20.0 * slow, slow, log=True))

    def starts(context: Context, _: FloatArray) -> FloatArray:
        ts, slow = context.record.sampling_interval_s, slowness(context)
        lags, delays = np.geomspace(0.3 * ts, 2.0 * slow, 4), np.array([0.0, 2.0 * ts, 0.3 * slow, slow])
        return grid(np.zeros(1), lags, delays, slow * np.array([0.5, 1.5, 5.0]))

    def apply(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
        added = _arriving(name, middle, values, context)
        return signal + added - lag(added, values[3], context.record.sampling_interval_s)

    def beside_op(values: FloatArray, context: Context) -> bool:
        """What passes beside an OP that moves nothing is how a whole loop answers what lasts."""
        answered = run_process(context.record.op_deviation, context.plant, context.record.sampling_interval_s)
        passes = apply(np.zeros_like(answered), values, context)
        return bool(np.std(answered) > _LEAST_OF_OP * np.std(passes))

    return replace(
        lasting, parameters=parameters, starts=starts, apply=apply, form=form, sensible=beside_op, penalty=18.0
    )


def _entering(lasting: Block, name: str, middle: float, form: str, spread: float) -> Block:
    """As the coupling that lasts, but it enters a process that integrates, as a feed does a vessel."""

    def parameters(context: Context) -> tuple[Parameter, ...]:
        fastest = context.record.pv_span / spread / context.record.sampling_interval_s
        gain = Parameter("gain", f"PV/s/{name}", -fastest, fastest, 0.01 * fastest, linear=True)
        return (gain, *lasting.parameters(context)[1:])

    def apply(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
        """What enters is not late by the dead time of OP."""
        ts, plant = context.record.sampling_interval_s, context.plant
        arrived = _arriving(name, middle, values, context)
        at = np.arange(len(arrived)) + plant.theta / ts
        return signal + plant.tau / plant.K * np.interp(at, np.arange(len(arrived)), arrived)

    return replace(lasting, stage="load", parameters=parameters, apply=apply, form=form, suits=_integrates)


def _integrates(context: Context) -> bool:
    return context.plant.leak == 0.0


def blocks(record: Experiment) -> tuple[Block, ...]:
    """The coupling blocks of each measured signal that moves at all, or is told of from where it stood in another
    record.
    """
    return tuple(form for forms in _forms_by_signal(record).values() for form in forms)


def of_causes(record: Experiment) -> tuple[Block, ...]:
    """The coupling blocks of each measured signal that may move PV: none for what follows OP or PV."""
    causes = {name for name, signal in record.measured if _moves(signal) and causes_pv(signal, record)}
    return tuple(form for name, forms in _forms_by_signal(record).items() if name in causes for form in forms)


def _forms_by_signal(record: Experiment) -> dict[str, tuple[Block, ...]]:
    """Of each signal the form that lasts, the one that passes and the one that enters a process that integrates."""
    middles, elsewhere = dict(record.middles), record.reference_middles is not None
    passing, entering = (_unlike(middles, ending) for ending in (_PASSING, _ENTERING))
    found: dict[str, tuple[Block, ...]] = {}
    for name, signal in record.measured:
        if name in middles and (elsewhere or _moves(signal)):
            lasting = _block(name, signal, middles[name])
            found[name] = (
                lasting,
                _passing(lasting, name, middles[name], f"{name}{passing}"),
                _entering(lasting, name, middles[name], f"{name}{entering}", _spread_of(signal)),
            )
    return found


def _unlike(names: Iterable[str], ending: str) -> str:
    """What no name ends with, so that no form has the name of another signal."""
    told = ending
    while any(name.endswith(told) for name in names):
        told += ending
    return told


def _spread_of(signal: FloatArray) -> float:
    """Standard deviation; 1 of a cause that stands, which moves PV by where it stands."""
    return float(np.std(signal)) or 1.0


def _moves(signal: FloatArray) -> bool:
    """Whether a signal (N,) does more than rounding."""
    return bool(np.std(signal) > _ROUNDING * np.max(np.abs(signal)))
