"""Loops whose set point lies with OP and not with PV, as it does where two tags are exchanged."""

from collections import defaultdict
from collections.abc import Iterator

from app.engine.fitness.exchanged import WithOp, set_point_with_op
from app.ingest import LoopSamples
from app.services.telling.naming import named

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

    def notes(self) -> Iterator[str]:
        loops = [loop for loop, found in self._found.items() if _is_with_op(found)]
        if loops:
            yield f"SP lies with OP, far from PV: are the tags of PV and OP exchanged, or is SP in %? {named(loops)}"


def _is_with_op(found: WithOp) -> bool:
    return found.samples >= FEWEST and found.with_op >= MOSTLY * found.samples
