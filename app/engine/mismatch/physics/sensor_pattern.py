"""What a sensor or a historian does to PV that shows in PV alone: quantisation, a stuck stretch, a lost signal,
a hard limit, compression.

These leave a pattern that no noise makes, so they are found by it and not by a competition; what is simulated passes
the same stage. Compression by a swinging door (Bristol 1990, US patent 4,669,097), by holding the last value, or by
straight lines between every m-th sample. Source of the test for compression: Thornhill, Oettinger, Fedenczuk 1999, doi
10.1016/S0959-1524(98)00054-9; quantisation is told by the spacing of levels (`mismatch.fit.levels`).
"""

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, no_scan
from app.engine.mismatch.physics.moments import between
from app.engine.recording import FloatArray
from app.engine.simulate.compression import keep, rebuild


def _step_size(context: Context) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "step", "PV", 1e-6 * context.record.pv_span, context.record.pv_span, context.record.pv_span, log=True
        ),
        Parameter("level", "PV level", -5.0 * context.record.pv_span, 5.0 * context.record.pv_span),
    )


def _tolerance(context: Context) -> tuple[Parameter, ...]:
    return (Parameter("deviation", "PV", 0.0, context.record.pv_span, context.record.pv_span),)


def _spacing(context: Context) -> tuple[Parameter, ...]:
    ts = context.record.sampling_interval_s
    return (Parameter("interval", "s", ts, context.record.duration_s, ts),)


def _rounded_off(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    """To the nearest level, a multiple of the step beside one of the levels."""
    step, level = values
    return level + step * np.round((signal - level) / step)


def _through_doors(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    kept = keep(context.time_s, signal, float(values[0]), "swinging_door")
    return rebuild(context.time_s, signal, kept, "swinging_door")


def _held_until_moved(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    return rebuild(context.time_s, signal, keep(context.time_s, signal, float(values[0]), "exception"), "exception")


def _every_so_often(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    every = max(round(float(values[0]) / context.record.sampling_interval_s), 1)
    kept = np.unique(np.append(np.arange(0, len(signal), every), len(signal) - 1))
    return np.interp(np.arange(len(signal)), kept, signal[kept])


def _window(context: Context) -> tuple[Parameter, ...]:
    duration = context.record.duration_s
    return (Parameter("start", "s", 0.0, duration, duration), Parameter("end", "s", 0.0, duration, duration))


def _limit(context: Context) -> tuple[Parameter, ...]:
    span = context.record.pv_span
    return (Parameter("limit", "PV level", -5.0 * span, 5.0 * span, span),)


def _hold(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """The sensor repeats what it last measured."""
    held = between(signal, values, context)
    if not held.any():
        return signal
    out = signal.copy()
    out[held] = signal[max(int(np.argmax(held)) - 1, 0)]
    return out


def _lost(context: Context) -> tuple[Parameter, ...]:
    span = context.record.pv_span
    return (*_window(context), Parameter("value", "PV level", -5.0 * span, 5.0 * span, span))


def _replaced(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
    """The signal is lost, and a value recorded in its place."""
    return np.where(between(signal, values, context), values[2], signal)


def _below(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    return np.minimum(signal, values[0])


def _above(signal: FloatArray, values: FloatArray, _: Context) -> FloatArray:
    return np.maximum(signal, values[0])


QUANTIZATION = Block(
    "sensor.quantization", "sensor", "sensor", "always", _step_size, no_scan, apply=_rounded_off, form="pattern"
)
COMPRESSION = Block(
    "sensor.compression", "sensor", "sensor", "always", _tolerance, no_scan, apply=_through_doors, form="pattern"
)
HELD = Block(
    "sensor.compression",
    "sensor",
    "sensor",
    "always",
    _tolerance,
    no_scan,
    apply=_held_until_moved,
    form="pattern-held",
)
INTERPOLATED = Block(
    "sensor.compression", "sensor", "sensor", "always", _spacing, no_scan, apply=_every_so_often, form="pattern-lines"
)
STUCK = Block(
    "sensor.stuck", "sensor", "sensor", "within a time", _window, no_scan, apply=_hold, active=between, form="pattern"
)
DROPOUT = Block(
    "sensor.dropout",
    "sensor",
    "sensor",
    "within a time",
    _lost,
    no_scan,
    apply=_replaced,
    active=between,
    form="pattern",
)
LIMIT_HIGH = Block(
    "sensor.saturation", "sensor", "sensor", "above a PV limit", _limit, no_scan, apply=_below, form="pattern-high"
)
LIMIT_LOW = Block(
    "sensor.saturation", "sensor", "sensor", "below a PV limit", _limit, no_scan, apply=_above, form="pattern-low"
)
