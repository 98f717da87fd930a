"""The library of physics: one file an effect (or a family of its forms), each with the blocks it offers.

A new effect is one new file with `BLOCKS` and its name in `_ALWAYS_OFFERED`. What several of them need stands in files
of its own: `moments`, `scales`, `corners`, `stem`.
"""

from collections.abc import Iterable

from app.engine.mismatch.loop.block import Block
from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.physics import (
    additive,
    changing_dead_time,
    coupling,
    friction,
    gain_drift,
    generic,
    oscillation,
    process_dynamics,
    resonance,
    sample_hold,
    sensor_limit,
    sensor_pattern,
    static_gain,
    terms,
    two_tanks,
    valve_dead_zone,
    valve_deadband,
    valve_saturation,
    valve_slew_limit,
    valve_stiction,
    vessel,
)

_ALWAYS_OFFERED = (
    valve_stiction,
    valve_deadband,
    valve_dead_zone,
    valve_slew_limit,
    valve_saturation,
    static_gain,
    process_dynamics,
    changing_dead_time,
    resonance,
    gain_drift,
    vessel,
    two_tanks,
    friction,
    sensor_limit,
    additive,
    oscillation,
    generic,
)

# What OP and PV cannot tell apart: named as alternatives of each other, always.
_SAME_IN_OP_AND_PV = (
    frozenset(("process.extra_lag", "sensor.lag")),
    frozenset(("valve.characteristic", "process.nonlinear_gain")),
    frozenset(("disturbance.step", "sensor.step")),
    frozenset(("disturbance.ramp", "sensor.drift")),
)
TWINS = {code: tuple(sorted(family - {code})) for family in _SAME_IN_OP_AND_PV for code in sorted(family)}

# Forms so near each other that a right one's shortfall tells them apart no better than the share NEAR_SHARE of what it
# explains. A load pushes a mass through its dry friction, and no free run knows the load. A short dead time, a lag and
# an inverse response all make PV late: they differ only in what is quick, where noise hides it and a real process has
# more small lags than any of them.
LATE = frozenset(("process.dead_time", "process.extra_lag", "process.inverse_response"))
NEAR = (
    frozenset(("process.friction", "valve.deadband", "valve.stiction")),
    frozenset(("process.friction", "valve.dead_zone")),
    LATE,
)
NEAR_SHARE = 0.15

# What comes near another, so that both are said, but may stand beside it: an outflow law is a gain that falls with the
# level, and a time constant that does. One way on purpose: hardly any bent gain is an outflow law.
CLOSE = {"process.outflow_law": ("process.nonlinear_gain",)}

_PATTERNS = (
    sensor_pattern.QUANTIZATION,
    sensor_pattern.COMPRESSION,
    sensor_pattern.HELD,
    sensor_pattern.INTERPOLATED,
    sensor_pattern.STUCK,
    sensor_pattern.DROPOUT,
    sensor_pattern.LIMIT_HIGH,
    sensor_pattern.LIMIT_LOW,
    sample_hold.SAMPLE_HOLD,
)


def by_name(record: Experiment) -> dict[str, Block]:
    """Every block, those found by a pattern, of every measured signal and of what was before included, by its name."""
    every = (*fixed(), *coupling.blocks(record), *_PATTERNS, gain_drift.LASTED)
    return {block.name: block for block in every}


def named(record: Experiment, names: Iterable[str]) -> dict[str, Block]:
    """The blocks with these names, as far as there are such; generic ones are made of the terms in their name."""
    known = by_name(record)
    found = {name: known.get(name) or terms.of_name(name) for name in names}
    return {name: block for name, block in found.items() if block is not None}


def library(record: Experiment) -> tuple[Block, ...]:
    """Every block that may be missing from a simulation of this record."""
    return (*fixed(), *coupling.of_causes(record))


def fixed() -> tuple[Block, ...]:
    """The blocks that are the same for every record."""
    return tuple(block for module in _ALWAYS_OFFERED for block in module.BLOCKS)
