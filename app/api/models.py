"""What goes in and out over HTTP: each field with its meaning and its unit. OpenAPI is made from this."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from app.http.backend import IsoTime
from app.services.audit_json.models import KeyFiguresLine, ReliabilityRow, TableRow
from app.services.results import AuditState, UploadState
from app.services.stating.notes import LONGEST_TEXT, LONGEST_WORK_ORDER
from app.services.stating.properties import KNOWN_TYPES, LONGEST_WORDS, MOST_IMPORTANT

CSV: dict[int | str, dict[str, Any]] = {200: {"content": {"text/csv": {"schema": {"type": "string"}}}}}
"""In the responses of a route that answers with a table."""


class Read(BaseModel):
    """An answer, made from what a service returns."""

    model_config = ConfigDict(from_attributes=True)


class RejectOut(Read):
    line: int | None = Field(description="Line of the file as it came, from 1; null where no single line is at fault.")
    code: str = Field(description="Stable code of what was wrong.")
    text: str = Field(description="What was got, in words.")
    tag: str = Field("", description="The historian tag, where one is at fault.")


class UploadListed(Read):
    """An export as it came, and what became of it, in short."""

    id: str = Field(description="Identifier of the upload; the same content has the same, unless its name is its loop.")
    state: UploadState = Field(description="received -> reading -> done or failed.")
    filename: str = Field(description="Name under which it was sent.")
    size_bytes: int = Field(description="Size as it came, in bytes.")
    fingerprint: str = Field(
        description="SHA-256 of the content: of the bytes as they came, without their gzip where they have one."
    )
    received_at: str = Field(description="When it was received, ISO 8601, UTC.")
    sent_again_at: str | None = Field(
        None, description="When the same content came last, from which on it is kept, ISO 8601, UTC; null: once only."
    )
    ended_at: str | None = Field(description="When reading ended, ISO 8601, UTC; null before.")
    reason: str | None = Field(description="Why it failed; null otherwise.")
    error_code: str | None = Field(None, description="Stable code of why it failed; null otherwise.")
    waits_for_room_since: str | None = Field(
        None,
        description="Since when there is no room on the disk to read it, ISO 8601, UTC; it is tried again every five "
        "minutes at the latest. Null: it does not wait for that.",
    )
    waits_for_file_since: str | None = Field(
        None,
        description="Since when no worker that was asked to read it sees its file, ISO 8601, UTC: all need the same "
        "data folder. They are asked again every five minutes at the latest. Null: it does not wait for that.",
    )
    layout: str | None = Field(description="How the file was found to be laid out; null before it is read.")
    loops_found: int = Field(description="How many loops were found.")
    rows_kept: int = Field(description="Rows of the file that gave samples.")
    rows_refused: int = Field(description="Rows and values that could not be used.")
    samples_added: int = Field(description="Samples that were not there before.")
    samples_replaced: int = Field(
        0, description="Samples that took the place of other values, which were stored before."
    )
    reject_counts: dict[str, int] = Field(description="How many rows and values were refused, by code.")
    notes: list[str] = Field(description="What was found out about the file, in words.")
    tags_found: int = Field(0, description="How many tags the file has.")
    times_from: str | None = Field(
        None, description="Time of the first row, ISO 8601, UTC; null where its times have no date."
    )
    times_to: str | None = Field(None, description="Time of the last row.")
    time_zone: str | None = Field(
        None, description="The zone in which times were read that tell none; `in the file` where they do."
    )
    damaged: bool = Field(
        False,
        description="Whether a part of the file could not be read because it came damaged, as a gzip file that was cut "
        "or a sheet of a workbook; what could be read is kept, and `notes` say what was lost.",
    )


class UploadOut(UploadListed):
    """An export as it came, and what became of it."""

    loops: list[str] = Field(description="Tags of the loops that were found.")
    rejects: list[RejectOut] = Field(description="The first rows and values that were refused, with line and reason.")
    tags: list[dict[str, Any]] = Field([], description="Which tag of the file became which signal of which loop.")


class LoopOut(Read):
    """A control loop of the plant."""

    tag: str = Field(description="Tag of the loop.")
    unit: str | None = Field(description="Plant unit or area that it belongs to.")
    type: str | None = Field(description="flow, pressure, level, temperature, ...")
    description: str | None = Field(description="What it controls, in words.")
    owner: str | None = Field(description="Who looks after it: a person, a crew, a group.")
    importance: float = Field(description="Weight in rankings; 1 is usual.")
    pv_unit: str | None = Field(description="Engineering unit of PV and SP.")
    pv_low: float | None = Field(description="Low end of PV's span, in the unit of PV.")
    pv_high: float | None = Field(description="High end of PV's span, in the unit of PV.")
    op_low: float | None = Field(description="Low end of OP's span, in the unit of OP.")
    op_high: float | None = Field(description="High end of OP's span, in the unit of OP.")
    integrating: bool | None = Field(description="Whether the process integrates (a level); null: not known.")
    moves_valve: bool | None = Field(
        description="Stated of its OP: true, it moves a valve of its own; false, the set point of another loop, found "
        "or not; null: cascades are found from the records."
    )
    retired: bool = Field(description="Gone, or never a loop: kept, but neither audited with the plant nor counted.")
    continues: str | None = Field(
        description="The tag that it had before: that loop is retired, and its notes are with this one."
    )
    samples_to: str | None = Field(description="Time of the newest sample, ISO 8601, UTC; null where there is none.")


Name = Annotated[str, Field(max_length=LONGEST_WORDS, pattern=r"^[^\x00]*$")]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class LoopPatch(BaseModel):
    """What to change; a field that is left out stays as it is, null forgets it."""

    model_config = ConfigDict(extra="forbid", strict=True)  # or false would be an op_high of 0

    unit: Name | None = Field(None, description="Plant unit or area.")
    type: Name | None = Field(
        None,
        description=f"{', '.join(KNOWN_TYPES)}, or one that the plant's mapping gave to a loop.",
    )
    description: Name | None = Field(None, description="What it controls, in words.")
    owner: Name | None = Field(None, description="Who looks after it: a person, a crew, a group.")
    importance: Annotated[float, Field(ge=0, le=MOST_IMPORTANT)] = Field(
        1.0, description="Weight in rankings; 1 is usual."
    )
    pv_unit: Name | None = Field(None, description="Engineering unit of PV and SP.")
    pv_low: Finite | None = Field(None, description="Low end of PV's span, in the unit of PV.")
    pv_high: Finite | None = Field(None, description="High end of PV's span, in the unit of PV.")
    op_low: Finite | None = Field(None, description="Low end of OP's span, in the unit of OP.")
    op_high: Finite | None = Field(None, description="High end of OP's span, in the unit of OP.")
    integrating: bool | None = Field(None, description="Whether the process integrates.")
    moves_valve: bool | None = Field(
        None,
        description="Whether OP moves a valve of its own (true) or the set point of another loop (false); null: found "
        "from the records. It counts from the next audit on.",
    )
    retired: bool | None = Field(
        None,
        description="Whether it is gone, or never was a loop: what is stored of it stays, but it is neither audited "
        "with the plant nor counted; null: it is not.",
    )
    continues: Name | None = Field(
        None,
        description="The tag that it had before. That loop is retired; what nobody said of this one is taken of it, "
        "and its notes, work orders, repairs and shelving go along. null: it continues none, and the other is in "
        "service again.",
    )


class NoteIn(BaseModel):
    """What to write about a loop: at least one of these, and with `shelved_until` a text or a work order."""

    model_config = ConfigDict(extra="forbid")

    text: Annotated[str, Field(max_length=LONGEST_TEXT)] = Field("", description="What there is to say.")
    work_order: Annotated[str, Field(max_length=LONGEST_WORK_ORDER)] = Field(
        "", description="Number of the work order."
    )
    repaired_at: IsoTime | None = Field(
        None, description="When the loop was repaired; ISO 8601, without an offset it is UTC."
    )
    shelved_until: IsoTime | None = Field(
        None,
        description="Until then the loop is left out of what to look at first, unless it is worse in kind than now; in "
        "the future, at most a year ahead, and not with `repaired_at`. ISO 8601, without an offset it is UTC.",
    )


class NoteOut(Read):
    """A note on a loop."""

    id: str = Field(description="Identifier of the note.")
    written_at: str = Field(description="ISO 8601, UTC.")
    written_by: str = Field(description="Name of the key, or `a local user without a key`.")
    text: str = Field(description="What was said.")
    work_order: str = Field(description="Number of the work order; empty: none.")
    repaired_at: str | None = Field(description="The repair that it states; verdicts before and after are compared.")
    shelved_until: str | None = Field(
        description="Until when it leaves the loop out of what to look at first: the newest such note counts, until a "
        "repair is stated after it."
    )
    withdrawn_at: str | None = Field(
        description="Since when that repair, or that shelving, counts no longer; null: it was not withdrawn."
    )
    withdrawn_by: str | None = Field(description="Who withdrew it.")
    written_of: str | None = Field(
        None, description="The tag that the loop had when it was written; null: the one that it has."
    )


class NotePage(Read):
    rows: list[NoteOut] = Field(description="Notes, the newest first.")
    next_cursor: str | None = Field(description="Give it as `cursor` for the next page; null on the last.")


class UploadPage(Read):
    rows: list[UploadListed] = Field(
        description="Uploads, the newest first; their `loops` and `rejects` are at `GET /v1/uploads/{id}`."
    )
    next_cursor: str | None = Field(description="Give it as `cursor` for the next page; null on the last.")


class LoopPage(Read):
    rows: list[LoopOut] = Field(description="Loops in the order of their tags.")
    next_cursor: str | None = Field(description="Give it as `cursor` for the next page; null on the last.")


class VerdictPage(Read):
    rows: list[ReliabilityRow] = Field(description="Verdicts of one loop, the newest first.")
    next_cursor: str | None = Field(description="Give it as `cursor` for the next page; null on the last.")


class ReliabilityPage(Read):
    rows: list[TableRow] = Field(description="One row a loop: its newest verdict.")
    next_cursor: str | None = Field(description="Give it as `cursor` for the next page; null on the last.")


class TrendOut(Read):
    """A loop's series, thinned to what a screen shows: of each stretch its least and greatest value are kept."""

    tag: str = Field(description="Tag of the loop.")
    samples: int = Field(description="Samples in the stretch before thinning.")
    time: list[str] = Field(description="ISO 8601, UTC.")
    time_ms: list[int] = Field(description="The same in milliseconds since 1970, UTC.")
    pv: list[float | None] = Field(description="Process output, in the unit of PV.")
    op: list[float | None] = Field(description="Controller output, in the unit of OP.")
    sp: list[float | None] | None = Field(description="Set point, in the unit of PV; null where it is not recorded.")
    sp_held_since: str | None = Field(
        description="When the set point at the first time was stated, where that was before it; else null."
    )
    mode_held_since: str | None = Field(description="The same of the mode.")
    automatic: list[int | None] | None = Field(
        None,
        description="The mode as it holds: 1 automatic or cascade, 0 manual, null where it is not known; null in all "
        "where it is not recorded.",
    )


class AuditIn(BaseModel):
    """Which loops to audit: all that are given must hold; nothing given: the whole plant."""

    model_config = ConfigDict(extra="forbid")

    tags: list[Name] | None = Field(None, description="Only these loops.", max_length=20000)
    unit: Name | None = Field(None, description="Only loops of this plant unit.")
    type: Name | None = Field(None, description="Only loops of this type.")

    @model_validator(mode="before")
    @classmethod
    def loops_are_named_by_tags(cls, given: Any) -> Any:
        if isinstance(given, dict) and "loops" in given:
            raise ValueError('loops are named in `tags`, as {"tags": ["FIC101"]}; there is no field `loops`')
        return given


class FailureOut(Read):
    loop: str = Field(description="Tag of the loop.")
    code: str = Field(description="Stable code of the failure.")
    text: str = Field(description="What happened, in words.")


class LoopsChangedOut(Read):
    """What became of a list of loops."""

    changed: int = Field(description="How many loops were set otherwise.")
    unchanged: int = Field(description="How many were so already.")
    refused: list[FailureOut] = Field(
        description="The loops, or single values of a CSV, that could not be set, and why."
    )
    ignored: list[str] = Field(description="Columns of a CSV that say nothing of a loop here.")


class AuditOut(Read):
    """One plant-wide (or filtered) audit run."""

    id: str = Field(description="Identifier of the run.")
    state: AuditState = Field(description="planned -> running -> done, partial where loops failed, or cancelled.")
    trigger: str = Field(description="What started it: request, nightly, ...")
    started_by: str | None = Field(
        description="Name of the key, `command line`, `schedule`, or `a local user without a key`; null: not known."
    )
    created_at: str = Field(description="ISO 8601, UTC.")
    ended_at: str | None = Field(description="ISO 8601, UTC; null while it runs.")
    total: int = Field(description="Loops in the run.")
    open: int = Field(description="Loops still to do.")
    done: int = Field(description="Loops with a verdict.")
    failed: int = Field(description="Loops that failed; in a cancelled run also those that were called off.")
    cancelled: int = Field(0, description="How many of the failed ones were called off with the run.")
    failures: list[FailureOut] = Field(description="The first of the failed loops, and why.")
    night: str | None = Field(None, description="The date whose nightly run it is; null: it was asked for.")
    part: str = Field("", description="Which part of the plant was asked for, in words.")
    code: str | None = Field(
        None, description="`no_loops`: there was no loop with samples to audit; null: there was one."
    )
    text: str | None = Field(None, description="The same in words, and what to do.")


class AuditPage(Read):
    rows: list[AuditOut] = Field(description="Runs, the newest first.")
    next_cursor: str | None = Field(description="Give it as `cursor` for the next page; null on the last.")


class NightOfUnitOut(Read):
    unit: str | None = Field(description="Plant unit as it is now; null: none is named.")
    sticking: int = Field(description="Valves that stick, to be relied on; none of old records or before repairs.")


class NightOut(Read):
    """What the last run of the whole plant of a date said, of the loops that are in service."""

    date: str = Field(description="Of the night; of a run that is no night's, of its begin by the plant's clock.")
    run: str = Field(description="Identifier of the run.")
    audited: int = Field(description="Loops with a verdict.")
    sticking: int = Field(description="Valves that stick, to be relied on; none of old records or before repairs.")
    health: float | None = Field(description="Mean health, weighted by importance; null: no loop has one.")
    in_manual: int = Field(
        description="Loops that could not be judged because they were not in automatic; one that was judged on what it "
        "did before it went to manual is none of them."
    )
    units: list[NightOfUnitOut] = Field(description="The same of each unit, as far as it is told.")
    apart: int = Field(
        description="Valves that stick of which that could be relied on when it was said, and not by then: of old "
        "records, or from before a repair."
    )


class NightsPage(Read):
    rows: list[NightOut] = Field(description="The newest fourteen dates, the oldest first.")
    next_cursor: str | None = Field(description="Always null: all fit into one page.")


class TrailRowOut(Read):
    """One thing that somebody did, or was refused."""

    id: str = Field(description="Identifier of the row.")
    at: str = Field(description="ISO 8601, UTC.")
    who: str = Field(description="Name of the key, `command line`, `schedule`, or `a local user without a key`.")
    action: str = Field(description="What was done: upload.receive, audit.start, loop.change, key.create, ...")
    subject: str = Field(description="To what: an address of this service, or the id of a key.")
    outcome: Literal["done", "refused", "failed", "not_known"] = Field(
        description="Whether it was done; not_known: the data base went away while it was written."
    )
    request_id: str | None = Field(description="As in the answer's X-Request-Id and in the log.")
    detail: dict[str, Any] = Field(description="How it was known who asked, from which address, the status.")


class TrailPage(Read):
    rows: list[TrailRowOut] = Field(description="What was done, the newest first.")
    next_cursor: str | None = Field(description="Give it as `cursor` for the next page; null on the last.")


class GroupMemberOut(Read):
    loop: str = Field(description="Tag of the loop.")
    unit: str | None = Field(description="Plant unit that it belongs to.")
    stiction_probability: float | None = Field(description="Probability that its valve sticks, 0 to 1.")
    score: float = Field(description="Log-odds of being the source: stiction, less what a late onset takes off.")
    coherence: float = Field(description="How closely it moves in step with the likeliest source, 0 to 1.")
    lag_s: float | None = Field(description="How long after the likeliest source PV swings, in s; null: not in step.")
    onset: str | None = Field(description="When its oscillation began, ISO 8601, UTC; null: before the record.")
    measured: bool = Field(description="Whether the probability is measured; false: it is a prior.")


class GroupOut(Read):
    """Loops that oscillate together."""

    id: str = Field(description="Number of the group.")
    period_s: float = Field(description="Period of the oscillation, in seconds.")
    in_step: bool = Field(description="Amplitude and phase wander together; false: only period and spectrum are alike.")
    by_chance: bool = Field(description="So many loops may share a period by chance; false: they hardly do.")
    chance_probability: float = Field(description="Probability that so many loops share a period by chance, 0 to 1.")
    source: str | None = Field(
        description="The likeliest source; null where no member probably sticks, where what the others share is not "
        "what that one does, or chance_probability is above 0.1."
    )
    set_points_together: bool = Field(
        False, description="Where no source is named: the set points of most members move at the same times."
    )
    members: list[GroupMemberOut] = Field(description="The likeliest source first.")


class GroupPage(Read):
    rows: list[GroupOut] = Field(description="Groups in step first, the larger ones first.")
    next_cursor: str | None = Field(description="Always null: there is one page.")


class HealthOut(TableRow, KeyFiguresLine):
    """The newest verdict of a loop and its key figures, flat, for dashboards."""


class ReadyOut(BaseModel):
    state: Literal["ready", "degraded", "not_ready"] = Field(
        description="degraded: works, but a broker is away or refuses, or data base or data folder take no writes, or "
        "all connections to read from the data base are in use."
    )
    checks: dict[str, Any] = Field(description="What was looked at, and what was found.")
