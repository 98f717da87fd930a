"""What services answer with and the API sends as it is: each field with its meaning and its unit, in the order in which
it is sent. OpenAPI is made from this. Times are ISO 8601 in UTC, ids are strings.
"""

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import Field

from app.storage.audits import ENDED

UploadState = Literal["received", "reading", "done", "failed"]
AuditState = Literal["planned", "running", "done", "partial", "cancelled"]
TrailOutcome = Literal["done", "refused", "failed", "not_known"]
EVEN = 0.5


@dataclass(frozen=True)
class RejectOut:
    line: Annotated[
        int | None, Field(description="Line of the file as it came, from 1; null where no single line is at fault.")
    ]
    code: Annotated[str, Field(description="Stable code of what was wrong.")]
    text: Annotated[str, Field(description="What was got, in words.")]
    tag: Annotated[str, Field(description="The historian tag, where one is at fault.")] = ""


@dataclass(frozen=True, kw_only=True)
class UploadListed:
    """An export as it came, and what became of it, in short."""

    id: Annotated[
        str, Field(description="Identifier of the upload; the same content has the same, unless its name is its loop.")
    ]
    state: Annotated[UploadState, Field(description="received -> reading -> done or failed.")]
    filename: Annotated[str, Field(description="Name under which it was sent.")]
    size_bytes: Annotated[int, Field(description="Size as it came, in bytes.")]
    fingerprint: Annotated[
        str,
        Field(description="SHA-256 of the content: of the bytes as they came, without their gzip where they have one."),
    ]
    received_at: Annotated[str, Field(description="When it was received, ISO 8601, UTC.")]
    sent_again_at: Annotated[
        str | None,
        Field(description="When the same content came last, from which on it is kept, ISO 8601, UTC; null: once only."),
    ] = None
    ended_at: Annotated[str | None, Field(description="When reading ended, ISO 8601, UTC; null before.")]
    reason: Annotated[str | None, Field(description="Why it failed; null otherwise.")]
    error_code: Annotated[str | None, Field(description="Stable code of why it failed; null otherwise.")] = None
    waits_for_room_since: Annotated[
        str | None,
        Field(
            description="Since when there is no room on the disk to read it, ISO 8601, UTC; it is tried again "
            "every five minutes at the latest. Null: it does not wait for that."
        ),
    ] = None
    waits_for_file_since: Annotated[
        str | None,
        Field(
            description="Since when no worker that was asked to read it sees its file, ISO 8601, UTC: all need "
            "the same data folder. They are asked again every five minutes at the latest. Null: it "
            "does not wait for that."
        ),
    ] = None
    layout: Annotated[str | None, Field(description="How the file was found to be laid out; null before it is read.")]
    loops_found: Annotated[int, Field(description="How many loops were found.")]
    rows_kept: Annotated[int, Field(description="Rows of the file that gave samples.")]
    rows_refused: Annotated[int, Field(description="Rows and values that could not be used.")]
    samples_added: Annotated[int, Field(description="Samples that were not there before.")]
    samples_replaced: Annotated[
        int, Field(description="Samples that took the place of other values, which were stored before.")
    ] = 0
    reject_counts: Annotated[dict[str, int], Field(description="How many rows and values were refused, by code.")]
    notes: Annotated[list[str], Field(description="What was found out about the file, in words.")]
    tags_found: Annotated[int, Field(description="How many tags the file has.")] = 0
    times_from: Annotated[
        str | None, Field(description="Time of the first row, ISO 8601, UTC; null where its times have no date.")
    ] = None
    times_to: Annotated[str | None, Field(description="Time of the last row.")] = None
    time_zone: Annotated[
        str | None, Field(description="The zone in which times were read that tell none; `in the file` where they do.")
    ] = None
    damaged: Annotated[
        bool,
        Field(
            description="Whether a part of the file could not be read because it arrived damaged, as a gzip file "
            "that was cut or a sheet of a workbook; what could be read is kept, and `notes` say what "
            "was lost."
        ),
    ] = False


@dataclass(frozen=True, kw_only=True)
class UploadOut(UploadListed):
    """An export as it came, and what became of it."""

    loops: Annotated[list[str], Field(description="Tags of the loops that were found.")]
    rejects: Annotated[
        list[RejectOut], Field(description="The first rows and values that were refused, with line and reason.")
    ]
    tags: Annotated[
        list[dict[str, Any]],
        Field(
            description="Which tag of the file became which signal of which loop.", json_schema_extra={"default": []}
        ),
    ] = field(default_factory=list)


@dataclass(frozen=True)
class LoopOut:
    """A control loop of the plant."""

    tag: Annotated[str, Field(description="Tag of the loop.")]
    unit: Annotated[str | None, Field(description="Plant unit or area that it belongs to.")]
    type: Annotated[str | None, Field(description="flow, pressure, level, temperature, ...")]
    description: Annotated[str | None, Field(description="What it controls, in words.")]
    owner: Annotated[str | None, Field(description="Who looks after it: a person, a crew, a group.")]
    importance: Annotated[float, Field(description="Weight in rankings; 1 is usual.")]
    pv_unit: Annotated[str | None, Field(description="Engineering unit of PV and SP.")]
    pv_low: Annotated[float | None, Field(description="Low end of PV's span, in the unit of PV.")]
    pv_high: Annotated[float | None, Field(description="High end of PV's span, in the unit of PV.")]
    op_low: Annotated[float | None, Field(description="Low end of OP's span, in the unit of OP.")]
    op_high: Annotated[float | None, Field(description="High end of OP's span, in the unit of OP.")]
    integrating: Annotated[bool | None, Field(description="Whether the process integrates (a level); null: not known.")]
    moves_valve: Annotated[
        bool | None,
        Field(
            description="Stated of its OP: true, it moves a valve of its own; false, the set point of another "
            "loop, found or not; null: cascades are found from the records."
        ),
    ]
    retired: Annotated[
        bool, Field(description="Gone, or never a loop: kept, but neither audited with the plant nor counted.")
    ]
    continues: Annotated[
        str | None,
        Field(description="The tag that it had before: that loop is retired, and its notes are with this one."),
    ]
    samples_to: Annotated[
        str | None, Field(description="Time of the newest sample, ISO 8601, UTC; null where there is none.")
    ]


@dataclass(frozen=True)
class NoteOut:
    """A note on a loop."""

    id: Annotated[str, Field(description="Identifier of the note.")]
    written_at: Annotated[str, Field(description="ISO 8601, UTC.")]
    written_by: Annotated[str, Field(description="Name of the key, or `a local user without a key`.")]
    text: Annotated[str, Field(description="What was said.")]
    work_order: Annotated[str, Field(description="Number of the work order; empty: none.")]
    repaired_at: Annotated[
        str | None, Field(description="The repair that it states; verdicts before and after are compared.")
    ]
    shelved_until: Annotated[
        str | None,
        Field(
            description="Until when it leaves the loop out of what to look at first: the newest such note counts, "
            "until a repair is stated after it."
        ),
    ]
    withdrawn_at: Annotated[
        str | None,
        Field(description="Since when that repair, or that shelving, counts no longer; null: it was not withdrawn."),
    ]
    withdrawn_by: Annotated[str | None, Field(description="Who withdrew it.")]
    written_of: Annotated[
        str | None, Field(description="The tag that the loop had when it was written; null: the one that it has.")
    ] = None


@dataclass(frozen=True)
class TrendOut:
    """A loop's series, thinned to what a screen shows: of each stretch its least and greatest value are kept."""

    tag: Annotated[str, Field(description="Tag of the loop.")]
    samples: Annotated[int, Field(description="Samples in the stretch before thinning.")]
    time: Annotated[list[str], Field(description="ISO 8601, UTC.")]
    time_ms: Annotated[list[int], Field(description="The same in milliseconds since 1970, UTC.")]
    pv: Annotated[list[float | None], Field(description="Process output, in the unit of PV.")]
    op: Annotated[list[float | None], Field(description="Controller output, in the unit of OP.")]
    sp: Annotated[
        list[float | None] | None, Field(description="Set point, in the unit of PV; null where it is not recorded.")
    ]
    sp_held_since: Annotated[
        str | None,
        Field(description="When the set point at the first time was stated, where that was before it; else null."),
    ]
    mode_held_since: Annotated[str | None, Field(description="The same of the mode.")]
    automatic: Annotated[
        list[int | None] | None,
        Field(
            description="The mode as it holds: 1 automatic or cascade, 0 manual, null where it is not known; null "
            "in all where it is not recorded."
        ),
    ] = None


@dataclass(frozen=True)
class FailureOut:
    loop: Annotated[str, Field(description="Tag of the loop.")]
    code: Annotated[str, Field(description="Stable code of the failure.")]
    text: Annotated[str, Field(description="What happened, in words.")]


@dataclass(frozen=True)
class LoopsChangedOut:
    """What became of a list of loops."""

    changed: Annotated[int, Field(description="How many loops were set otherwise.")]
    unchanged: Annotated[int, Field(description="How many were so already.")]
    refused: Annotated[
        list[FailureOut], Field(description="The loops, or single values of a CSV, that could not be set, and why.")
    ]
    ignored: Annotated[list[str], Field(description="Columns of a CSV that say nothing of a loop here.")]


@dataclass(frozen=True, kw_only=True)
class AuditOut:
    """One plant-wide (or filtered) audit run."""

    id: Annotated[str, Field(description="Identifier of the run.")]
    state: Annotated[
        AuditState, Field(description="planned -> running -> done, partial where loops failed, or cancelled.")
    ]
    trigger: Annotated[str, Field(description="What started it: request, nightly, ...")]
    started_by: Annotated[
        str | None,
        Field(
            description="Name of the key, `command line`, `schedule`, or `a local user without a key`; null: not known."
        ),
    ]
    created_at: Annotated[str, Field(description="ISO 8601, UTC.")]
    ended_at: Annotated[str | None, Field(description="ISO 8601, UTC; null while it runs.")]
    total: Annotated[int, Field(description="Loops in the run.")]
    open: Annotated[int, Field(description="Loops still to do.")]
    done: Annotated[int, Field(description="Loops with a verdict.")]
    failed: Annotated[int, Field(description="Loops that failed; in a cancelled run also those that were called off.")]
    cancelled: Annotated[int, Field(description="How many of the failed ones were called off with the run.")] = 0
    failures: Annotated[list[FailureOut], Field(description="The first of the failed loops, and why.")]
    night: Annotated[str | None, Field(description="The date whose nightly run it is; null: it was asked for.")] = None
    part: Annotated[str, Field(description="Which part of the plant was asked for, in words.")] = ""
    code: Annotated[
        str | None, Field(description="`no_loops`: there was no loop with samples to audit; null: there was one.")
    ] = None
    text: Annotated[str | None, Field(description="The same in words, and what to do.")] = None

    @property
    def ended(self) -> bool:
        return self.state in ENDED

    @property
    def broken(self) -> int:
        """Loops that failed, without those that were called off."""
        return self.failed - self.cancelled


@dataclass(frozen=True)
class NightOfUnitOut:
    unit: Annotated[str | None, Field(description="Plant unit as it is now; null: none is named.")]
    sticking: Annotated[
        int, Field(description="Valves that stick (reliable verdicts); none from old records or before repairs.")
    ]


@dataclass(frozen=True)
class NightOut:
    """What the last run of the whole plant of a date said, of the loops that are in service."""

    date: Annotated[
        str, Field(description="Of the night; of a run that is no night's, of its begin by the plant's clock.")
    ]
    run: Annotated[str, Field(description="Identifier of the run.")]
    audited: Annotated[int, Field(description="Loops with a verdict.")]
    sticking: Annotated[
        int, Field(description="Valves that stick (reliable verdicts); none from old records or before repairs.")
    ]
    health: Annotated[float | None, Field(description="Mean health, weighted by importance; null: no loop has one.")]
    in_manual: Annotated[
        int,
        Field(
            description="Loops that could not be judged because they were not in automatic; one that was judged "
            "on what it did before it went to manual is none of them."
        ),
    ]
    units: Annotated[tuple[NightOfUnitOut, ...], Field(description="The same of each unit, as far as it is told.")]
    apart: Annotated[
        int,
        Field(
            description="Valves that stick of which that could be relied on when it was said, and not by then: of "
            "old records, or from before a repair."
        ),
    ]

    @property
    def of_units(self) -> dict[str | None, int]:
        """Valves that stick by unit."""
        return {of.unit: of.sticking for of in self.units}


@dataclass(frozen=True)
class TrailRowOut:
    """One thing that somebody did, or was refused."""

    id: Annotated[str, Field(description="Identifier of the row.")]
    at: Annotated[str, Field(description="ISO 8601, UTC.")]
    who: Annotated[
        str, Field(description="Name of the key, `command line`, `schedule`, or `a local user without a key`.")
    ]
    action: Annotated[
        str, Field(description="What was done: upload.receive, audit.start, loop.change, key.create, ...")
    ]
    subject: Annotated[str, Field(description="To what: an address of this service, or the id of a key.")]
    outcome: Annotated[
        TrailOutcome,
        Field(description="Whether it was done; not_known: the database went away while it was written."),
    ]
    request_id: Annotated[str | None, Field(description="As in the answer's X-Request-Id and in the log.")]
    detail: Annotated[dict[str, Any], Field(description="How it was known who asked, from which address, the status.")]


@dataclass(frozen=True)
class GroupMemberOut:
    loop: Annotated[str, Field(description="Tag of the loop.")]
    unit: Annotated[str | None, Field(description="Plant unit that it belongs to.")]
    stiction_probability: Annotated[float | None, Field(description="Probability that its valve sticks, 0 to 1.")]
    score: Annotated[
        float, Field(description="Log-odds of being the source: stiction, less what a late onset takes off.")
    ]
    coherence: Annotated[float, Field(description="How closely it moves in step with the likeliest source, 0 to 1.")]
    lag_s: Annotated[
        float | None, Field(description="By how long PV lags the likeliest source, in s; null: not in step.")
    ]
    onset: Annotated[
        str | None, Field(description="When its oscillation began, ISO 8601, UTC; null: before the record.")
    ]
    measured: Annotated[bool, Field(description="Whether the probability is measured; false: it is a prior.")]


@dataclass(frozen=True, kw_only=True)
class GroupOut:
    """Loops that oscillate together."""

    id: Annotated[str, Field(description="Number of the group.")]
    period_s: Annotated[float, Field(description="Period of the oscillation, in seconds.")]
    in_step: Annotated[
        bool, Field(description="Amplitude and phase wander together; false: only period and spectrum are alike.")
    ]
    by_chance: Annotated[bool, Field(description="So many loops may share a period by chance; false: they hardly do.")]
    chance_probability: Annotated[
        float, Field(description="Probability that so many loops share a period by chance, 0 to 1.")
    ]
    source: Annotated[
        str | None,
        Field(
            description="The likeliest source; null where no member probably sticks, where what the others share "
            "is not what that one does, or chance_probability is above 0.1."
        ),
    ]
    set_points_together: Annotated[
        bool, Field(description="Where no source is named: the set points of most members move at the same times.")
    ] = False
    members: Annotated[list[GroupMemberOut], Field(description="The likeliest source first.")]

    @property
    def sticks(self) -> bool:
        """Whether the member that comes first sticks likelier than not, though it is not named as the source."""
        return (self.members[0].stiction_probability or 0.0) > EVEN


@dataclass(frozen=True)
class ReadyOut:
    state: Annotated[
        Literal["ready", "degraded", "not_ready"],
        Field(
            description="degraded: works, but a broker is away or refuses, or database or data folder take no "
            "writes, or all connections to read from the database are in use."
        ),
    ]
    checks: Annotated[dict[str, Any], Field(description="What was looked at, and what was found.")]
