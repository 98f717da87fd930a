"""What the service answers, as types."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal, Self


@dataclass(frozen=True, kw_only=True)
class Answer:
    raw: Mapping[str, Any] = field(repr=False, default_factory=dict)

    @classmethod
    def of(cls, sent: Mapping[str, Any]) -> Self:
        """From the service's JSON; a field that an older service does not send is None."""
        own = {f.name: sent.get(f.name) for f in fields(cls) if f.name != "raw"}
        return cls(raw=sent, **own)


@dataclass(frozen=True, kw_only=True)
class Loop(Answer):
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


@dataclass(frozen=True, kw_only=True)
class LoopsChanged(Answer):
    """`refused`: loop, code and text of each that could not be set."""

    changed: int
    unchanged: int
    refused: list[dict[str, str]]


@dataclass(frozen=True, kw_only=True)
class Row(Answer):
    """A verdict: a row of the reliability table, of a loop's history, or its health with the key figures in `raw`. What
    is written of the loop (from `next_step` on) is None in a history."""

    loop: str
    unit: str | None
    verdict: Literal["stiction", "no_stiction", "inconclusive", "not_auditable"]
    stiction_probability: float | None
    reliability: Literal["reliable", "not_reliable"]
    health: float | None
    likely_cause: str | None
    reasons: str
    reasons_text: str
    yper_pct: float | None
    hammerstein_d: float | None
    hammerstein_S: float | None
    hammerstein_J: float | None
    stiction_band_pct_of_op_range: float | None
    oscillation_period_s: float | None
    samples: int
    window_start: str | None
    window_end: str | None
    audited_at: str | None
    audited_at_ms: int | None
    audit_id: str | None
    engine_version: str
    next_step: str | None
    work_order: str | None
    repaired_at: str | None
    shelved_until: str | None
    of_before_repair: bool | None
    of_old_record: bool | None


@dataclass(frozen=True, kw_only=True)
class Upload(Answer):
    id: str
    state: Literal["received", "reading", "done", "failed"]
    filename: str
    size_bytes: int
    fingerprint: str
    reason: str | None
    error_code: str | None
    waits_for_room_since: str | None
    waits_for_file_since: str | None
    layout: str | None
    loops: list[str]
    rows_kept: int
    rows_refused: int
    samples_added: int
    samples_replaced: int

    @property
    def ended(self) -> bool:
        return self.state in ("done", "failed")


@dataclass(frozen=True, kw_only=True)
class Audit(Answer):
    id: str
    state: Literal["planned", "running", "done", "partial", "cancelled"]
    trigger: str
    created_at: str
    ended_at: str | None
    total: int
    open: int
    done: int
    failed: int
    code: str | None
    text: str | None

    @property
    def ended(self) -> bool:
        return self.state in ("done", "partial", "cancelled")


@dataclass(frozen=True, kw_only=True)
class Note(Answer):
    """What somebody wrote of a loop: a text, a work order, a repair, or until when it is shelved."""

    id: str
    written_at: str
    written_by: str
    text: str
    work_order: str
    repaired_at: str | None
    shelved_until: str | None
    withdrawn_at: str | None
    withdrawn_by: str | None
    written_of: str | None


@dataclass(frozen=True, kw_only=True)
class Explanation(Answer):
    """A loop's recording against a simulation; what a list leaves out (from `simulation` on) is None there."""

    id: str
    loop: str
    state: Literal["open", "done", "failed"]
    asked_at: str
    asked_by: str | None
    ended_at: str | None
    window_start: str | None
    window_end: str | None
    verdict: Literal["missing_physics", "consistent", "inconclusive"] | None
    effect_codes: list[str]
    error_code: str | None
    error_text: str | None
    waits_for_room_since: str | None
    simulation: Literal["trace", "column", "model", "identified"] | None
    effects: list[dict[str, Any]] | None
    located: dict[str, Any] | None
    fit: dict[str, Any] | None
    model: dict[str, Any] | None

    @property
    def ended(self) -> bool:
        return self.state in ("done", "failed")


@dataclass(frozen=True, kw_only=True)
class Group(Answer):
    """Loops that oscillate together; `members`: the likeliest source first."""

    id: str
    period_s: float
    in_step: bool
    by_chance: bool
    chance_probability: float
    source: str | None
    set_points_together: bool | None
    members: list[dict[str, Any]]


@dataclass(frozen=True, kw_only=True)
class Trend(Answer):
    tag: str
    samples: int
    time: list[str]
    time_ms: list[int]
    pv: list[float | None]
    op: list[float | None]
    sp: list[float | None] | None
    automatic: list[int | None] | None
