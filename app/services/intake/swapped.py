"""Loops whose set point lies with OP and not with PV, as it does where two tags are exchanged."""

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from app.ingest import LoopSamples
from app.services.telling.naming import named

NEARER = 0.1
MOSTLY = 0.9
FEWEST = 50


class SetPoints:
    """Takes stretches as they are read. A set point of zero and an OP that stands are those of a loop out of use."""

    def __init__(self) -> None:
        self._looked_at: dict[str, int] = defaultdict(int)
        self._with_op: dict[str, int] = defaultdict(int)

    def look(self, stretch: LoopSamples) -> None:
        if stretch.pv is None or stretch.op is None or stretch.sp is None:
            return
        known = np.isfinite(stretch.pv) & np.isfinite(stretch.op) & np.isfinite(stretch.sp) & (stretch.sp != 0.0)
        if stretch.automatic is not None:
            known &= stretch.automatic != 0.0
        pv, op, sp = (signal[known] for signal in (stretch.pv, stretch.op, stretch.sp))
        if len(op) and np.count_nonzero(np.diff(op)) > 0.5 * len(op):
            self._looked_at[stretch.loop] += len(op)
            self._with_op[stretch.loop] += int(np.count_nonzero(np.abs(op - sp) < NEARER * np.abs(pv - sp)))

    def notes(self) -> Iterator[str]:
        loops = [loop for loop, count in self._looked_at.items() if count >= FEWEST and self._is_with_op(loop)]
        if loops:
            yield f"SP lies with OP, far from PV: are the tags of PV and OP exchanged, or is SP in %? {named(loops)}"

    def _is_with_op(self, loop: str) -> bool:
        return self._with_op[loop] >= MOSTLY * self._looked_at[loop]
