"""What services answer with. Times are ISO 8601 in UTC, ids are strings."""

from dataclasses import dataclass, field
from typing import Any, Generic, Literal, TypeVar

from app.storage.audits import ENDED

UploadState = Literal["received", "reading", "done", "failed"]
AuditState = Literal["planned", "running", "done", "partial", "cancelled"]
Row = TypeVar("Row")


@dataclass(frozen=True)
class Page(Generic[Row]):
    """Some rows, and where the next ones start (None: these are the last)."""

    rows: list[Row]
    next_cursor: str | None


@dataclass(frozen=True)
class RejectView:
    """A row or value that could not be used; `line` counts from 1, None where no single line is at fault."""

    line: int | None
    code: str
    text: str
    tag: str


@dataclass(frozen=True)
class UploadView:
    """An export as it came, and what became of it. `rejects` lists the first; `reject_counts` is exact by code.
    damaged: a part of the file was lost on its way here."""

    id: str
    state: UploadState
    filename: str
    size_bytes: int
    fingerprint: str
    received_at: str
    sent_again_at: str | None
    ended_at: str | None
    reason: str | None
    error_code: str | None
    waits_for_room_since: str | None
    waits_for_file_since: str | None
    layout: str | None
    loops: list[str]
    loops_found: int
    rows_kept: int
    rows_refused: int
    samples_added: int
    samples_replaced: int
    reject_counts: dict[str, int]
    rejects: list[RejectView]
    notes: list[str]
    tags_found: int = 0
    times_from: str | None = None
    times_to: str | None = None
    time_zone: str | None = None
    damaged: bool = False
    tags: list[dict[str, Any]] = field(default_factory=list)


@dataclass(frozen=True)
class Receipt:
    """The bytes are stored and synced. `created` is False where this content had been sent before."""

    upload: UploadView
    created: bool


@dataclass(frozen=True)
class LoopView:
    """A control loop. Spans are in the unit of their signal; `samples_to` is the newest sample's time; `moves_valve`:
    stated of its OP, None where nobody did; `retired`: not audited, not counted; `continues`: the tag that it had
    before."""

    tag: str
    unit: str | None
    type: str | None
    description: str | None
    owner: str | None
    importance: float
    pv_unit: str | None
    pv_low: float | None
    pv_high: float | None
    op_low: float | None
    op_high: float | None
    integrating: bool | None
    moves_valve: bool | None
    retired: bool
    continues: str | None
    samples_to: str | None


@dataclass(frozen=True)
class FailureView:
    loop: str
    code: str
    text: str


@dataclass(frozen=True)
class LoopsChanged:
    """How many loops were set otherwise, how many were so already, and which could not be set; ignored: columns of a
    list that say nothing of a loop here."""

    changed: int
    unchanged: int
    refused: list[FailureView]
    ignored: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class AuditView:
    """A run and its progress: total = open + done + failed (claimed loops count as open); cancelled: of the failed
    ones those that were called off with the run. night: the date whose nightly run it is. part: which part of the
    plant was asked for, in words. code, text: why there was nothing to audit; None where there was."""

    id: str
    state: AuditState
    trigger: str
    created_at: str
    ended_at: str | None
    total: int
    open: int
    done: int
    failed: int
    failures: list[FailureView]
    started_by: str | None = None
    cancelled: int = 0
    night: str | None = None
    part: str = ""
    code: str | None = None
    text: str | None = None

    @property
    def ended(self) -> bool:
        return self.state in ENDED

    @property
    def broken(self) -> int:
        """Loops that failed, without those that were called off."""
        return self.failed - self.cancelled


@dataclass(frozen=True)
class TrendView:
    """A loop's series for a screen: of each stretch its least and greatest value. NaN became None.

    sp_held_since, mode_held_since: when what holds at the first sample was stated, where that was before it. automatic:
    1, 0, None where the mode is not known."""

    tag: str
    samples: int
    time: list[str]
    pv: list[float | None]
    op: list[float | None]
    sp: list[float | None] | None
    time_ms: list[int] = field(default_factory=list)
    sp_held_since: str | None = None
    mode_held_since: str | None = None
    automatic: list[int | None] | None = None


@dataclass(frozen=True)
class Readiness:
    """`state` is degraded where what is stored can be read and the broker is away, or nothing can be written, to
    data base or data folder, or who reads has to wait; `checks` holds a word or a number for each thing."""

    state: Literal["ready", "degraded", "not_ready"]
    checks: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class SweepReport:
    """What a sweep, or one of its duties, found: loops taken back from dead workers, runs ended, messages sent again,
    the night begun."""

    reopened: int = 0
    failed: int = 0
    ended: int = 0
    announced: int = 0
    nightly: str | None = None

    def __add__(self, other: "SweepReport") -> "SweepReport":
        return SweepReport(
            self.reopened + other.reopened,
            self.failed + other.failed,
            self.ended + other.ended,
            self.announced + other.announced,
            self.nightly or other.nightly,
        )


@dataclass(frozen=True)
class KeyView:
    """A key without its secret. `state` is active, expired or revoked; `id` is the part that may be told.
    `followed_by`: the id of the key that it was rotated for."""

    id: str
    name: str
    role: str
    state: str
    requests_per_minute: int
    created_at: str
    expires_at: str | None
    revoked_at: str | None
    last_used_at: str | None
    followed_by: str | None


@dataclass(frozen=True)
class TrailView:
    """One thing that somebody did, or was refused. `outcome` is done, refused, failed, or not_known
    where the data base went away while it was written."""

    id: str
    at: str
    who: str
    action: str
    subject: str
    outcome: str
    request_id: str | None
    detail: dict[str, Any]


@dataclass(frozen=True)
class GroupMember:
    """A loop of a group. `score`: log-odds of being the source; `lag_s`: after the likeliest source, None: not told;
    `measured`: whether the probability is more than a prior."""

    loop: str
    unit: str | None
    stiction_probability: float | None
    score: float
    coherence: float
    lag_s: float | None
    onset: str | None
    measured: bool = True


EVEN = 0.5


@dataclass(frozen=True)
class GroupView:
    """Loops that oscillate together, the likeliest source first. `source` is None where no member probably sticks, and
    where what the others share is not what it does.

    `by_chance`: so many loops may share a period without having anything to do with each other; where that is likelier
    than `app.engine.plant_wide.groups.UNNAMED`, no source is named. `set_points_together`: whether, where none is, the
    set points of most members move at the same times.
    """

    id: str
    period_s: float
    in_step: bool
    by_chance: bool
    chance_probability: float
    source: str | None
    members: list[GroupMember]
    set_points_together: bool = False

    @property
    def sticks(self) -> bool:
        """Whether the member that comes first sticks likelier than not, though it is not named as the source."""
        return (self.members[0].stiction_probability or 0.0) > EVEN


@dataclass(frozen=True)
class NoteView:
    """What people wrote about a loop; `repaired_at` parts its verdicts into before and after, until it is withdrawn;
    until `shelved_until` it leads no list of what to look at first."""

    id: str
    written_at: str
    written_by: str
    text: str
    work_order: str
    repaired_at: str | None
    shelved_until: str | None = None
    withdrawn_at: str | None = None
    withdrawn_by: str | None = None
    written_of: str | None = None


ChangedBy = Literal["first", "method", "repair", "auditable", "data", "loop"]
Kind = Literal["new", "cured", "flipped", "wavers"]


@dataclass(frozen=True)
class ChangeView:
    """A loop whose verdict is another one than before. `why`: what changed, `because` the same in words. "wavers": a
    change that is no news, because neither verdict nor evidence is sure. weakly: whether it could as well have been the
    other verdict."""

    loop: str
    unit: str | None
    kind: Kind
    before: str | None
    now: str
    why: ChangedBy
    because: str
    reasons_text: str
    health: float | None
    reliability: str
    likely_cause: str | None
    weakly: bool = False

    @property
    def said(self) -> dict[str, str | None]:
        """The verdict as a row, for the words on what stands behind it."""
        return {"verdict": self.now, "reliability": self.reliability, "likely_cause": self.likely_cause}


@dataclass(frozen=True)
class UnitView:
    """A plant unit: its loops by verdict, its mean health weighted by importance, and the sum of importances."""

    unit: str | None
    loops: int
    verdicts: dict[str, int]
    health: float | None
    importance: float


@dataclass(frozen=True)
class NightOfUnit:
    """A plant unit as it is now, None: of loops that are in none, and its valves that stick, to be relied on."""

    unit: str | None
    sticking: int


@dataclass(frozen=True)
class Night:
    """What the last whole run of a date said. sticking: valves that stick, to be relied on; health: mean, weighted by
    importance, None where no loop has one; in_manual: loops not judged because they are not in automatic, without those
    that were judged on what they did before. apart: valves that stick of which that could be relied on when it was
    said, and not by then: of old records, or from before a repair."""

    date: str
    run: str
    audited: int
    sticking: int
    health: float | None
    in_manual: int
    units: tuple[NightOfUnit, ...]
    apart: int = 0

    @property
    def of_units(self) -> dict[str | None, int]:
        """Valves that stick by unit."""
        return {of.unit: of.sticking for of in self.units}
