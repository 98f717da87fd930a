"""What services answer with, beside what goes out as it is (`outward`). Times are ISO 8601 in UTC, ids are strings."""

from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

from app.services.outward import UploadOut

Row = TypeVar("Row")


@dataclass(frozen=True)
class Page(Generic[Row]):
    """Some rows, and where the next ones start (None: these are the last)."""

    rows: list[Row]
    next_cursor: str | None


@dataclass(frozen=True)
class Receipt:
    """The bytes are stored and synced. `created` is False where this content had been sent before."""

    upload: UploadOut
    created: bool


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
