"""A file that was read, to audit lines: what needs no database."""

from datetime import timedelta
from time import perf_counter
from typing import Any

from app.engine.audit import audit
from app.engine.plant_wide.excerpts import Excerpts, excerpts_of
from app.ingest import RecordingsRead
from app.services.audit_json import swings
from app.services.audit_json.dating import dated
from app.services.audit_json.excerpts import as_json, from_json
from app.services.audit_json.line import audit_line
from app.services.auditing.hearing import heard_together
from app.services.moments import EPOCH, UTC_CLOCK, PlantClock


def audited_lines(content: RecordingsRead, clock: PlantClock = UTC_CLOCK) -> list[dict[str, Any]]:
    """A line a recording, heard beside the others where all have one clock; sentences tell times by `clock`."""
    lines, swinging = [], []
    kept: dict[str, Excerpts] = {}
    for recording in content.recordings:
        started = perf_counter()
        found, loop = audit(recording), content.loops[recording.name]
        line = audit_line(found, perf_counter() - started, loop)
        start_s = content.starts_s.get(recording.name)
        if content.dated and start_s is not None:
            line = dated(line, EPOCH + timedelta(seconds=start_s), clock)
        lines.append(line)
        if start_s is None:
            continue
        if found.swing is not None:
            swinging.append(swings.candidate(loop, found.swing, found.judgement.stiction_probability, start_s))
        if (excerpts := excerpts_of(recording, start_s)) is not None:
            kept[loop] = from_json(as_json(excerpts))
    return heard_together(lines, swinging, kept)
