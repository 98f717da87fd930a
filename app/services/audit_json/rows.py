"""Between an audit and the columns of a stored verdict, and back to the row that dashboards read."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from datetime import datetime
from types import MappingProxyType
from typing import Any

from app.engine.audit import Audit
from app.engine.plant_wide.excerpts import Excerpts
from app.engine.recording import Recording
from app.json_texts import check_finite, short_json, stored_json
from app.services.audit_json import excerpts, swings
from app.services.audit_json.dating import dated, instant
from app.services.audit_json.detail import detail
from app.services.audit_json.line import audit_line, reliability_row
from app.services.audit_json.models import KeyFiguresLine, ReliabilityRow, TableRow
from app.services.moments import PlantClock, epoch_ms, iso_utc, moment_of
from app.services.recency import of_old_record
from app.services.telling.next_steps import Ask, as_table, next_step
from app.services.telling.repair_sides import of_before
from app.services.telling.stored_evidence import MEASURED
from app.storage.details import pack_detail
from app.storage.tables import verdicts
from app.storage.verdict_writing import NewVerdict

FIELDS = tuple(ReliabilityRow.model_fields)
TIMES = ("window_start", "window_end", "audited_at")
TIMES_MS = tuple(f"{name}_ms" for name in TIMES)
OF_SAMPLES = ("input_start", "input_end")
OF_LOOP = ("recording", "loop", "unit")
OLD = "of_old_record"
NOT_KEPT = (*OF_LOOP, *TIMES_MS, *OF_SAMPLES, OLD)
"""What a row has of its loop, or of other columns and its run."""
KEY_FIGURES = "key_figures"
HELD_SINCE = "held_since"
STATED, STATED_OF_LOOP = "stated", ("op_range", "pv_range", "integrating")
"""What the verdict took of the loop beside its samples: kept with it, because it may be stated otherwise later."""
OF_LOOP_NOW = ("unit",)  # what is asked of the loop when a row is sent, because it may have changed since the verdict
FORM = hashlib.blake2b(
    json.dumps([6, list(TableRow.model_fields), OF_LOOP_NOW, list(KeyFiguresLine.model_fields), as_table()]).encode(),
    digest_size=8,
).hexdigest()
"""Which fields a stored row has, and which steps it may name: rows that an older version wrote are made anew from
their columns."""
COLUMNS = frozenset(column.name for column in verdicts.columns)


def new_verdict(
    audit: Audit,
    *,
    recording: Recording,
    loop_id: int,
    audit_id: int,
    origin: datetime,
    audited_at: datetime,
    elapsed_s: float,
    input_ns: tuple[int, int],
    begun: datetime,
    newest_ns: int | None,
    clock: PlantClock,
    held_ns: Mapping[str, int] = MappingProxyType({}),
    kept: Excerpts | None = None,
) -> NewVerdict:
    """`recording`: what was judged; `origin`: the instant of its second 0; `input_ns`: its first and last sample;
    `begun`, `newest_ns`: when its run was, and the newest sample of the plant then; `clock`: what sentences tell times
    by; `held_ns`: when signals were stated that held when the record began; `kept`: of OP and SP, to compare loops
    by."""
    line = dated(audit_line(audit, elapsed_s), origin, clock)
    row = reliability_row(line)
    columns = {name: value for name, value in row.items() if name in COLUMNS and name != "audit_id"}
    extra = {name: value for name, value in row.items() if name not in COLUMNS and name not in NOT_KEPT}
    columns |= {
        "audited_at": audited_at,
        "window_start": instant(origin, line["window_start_s"]),
        "window_end": instant(origin, line["window_end_s"]),
        "input_start_ns": input_ns[0],
        "input_end_ns": input_ns[1],
    }
    held = {name: iso_utc(moment_of(at)) for name, at in held_ns.items()}
    told = {**detail(audit, line), "reasons": line["reasons"], HELD_SINCE: held}
    told[STATED] = {name: getattr(recording, name) for name in STATED_OF_LOOP}
    of_run = {"tag": audit.recording, "audit_id": audit_id, "run_begun": begun, "run_newest_ns": newest_ns}
    stored = columns | extra | of_run
    kept_with_row = {**extra, KEY_FIGURES: told[KEY_FIGURES], MEASURED: _measured(line["reasons"])}
    columns["extra_json"] = short_json(kept_with_row).decode()
    swing = None if audit.swing is None else swings.as_json(audit.swing, origin.timestamp())
    figures = short_json(told[KEY_FIGURES]).decode()
    check_finite(row)
    fixed = fixed_part(as_row(stored), clock)
    compared = None if kept is None else excerpts.as_json(kept)
    return NewVerdict(loop_id, audit_id, columns, pack_detail(told), fixed, figures, FORM, swing, compared)


def _measured(reasons: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    told = {reason["code"]: [reason[name] for name in ("statistic", "operator", "threshold")] for reason in reasons}
    return {code: measured for code, measured in told.items() if None not in measured}


def compact(value: Any) -> str:
    """Of what is stored, too."""
    return stored_json(value).decode()


def fixed_part(row: dict[str, Any], clock: PlantClock) -> str:
    """The fields of a row that its verdict fixes, as the inside of a JSON object, and those of which it fixes what they
    are as long as nothing is written of the loop."""
    whole = {**row, **unwritten(row, clock)}
    return compact({name: value for name, value in whole.items() if name not in OF_LOOP_NOW})[1:-1]


def unwritten(row: Mapping[str, Any], clock: PlantClock) -> dict[str, Any]:
    """`WrittenFields` of a loop of which nobody wrote anything."""
    step = Ask.NOTHING_NEWER.value if row[OLD] else next_step(row, clock)
    known = {"next_step": step, "of_before_repair": of_before(row, None)}
    return {"work_order": None, "repaired_at": None, "shelved_until": None} | known


def sent(fixed: str, unit: str | None, figures: str = "{}") -> str:
    """A row as JSON: what its verdict fixed, what the loop is now, and further fields (a JSON object)."""
    further = "," + figures[1:-1] if len(figures) > len("{}") else ""
    return f'{{{fixed},"unit":{compact(unit)}{further}}}'


def as_row(stored: dict[str, Any]) -> dict[str, Any]:
    """A stored verdict as a row of the reliability table: each field of the contract, None where this row has none."""
    row = {name: stored.get(name) for name in FIELDS}
    row["recording"] = row["loop"] = stored["tag"]
    row["audit_id"] = str(stored["audit_id"])
    for name in TIMES:
        row[name] = iso_utc(stored[name])
        row[f"{name}_ms"] = epoch_ms(stored[name])
    row |= {name: sampled(stored[f"{name}_ns"]) for name in OF_SAMPLES}
    row[OLD] = of_old_record(stored["input_end_ns"], stored["run_newest_ns"], stored["run_begun"])
    return row


def sampled(time_ns: int | None) -> str | None:
    """When a sample was recorded, ISO 8601, UTC."""
    return None if time_ns is None else iso_utc(moment_of(time_ns))
