"""A repair parts a loop's record: what came before it says nothing about the valve that is there now."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime

from sqlalchemy import Connection

from app.counting import counted
from app.engine.audit import Audit
from app.engine.audit_config import AuditConfig
from app.engine.evidence import Reason
from app.engine.fitness import assess
from app.services.auditing.recordings import recording_of
from app.services.moments import PlantClock, ns_of
from app.services.telling.repair_sides import BEFORE_REPAIR, SINCE_REPAIR
from app.storage import notes, series
from app.storage.loops import LoopRow
from app.storage.samples import Samples


@dataclass(frozen=True, eq=False)
class Window:
    """What a loop is judged on; `samples` is None where it has none.

    repaired_at: the repair that the window begins with, or that most of it is from before; None: it knows of none.
    since_repair: how many samples are from after it. cut: whether they are all that is judged.
    """

    samples: Samples | None
    repaired_at: datetime | None = None
    since_repair: int = 0
    cut: bool = False

    def told(self, audit: Audit, clock: PlantClock) -> Audit:
        """The audit with a reason that says on which side of the repair it stands; what is of before it is not relied
        on. Its health stays: nothing has been recorded that would be better."""
        if self.repaired_at is None:
            return audit
        at = clock.told_at(self.repaired_at)
        judged = audit.judgement
        if self.cut:
            text = f"judged from the repair of {at} on: what came before it is left out"
            return replace(audit, judgement=replace(judged, reasons=(*judged.reasons, Reason(SINCE_REPAIR, text))))
        few = counted(self.since_repair, "sample since then is", "samples since then are")
        text = f"from before the repair of {at}: {few} too few to judge by"
        reasons = (Reason(BEFORE_REPAIR, text), *judged.reasons)
        return replace(audit, judgement=replace(judged, reliability="not_reliable", reasons=reasons))


def windows_since_repair(
    connection: Connection,
    known: Mapping[int, LoopRow],
    windows: Mapping[int, Samples],
    hold_days: float,
    config: AuditConfig,
) -> dict[int, Window]:
    """Each loop's window from its repair on, where there is one in it and the samples since then are enough; else as
    it is."""
    repairs = notes.repairs_stated_last(connection, windows)
    cut = {}
    for loop_id, samples in windows.items():
        since_ns = ns_of(repairs[loop_id]) if loop_id in repairs else None
        if since_ns is None or since_ns <= int(samples.time_ns[0]):
            cut[loop_id] = Window(samples)
            continue
        later = series.between(connection, loop_id, since_ns, int(samples.time_ns[-1]), hold_days)
        cut[loop_id] = _parted(known[loop_id], samples, later, repairs[loop_id], config)
    return cut


def _parted(
    loop: LoopRow, samples: Samples, later: Samples | None, repaired_at: datetime, config: AuditConfig
) -> Window:
    since = 0 if later is None else len(later)
    if later is None or since == 0 or not assess(recording_of(loop, later), config.fitness).long_enough:
        return Window(samples, repaired_at, since)
    return Window(later, repaired_at, since, cut=True)
