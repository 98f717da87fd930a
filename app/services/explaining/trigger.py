"""The signal against which the residual of an explanation is drawn: what triggers the effect that was found."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.engine.mismatch import Comparison, Explanation
from app.engine.mismatch.judge.result import Effect
from app.engine.mismatch.physics.coupling import condition_of
from app.engine.recording import FloatArray
from app.engine.signals.turning import since_reversal


@dataclass(frozen=True, eq=False)
class Trigger:
    """What the residual depends on, in words with its unit, at the times of the traces (N,)."""

    label: str
    values: FloatArray


@dataclass(frozen=True, eq=False)
class Signals:
    """What a trigger is made of, at the times of the traces (N,); PV is that of the explained simulation."""

    time_s: FloatArray
    op: FloatArray
    pv: FloatArray
    measured: dict[str, FloatArray]


def trigger_of(explanation: Explanation, comparison: Comparison) -> Trigger:
    """That of the strongest effect; OP where nothing is missing."""
    traces = explanation.traces
    recorded_s = np.arange(len(comparison.op)) * comparison.sampling_interval_s

    def at_traces(signal: FloatArray) -> FloatArray:
        return np.interp(traces.time_s, recorded_s, signal)

    measured = {name: at_traces(signal) for name, signal in comparison.measured}
    signals = Signals(traces.time_s, at_traces(comparison.op), traces.explained, measured)
    if not explanation.effects:
        return _op(signals)
    effect = explanation.effects[0]
    return _coupling(signals, effect) or _phase(signals, effect) or BY_CODE.get(effect.code, _unnamed)(signals)


def _op(signals: Signals) -> Trigger:
    return Trigger("OP, unit of OP", signals.op)


def _pv(signals: Signals) -> Trigger:
    return Trigger("PV of the explained simulation, unit of PV", signals.pv)


def _time(signals: Signals) -> Trigger:
    return Trigger("time, s", signals.time_s)


def _op_rate(signals: Signals) -> Trigger:
    return Trigger("rate of OP, unit of OP a second", np.gradient(signals.op, signals.time_s))


def _pv_rate(signals: Signals) -> Trigger:
    return Trigger(
        "rate of PV of the explained simulation, unit of PV a second", np.gradient(signals.pv, signals.time_s)
    )


def _reversal(signals: Signals) -> Trigger:
    return Trigger("travel of OP since its last reversal, unit of OP", since_reversal(signals.op))


def _unnamed(signals: Signals) -> Trigger:
    return _op(signals)


def _coupling(signals: Signals, effect: Effect) -> Trigger | None:
    """The measured signal that moves PV: the condition names it."""
    if effect.code != "disturbance.coupling":
        return None
    name = next((name for name in signals.measured if effect.condition == condition_of(name)), None)
    return None if name is None else Trigger(f"{name}, in its unit", signals.measured[name])


def _phase(signals: Signals, effect: Effect) -> Trigger | None:
    period_s = next((p.value for p in effect.parameters if p.name == "period" and p.value > 0.0), None)
    if period_s is None:
        return None
    return Trigger(f"phase in a period of {period_s:.4g} s, degrees", 360.0 * np.mod(signals.time_s / period_s, 1.0))


BY_CODE: dict[str, Callable[[Signals], Trigger]] = {
    "valve.stiction": _reversal,
    "valve.deadband": _reversal,
    "valve.slew_limit": _op_rate,
    "process.dead_time": _op_rate,
    "process.extra_lag": _op_rate,
    "process.inverse_response": _op_rate,
    "process.resonance": _op_rate,
    "sensor.lag": _op_rate,
    "process.friction": _pv_rate,
    "process.nonlinear_gain": _pv,
    "process.outflow_law": _pv,
    "process.overflow": _pv,
    "process.integrating": _pv,
    "sensor.quantization": _pv,
    "sensor.saturation": _pv,
    "sensor.compression": _pv,
    "sensor.sample_hold": _pv,
    "process.gain_drift": _time,
    "sensor.drift": _time,
    "sensor.stuck": _time,
    "sensor.dropout": _time,
    "sensor.step": _time,
    "disturbance.step": _time,
    "disturbance.ramp": _time,
}
