"""What goes in over HTTP, and the pages that go out: each field with its meaning and its unit. OpenAPI is made from
this and from what services answer with, `app.services.outward`.
"""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

from app.http.backend import IsoTime
from app.services.audit_json.models import KeyFiguresLine, ReliabilityRow, TableRow
from app.services.outward import AuditOut, GroupOut, LoopOut, NightOut, NoteOut, TrailRowOut, UploadListed
from app.services.stating.notes import LONGEST_TEXT, LONGEST_WORK_ORDER
from app.services.stating.properties import KNOWN_TYPES, LONGEST_WORDS, MOST_IMPORTANT

CSV: dict[int | str, dict[str, Any]] = {200: {"content": {"text/csv": {"schema": {"type": "string"}}}}}
"""In the responses of a route that answers with a table."""


class AnyPage(BaseModel):
    """Some rows, made from a service's page of them."""

    model_config = ConfigDict(from_attributes=True)

    rows: list[Any]
    next_cursor: str | None = Field(description="Give it as `cursor` for the next page; null on the last.")


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


class NotePage(AnyPage):
    rows: list[NoteOut] = Field(description="Notes, the newest first.")


class UploadPage(AnyPage):
    rows: list[UploadListed] = Field(
        description="Uploads, the newest first; their `loops` and `rejects` are at `GET /v1/uploads/{id}`."
    )


class LoopPage(AnyPage):
    rows: list[LoopOut] = Field(description="Loops in the order of their tags.")


class VerdictPage(AnyPage):
    rows: list[ReliabilityRow] = Field(description="Verdicts of one loop, the newest first.")


class ReliabilityPage(AnyPage):
    rows: list[TableRow] = Field(description="One row a loop: its newest verdict.")


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


class AuditPage(AnyPage):
    rows: list[AuditOut] = Field(description="Runs, the newest first.")


class NightsPage(AnyPage):
    rows: list[NightOut] = Field(description="The newest fourteen dates, the oldest first.")
    next_cursor: str | None = Field(description="Always null: all fit into one page.")


class TrailPage(AnyPage):
    rows: list[TrailRowOut] = Field(description="What was done, the newest first.")


class GroupPage(AnyPage):
    rows: list[GroupOut] = Field(description="Groups in step first, the larger ones first.")
    next_cursor: str | None = Field(description="Always null: there is one page.")


class HealthOut(TableRow, KeyFiguresLine):
    """The newest verdict of a loop and its key figures, flat, for dashboards."""
