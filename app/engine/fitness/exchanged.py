"""Whether a set point lies with OP and not with PV, as it does where the tags of PV and OP are exchanged."""

from dataclasses import dataclass

import numpy as np

from app.engine.recording import BoolArray, FloatArray

NEARER = 0.1


@dataclass(frozen=True)
class WithOp:
    """samples: of a stretch that tell, with_op: those of them whose set point lies far nearer to OP than to PV."""

    samples: int = 0
    with_op: int = 0

    def __add__(self, other: "WithOp") -> "WithOp":
        return WithOp(self.samples + other.samples, self.with_op + other.with_op)


def set_point_with_op(pv: FloatArray, op: FloatArray, sp: FloatArray, in_use: BoolArray | None) -> WithOp:
    """Of a stretch, as it was sampled. pv, op, sp: (N,), NaN where missing; in_use: (N,) False where the loop was not
    in automatic, None where that is not known.

    A set point of zero and an OP that stands in half of the samples are those of a loop out of use: they tell nothing.
    """
    known = np.isfinite(pv) & np.isfinite(op) & np.isfinite(sp) & (sp != 0.0)
    if in_use is not None:
        known &= in_use
    if not known.all():
        pv, op, sp = pv[known], op[known], sp[known]
    if not len(op) or np.count_nonzero(op[1:] != op[:-1]) <= 0.5 * len(op):
        return WithOp()
    return WithOp(len(op), int(np.count_nonzero(np.abs(op - sp) < NEARER * np.abs(pv - sp))))
