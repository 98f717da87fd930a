"""The valve of a simulated loop: any of the engine's valve models behind one compiled step."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numba import njit

from app.engine.recording import FloatArray
from app.engine.valve import (
    PhysicalValve,
    choudhury_start,
    choudhury_step,
    he_step,
    kano_start,
    kano_step,
    one_parameter_step,
    physical_step,
)
from app.errors import DataError

LINEAR, ONE_PARAMETER, HE, CHOUDHURY, KANO, PHYSICAL, STUCK = range(7)


@dataclass(frozen=True)
class LinearValve:
    """A valve without stiction: its position is OP."""


@dataclass(frozen=True)
class OneParameterValve:
    """The one-parameter model (eq 1). d in the unit of OP."""

    d: float


@dataclass(frozen=True)
class TwoParameterValve:
    """He's, Choudhury's or Kano's model. S, J in the unit of OP."""

    S: float
    J: float
    algorithm: Literal["he", "choudhury", "kano"] = "he"


@dataclass(frozen=True)
class PhysicalActuator:
    """A physical valve. op_per_pct: units of OP that stand for one per cent of travel; 1 where OP is in per cent."""

    valve: PhysicalValve
    op_per_pct: float = 1.0


@dataclass(frozen=True)
class StuckValve:
    """A valve that does not move at all."""


Valve = LinearValve | OneParameterValve | TwoParameterValve | PhysicalActuator | StuckValve

_TWO_PARAMETER = {"he": HE, "choudhury": CHOUDHURY, "kano": KANO}


class CompiledValve(NamedTuple):
    """What `move` needs: the model's number, its state (changed in place) and its parameters.

    A named tuple because compiled code takes one as it is.
    """

    kind: int
    state: FloatArray
    parameters: FloatArray


def compiled(valve: Valve, op_start: float, step_s: float) -> CompiledValve:
    """The valve at rest at op_start (unit of OP), ready for steps of step_s (s).

    Raises DataError("stiction_band") where d, S or J is negative.
    """
    state = np.zeros(6)
    state[:2] = op_start
    if isinstance(valve, OneParameterValve):
        return CompiledValve(ONE_PARAMETER, state, _bands(valve.d))
    if isinstance(valve, TwoParameterValve):
        return _two_parameter(valve, state)
    if isinstance(valve, PhysicalActuator):
        state[:2] = op_start / valve.op_per_pct, 0.0
        return CompiledValve(PHYSICAL, state, np.append(valve.valve.parameters(), [step_s, valve.op_per_pct]))
    return CompiledValve(STUCK if isinstance(valve, StuckValve) else LINEAR, state, np.zeros(2))


def _two_parameter(valve: TwoParameterValve, state: FloatArray) -> CompiledValve:
    bands = _bands(valve.S, valve.J)
    if valve.algorithm == "choudhury":
        choudhury_start(state[1], state)
    elif valve.algorithm == "kano":
        kano_start(state[1], state, valve.S, valve.J)
    return CompiledValve(_TWO_PARAMETER[valve.algorithm], state, bands)


def _bands(*bands: float) -> FloatArray:
    if min(bands) < 0:
        raise DataError("stiction_band", f"d, S and J cannot be negative, got {bands}")
    return np.array([*bands, 0.0])


@njit(cache=True, fastmath=False, nogil=True)
def move(kind: int, state: FloatArray, parameters: FloatArray, op: float) -> float:
    """The valve position after OP moved to `op`, in the unit of OP; `state` is updated in place."""
    if kind == ONE_PARAMETER:
        return one_parameter_step(op, state, parameters[0])
    if kind == HE:
        return he_step(op, state, parameters[0], parameters[1])
    if kind == CHOUDHURY:
        return choudhury_step(op, state, parameters[0], parameters[1])
    if kind == KANO:
        return kano_step(op, state, parameters[0], parameters[1])
    if kind == PHYSICAL:
        return parameters[8] * physical_step(op / parameters[8], state, parameters, parameters[7])
    return state[1] if kind == STUCK else op
