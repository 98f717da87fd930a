"""Loops whose set point lies with OP and not with PV, as it does where two tags are exchanged."""

from collections import defaultdict
from collections.abc import Iterable

from app.engine.fitness.exchanged import WithOp, set_point_with_op
from app.ingest.model import LoopSamples

MOSTLY = 0.9
FEWEST = 50


class SetPoints:
    """Takes stretches as they are read."""

    def __init__(self) -> None:
        self._found: dict[str, WithOp] = defaultdict(WithOp)

    def look(self, stretch: LoopSamples) -> None:
        if stretch.pv is None or stretch.op is None or stretch.sp is None:
            return
        in_use = None if stretch.automatic is None else stretch.automatic != 0.0
        self._found[stretch.loop] += set_point_with_op(stretch.pv, stretch.op, stretch.sp, in_use)

    def with_op(self) -> tuple[str, ...]:
        """The loops whose set point lies with OP, in the order in which they were read."""
        return tuple(loop for loop, found in self._found.items() if _is_with_op(found))


def loops_with_op(loops: Iterable[LoopSamples]) -> tuple[str, ...]:
    """The same of loops that are there as a whole."""
    seen = SetPoints()
    for samples in loops:
        seen.look(samples)
    return seen.with_op()


def _is_with_op(found: WithOp) -> bool:
    return found.samples >= FEWEST and found.with_op >= MOSTLY * found.samples
