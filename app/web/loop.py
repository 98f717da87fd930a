"""The page of a loop, and what can be done on it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from hashlib import sha256
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Form, Query
from fastapi.responses import HTMLResponse
from pydantic import BaseModel, StringConstraints
from starlette.responses import JSONResponse, RedirectResponse, Response

from app.errors import FieldError, NotFoundError, RequestError
from app.http.backend import Caller, Identifier, Services
from app.http.paths import LoopTag
from app.services import loops
from app.services.addresses import tag_in_url
from app.services.auditing.audits import LoopFilter, start_audit
from app.services.backend import Backend
from app.services.moments import PlantClock
from app.services.outward import LoopOut
from app.services.plant.arrivals import current_ns
from app.services.plant.charts import charts as charts_of
from app.services.plant.charts import closer
from app.services.plant.groups import unnamed
from app.services.plant.listing import Listing, listing
from app.services.plant.loop_sheet import loop_head, loop_sheet
from app.services.plant.nights import nights as nights_of
from app.services.plant.worst import worst_tags
from app.services.stating import notes, properties
from app.services.stating.continuing import maybe_before
from app.services.stating.loop_list import number
from app.services.telling.reason_wording import NO_VOTE
from app.services.telling.rival_wording import worth_a_look
from app.web.explanation import newest_in_words
from app.web.rendering import page

SEE_OTHER, BAD_REQUEST, CONFLICT = 303, 400, 409
REFUSED_AT = {"notes": "notes", "settings": "settings", "explanations": "explanation"}
"""Forms that are answered by a page where they are refused, by the end of their address, and their place on the page of
the loop."""
ANSWERS = {"": None, "yes": True, "no": False}


@dataclass(frozen=True)
class TypedNote:
    """What stands in the form of a note, and why it was not taken."""

    text: str = ""
    work_order: str = ""
    repaired_at: str = ""
    shelved_until: str = ""
    refused: str | None = None


NO_NOTE_TYPED = TypedNote()

SPANS = ("pv_low", "pv_high", "op_low", "op_high")
LONGEST_FIELD = 2 * properties.LONGEST_WORDS  # as typed; what is too long to be kept is told at its field


@dataclass(frozen=True)
class SettingsForm:
    """What stands in the form of a loop's settings; `wrong`: why a field was not taken, by its name; `version`: which
    settings of the loop it was filled with; overtaken: somebody else has changed these meanwhile."""

    values: Mapping[str, str]
    wrong: Mapping[str, str] = field(default_factory=dict)
    version: str = ""
    overtaken: bool = False


Line = Annotated[str, StringConstraints(max_length=LONGEST_FIELD)]


class TypedSettings(BaseModel):
    """What a browser sends of that form."""

    importance: Line = ""
    unit: Line = ""
    type: Line = ""
    description: Line = ""
    owner: Line = ""
    pv_unit: Line = ""
    pv_low: Line = ""
    pv_high: Line = ""
    op_low: Line = ""
    op_high: Line = ""
    moves_valve: Literal["", "yes", "no"] = ""
    retired: Literal["", "yes"] = ""
    continues: Line = ""
    version: Line = ""


router = APIRouter()


@router.get("/loops/{tag:path}/charts")
def charts(
    backend: Services,
    tag: LoopTag,
    start: Annotated[datetime | None, Query(alias="from")] = None,
    end: Annotated[datetime | None, Query(alias="to")] = None,
    audit: Annotated[str | None, Query(max_length=20)] = None,
) -> JSONResponse:
    """All charts, of the newest verdict or that of an audit; from `from` to `to`: the newest trend alone, as finely as
    it is stored."""
    if start is None or end is None:
        return JSONResponse(charts_of(backend, tag, audit))
    return JSONResponse(closer(backend, tag, start, end))


@router.get("/loops/{tag:path}")
def loop(backend: Services, tag: LoopTag) -> Response:
    """Where a form was refused its address stands above the page: loaded again that is the page of its loop."""
    of, _, form = tag.rpartition("/")
    if form in REFUSED_AT and loops.spelling(backend, tag) is None and loops.spelling(backend, of):
        return back_to(of, REFUSED_AT[form])
    return _loop_page(backend, tag)


def _loop_page(
    backend: Backend, tag: str, typed: TypedNote = NO_NOTE_TYPED, settings: SettingsForm | None = None
) -> HTMLResponse:
    row, by = loops.find(backend, tag), listing(backend, current_ns(backend))
    found = loops.view_of(row)
    told: dict[str, Any] = loop_head(backend, row, by.shelf)
    written = notes.note_page(backend, row, notes.SHOWN)
    told |= {"tag": found.tag, "notes": written.rows, "older_notes": bool(written.next_cursor), "typed": typed}
    told["as_set"] = _as_set(found)
    told["settings"] = settings or told["as_set"]
    explanation = told["explanation"] = newest_in_words(backend, tag)
    told["maybe_before"] = maybe_before(backend, found.tag)
    try:
        sheet = loop_sheet(backend, row, explanation, by.shelf)
    except NotFoundError as error:
        if error.code != "not_audited":
            raise
        return page("loop.html", backend.clock, row=None, **told)
    return page(
        "loop.html",
        backend.clock,
        no_vote=NO_VOTE,
        rivals=worth_a_look(sheet["detail"].get("rivals", ())),
        last_nights=nights_of(backend, [tag]).get(tag, ()),
        beside=_beside(backend, found.tag, by),
        unnamed=unnamed,
        **(told | sheet),
    )


def _beside(backend: Backend, tag: str, by: Listing) -> tuple[str | None, str | None]:
    """The loops before and after this one among the worst that the plant's page lists; None where there is none."""
    tags = worst_tags(backend, by)
    if tag not in tags:
        return None, None
    at = tags.index(tag)
    return (tags[at - 1] if at else None), (tags[at + 1] if at + 1 < len(tags) else None)


@router.post("/loops/{tag:path}/audit")
def audit_again(backend: Services, caller: Caller, tag: LoopTag) -> RedirectResponse:
    wanted = LoopFilter(tags=(loops.get_loop(backend, tag).tag,))
    run = start_audit(backend, wanted, trigger="request", started_by=caller.who)
    return RedirectResponse(f"/runs/{run.id}", SEE_OTHER)


@router.post("/loops/{tag:path}/notes")
def note(
    backend: Services,
    caller: Caller,
    tag: LoopTag,
    text: Annotated[str, Form(max_length=2 * notes.LONGEST_TEXT)] = "",
    work_order: Annotated[str, Form(max_length=2 * notes.LONGEST_WORK_ORDER)] = "",
    repaired_at: Annotated[str, Form(max_length=40)] = "",
    shelved_until: Annotated[str, Form(max_length=40)] = "",
) -> Response:
    try:
        until = instant(backend.clock, shelved_until, "until which the loop is shelved")
        notes.add_note(backend, tag, text, work_order, instant(backend.clock, repaired_at), caller.who, until)
    except RequestError as error:
        page_again = _loop_page(backend, tag, TypedNote(text, work_order, repaired_at, shelved_until, error.message))
        page_again.status_code = BAD_REQUEST
        return page_again
    return back_to(tag, "notes")


@router.post("/loops/{tag:path}/notes/{note_id}/withdraw")
def withdraw(backend: Services, caller: Caller, tag: LoopTag, note_id: Identifier) -> RedirectResponse:
    notes.withdraw_repair(backend, tag, note_id, caller.who)
    return back_to(tag, "notes")


@router.post("/loops/{tag:path}/notes/{note_id}/unshelve")
def unshelve(backend: Services, caller: Caller, tag: LoopTag, note_id: Identifier) -> RedirectResponse:
    notes.end_shelving(backend, tag, note_id, caller.who)
    return back_to(tag, "notes")


@router.post("/loops/{tag:path}/continues")
def continues(backend: Services, tag: LoopTag, earlier: Annotated[Line, Form()] = "") -> RedirectResponse:
    """What the page offers where the loop may be another one under a new tag."""
    properties.patch_loop(backend, tag, {"continues": earlier})
    return back_to(tag, "settings")


@router.post("/loops/{tag:path}/settings")
def settings(backend: Services, tag: LoopTag, typed: Annotated[TypedSettings, Form()]) -> Response:
    numbers, wrong = _numbers(typed.model_dump(include={"importance", *SPANS}))
    stated = {"moves_valve": ANSWERS[typed.moves_valve], "retired": typed.retired == "yes"}
    overtaken = False
    only_if = (lambda view: _as_set(view).version == typed.version) if typed.version else None
    try:
        if not wrong:
            properties.patch_loop(
                backend, tag, {**typed.model_dump(include={*properties.WORDS}), **numbers, **stated}, only_if
            )
    except FieldError as error:
        wrong[error.field] = error.message
    except RequestError as error:
        if error.code != "changed_meanwhile":
            raise
        overtaken = True
    if not (wrong or overtaken):
        return back_to(tag, "settings")
    kept = "" if overtaken else typed.version
    page_again = _loop_page(
        backend, tag, settings=SettingsForm(typed.model_dump(exclude={"version"}), wrong, kept, overtaken)
    )
    page_again.status_code = CONFLICT if overtaken else BAD_REQUEST
    return page_again


def _numbers(typed: Mapping[str, str]) -> tuple[dict[str, float | None], dict[str, str]]:
    """The numbers that were typed (None: the end of a span that is not known), and what is wrong with the others."""
    numbers: dict[str, float | None] = {}
    wrong: dict[str, str] = {}
    for name, text in typed.items():
        try:
            numbers[name] = number(name, text.strip()) if text.strip() or name not in SPANS else None
        except FieldError as error:
            wrong[name] = error.message
    return numbers, wrong


def _as_set(it: LoopOut) -> SettingsForm:
    names = ("importance", *properties.WORDS, *SPANS)
    told = {name: _as_typed(getattr(it, name)) for name in names}
    answer = next(answer for answer, stated in ANSWERS.items() if stated is it.moves_valve)
    values = {**told, "moves_valve": answer, "retired": "yes" if it.retired else ""}
    return SettingsForm(values, version=sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:32])


def _as_typed(value: str | float | None) -> str:
    """As people type it: 1 and not 1.0, but all digits of 0.123456789."""
    if value is None:
        return ""
    return str(value).removesuffix(".0") if isinstance(value, float) else str(value)


def back_to(tag: str, place: str) -> RedirectResponse:
    return RedirectResponse(f"/loops/{tag_in_url(tag)}#{place}", SEE_OTHER)


def instant(clock: PlantClock, text: str, which: str = "of the repair") -> datetime | None:
    """What a date field of a browser sends, read off a clock of the plant."""
    if not text.strip():
        return None
    try:
        return clock.instant(datetime.fromisoformat(text.strip()))
    except (ValueError, OverflowError):
        raise RequestError("bad_time", f"the time {which} must be like 2026-01-31T12:00, got {text!r}") from None
