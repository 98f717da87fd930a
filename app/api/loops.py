"""The plant's loops: what they are, what was last said about each, and their series."""

from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Header, Query
from fastapi.exceptions import RequestValidationError
from starlette.requests import Request
from starlette.responses import Response

from app.api.etags import NOT_MODIFIED, InParts, known, tag_of, tagged
from app.api.models import CSV, HealthOut, LoopPage, LoopPatch, VerdictPage
from app.http.backend import Cursor, IsoTime, Limit, Services
from app.http.parameters import json_alone
from app.http.paths import LoopTag
from app.http.problems import responses
from app.services.loops import RETIRED, ListFilter, get_loop, list_loops
from app.services.moments import ns_of
from app.services.outward import LoopOut, TrendOut
from app.services.plant import loop_verdicts
from app.services.plant.trend import MOST_POINTS
from app.services.plant.trend import trend as thinned
from app.services.stating import properties
from app.services.stating.loop_list import written

router = APIRouter(tags=["loops"])

LISTED = 100
ListLimit = Annotated[
    int | None, Query(ge=1, le=1000, description=f"Rows a page; without it {LISTED} as JSON, and as CSV all of them.")
]
Search = Annotated[str | None, Query(max_length=200, description="Part of a tag, of a description or of an owner.")]
Unit = Annotated[str | None, Query(max_length=200, description="Plant unit.")]
Owner = Annotated[str | None, Query(max_length=200, description="Who looks after the loops.")]
Form = Annotated[Literal["json", "csv"], Query(alias="format", description="json or csv.")]
WhichRetired = Literal["true", "false", "any"]
Retired = Annotated[WhichRetired, Query(description="true: retired loops; false: those that are not; any: both.")]
Points = Annotated[int, Query(ge=2, le=MOST_POINTS, description="So many points at most.")]
Instant = Annotated[IsoTime | None, Query(description="ISO 8601; without an offset it is UTC.")]
From = Annotated[IsoTime | None, Query(alias="from", description="Another name of start, as explanations have it.")]
IfMatch = Annotated[str | None, Header(max_length=500, description="ETag of the loop as it is to be changed.")]
To = Annotated[IsoTime | None, Query(alias="to", description="Another name of end, as explanations have it.")]

# The routes with more behind the tag come first: a tag may hold slashes.


@router.get("/loops", response_model=LoopPage, responses={**responses(400, 422), **CSV}, summary="The plant's loops")
def loops(
    backend: Services,
    limit: ListLimit = None,
    cursor: Cursor = None,
    unit: Unit = None,
    owner: Owner = None,
    search: Search = None,
    retired: Retired = "any",
    format_: Form = "json",
) -> Any:
    """As CSV all of them at once, unless `limit` asks for a page, to be changed in a spreadsheet and sent back
    (`PATCH /v1/loops`); it begins with the byte order mark by which spreadsheets know UTF-8, and the cursor is in
    X-Next-Cursor, empty on the last page.
    """
    wanted = ListFilter(unit, owner, search, RETIRED[retired])
    if format_ == "json":
        return list_loops(backend, LISTED if limit is None else limit, cursor, wanted)
    # Whole before its first byte goes out: a database that goes away meanwhile is then told, and no list is cut short.
    body, next_cursor = written(backend, wanted, limit, cursor)
    headers = {"Content-Disposition": 'attachment; filename="loops.csv"', "X-Next-Cursor": next_cursor or ""}
    return InParts(body, media_type="text/csv; charset=utf-8", headers=headers)


@router.get(
    "/loops/{tag:path}/health",
    response_model=HealthOut,
    responses=NOT_MODIFIED | responses(404),
    summary="The newest verdict",
)
def health(request: Request, backend: Services, tag: LoopTag) -> Any:
    """The newest verdict of a loop and its key figures, flat, for dashboards; with an ETag."""
    return tagged(request, loop_verdicts.loop_health_json(backend, tag), "application/json")


@router.get(
    "/loops/{tag:path}/verdicts", response_model=VerdictPage, responses=responses(400, 404), summary="The history"
)
def verdicts(backend: Services, tag: LoopTag, limit: Limit = 100, cursor: Cursor = None) -> Any:
    return loop_verdicts.verdict_history(backend, tag, limit, cursor)


@router.get(
    "/loops/{tag:path}/trend", response_model=TrendOut, responses=responses(404, 422), summary="PV, OP, SP and mode"
)
def trend(
    backend: Services,
    tag: LoopTag,
    points: Points = 2000,
    start: Instant = None,
    end: Instant = None,
    from_: From = None,
    to: To = None,
) -> Any:
    """The series of a loop, thinned to what a screen shows: of each stretch the least and the greatest value."""
    window = {"start": one_of("start", start, from_), "end": one_of("end", end, to)}
    refuse_backwards(**window, named="start" if from_ is None else "from")
    return thinned(backend, tag, points=points, **window)


def refuse_backwards(start: datetime | None, end: datetime | None, named: str = "start") -> None:
    if start is not None and end is not None and ns_of(start) > ns_of(end):
        text = f"a window begins before it ends, got {start.isoformat()} to {end.isoformat()}"
        raise RequestValidationError([{"type": "value_error", "loc": ("query", named), "msg": text}])


def one_of(name: str, moment: datetime | None, other: datetime | None) -> datetime | None:
    """A bound that has two names; given by both it has to be the same instant."""
    if moment is not None and other is not None and ns_of(moment) != ns_of(other):
        text = f"given by two names, as {moment.isoformat()} and {other.isoformat()}; give one of them"
        raise RequestValidationError([{"type": "value_error", "loc": ("query", name), "msg": text}])
    return other if moment is None else moment


@router.get("/loops/{tag:path}", response_model=LoopOut, responses=NOT_MODIFIED | responses(404), summary="One loop")
def loop(request: Request, response: Response, backend: Services, tag: LoopTag) -> Any:
    """A loop with an ETag, which changes with what is said of it and with its samples."""
    view = get_loop(backend, tag)
    own = response.headers["ETag"] = tag_of(vars(view))
    if known(request.headers.get("If-None-Match", ""), own):
        return Response(status_code=304, headers={"ETag": own})
    return view


@router.patch(
    "/loops/{tag:path}",
    response_model=LoopOut,
    responses=responses(404, 412, 415, 422),
    dependencies=[Depends(json_alone)],
    summary="Say more about a loop",
)
def patch(response: Response, backend: Services, tag: LoopTag, changes: LoopPatch, if_match: IfMatch = None) -> Any:
    """What it answers has the ETag that the loop has from now on. A tag may hold slashes: what stands behind
    one, as in `/loops/FIC1/health`, is a part of the tag here.
    """
    only_if = None if if_match is None else lambda view: known(if_match, tag_of(vars(view)))
    view = properties.patch_loop(backend, tag, changes.model_dump(exclude_unset=True), only_if)
    response.headers["ETag"] = tag_of(vars(view))
    return view
