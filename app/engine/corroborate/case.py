"""The loop as the methods look at it, and the assumptions that most of them share."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from app.engine.corroborate.half_cycles import half_cycles
from app.engine.features import ShapeWindow
from app.engine.oscillation import REGULAR_ABOVE, Oscillation
from app.engine.recording import FloatArray, UniformRecord
from app.engine.signals.sampled import without_drift

FEWEST_SAMPLES_A_CYCLE = 8.0
FEWEST_CYCLES = 3.0
FEWEST_HALF_CYCLES = 4
# Where SP moves by more than this share of PV at the speed of the oscillation, PV follows it, whatever the valve does.
_SP_SHARE = 0.25


@dataclass(frozen=True, eq=False)
class Case:
    """One loop: its record, its oscillation and windows, and whether the process integrates (None: not known).

    The windows are without drift and at unit standard deviation, so that no method sees units, offsets or time units.
    What several methods need of them is prepared once, at first use.
    """

    record: UniformRecord
    oscillation: Oscillation
    windows: tuple[ShapeWindow, ...]
    integrating: bool | None

    @cached_property
    def pv_halves(self) -> FloatArray:
        """(H, POINTS) half cycles of PV, all turned upwards."""
        return np.concatenate([half_cycles(w.pv, w.pv_smooth) for w in self.windows])

    @cached_property
    def op_halves(self) -> FloatArray:
        """(H, POINTS) half cycles of OP, all turned upwards."""
        return np.concatenate([half_cycles(w.op, w.op_smooth) for w in self.windows])

    @cached_property
    def why_not(self) -> str:
        """Which of the assumptions that all methods on wave forms share does not hold; "" where all hold."""
        o = self.oscillation
        if o.period_s is None or o.samples_per_cycle is None:
            return "the loop does not oscillate"
        if not o.regular:
            return f"the oscillation is not regular: r = {o.regularity:.2g}, needed above {REGULAR_ABOVE:g}"
        if o.samples_per_cycle < FEWEST_SAMPLES_A_CYCLE:
            return f"{o.samples_per_cycle:.3g} samples a cycle, needed {FEWEST_SAMPLES_A_CYCLE:g}"
        if o.cycles < FEWEST_CYCLES:
            return f"{o.cycles:.2g} cycles in the record, needed {FEWEST_CYCLES:g}"
        if self.sp_share > _SP_SHARE:
            return f"the set point moves with the oscillation, {100 * self.sp_share:.0f} % as much as PV"
        return "" if self.windows else "PV or OP does not vary"

    @cached_property
    def why_not_self_regulating(self) -> str:
        """The same for methods on self-regulating processes; a process that is not known is taken as one."""
        return self.why_not or ("the process integrates" if self.integrating else "")

    @cached_property
    def assumed(self) -> str:
        """What a text says of the process that had to be assumed."""
        return " (process taken as self-regulating)" if self.integrating is None else ""

    @cached_property
    def sp_share(self) -> float:
        """Standard deviation of SP against that of PV, both less what is slower than three cycles."""
        if self.record.sp is None:
            return 0.0
        half = int(1.5 * (self.oscillation.samples_per_cycle or self.record.samples))
        sp, pv = (float(np.std(without_drift(x, half))) for x in (self.record.sp, self.record.pv))
        return sp / pv if pv > 0.0 else 0.0
