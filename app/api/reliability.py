"""The per-loop reliability table: the newest verdict of every loop, as JSON or as CSV."""

from collections.abc import AsyncIterator, Iterator
from enum import StrEnum
from typing import Annotated, Any

from fastapi import APIRouter, Query
from fastapi.concurrency import run_in_threadpool
from pydantic import BaseModel, BeforeValidator, Field
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from app.api.etags import NOT_MODIFIED, InParts, in_turn, known, tag_of
from app.api.loops import WhichRetired
from app.api.models import CSV, ReliabilityPage
from app.errors import RequestError
from app.http.backend import CURSOR, Services
from app.http.problems import responses
from app.services.audit_json.models import ReadingName, ReliabilityName, TableRow, VerdictName
from app.services.auditing.audits import get_audit
from app.services.backend import Backend
from app.services.cursors import LONGEST as LONGEST_CURSOR
from app.services.cursors import identifier
from app.services.loops import RETIRED
from app.services.plant import reliability as service
from app.services.spreadsheet import BYTE_ORDER_MARK, csv_lines, csv_text
from app.services.telling.health_classes import BOUNDS, HEALTH_WORDS, HealthClass

COLUMNS = tuple(TableRow.model_fields)
CHOOSABLE = (*COLUMNS, *service.OF_LOOP)
ALL = "all"
ELSEWHERE = tuple(name for name in service.sortable() if name in service.OF_LOOP and name not in COLUMNS)
BY_WORDS = tuple(name for name in service.sortable() if name not in CHOOSABLE)
SORTING = (
    f"One of {', '.join(service.sortable())}; `-` before it turns the order around. Of these {', '.join(ELSEWHERE)} "
    f"are the loop's and stand in no row unless `columns` names them; {', '.join(BY_WORDS)} are orders by the words "
    "that people are told in place of codes."
)

PARTS_AT_ONCE = 2  # of whole tables, each of some 10 MB while it is made

router = APIRouter(tags=["reliability"])


class Format(StrEnum):
    json = "json"
    csv = "csv"


def parted(given: Any) -> Any:
    """Values given one by one, with commas between, or both."""
    if not isinstance(given, list) or not all(isinstance(one, str) for one in given):
        return given
    return [value.strip() for one in given for value in one.split(",")]


HEALTH_CLASSES = ", ".join(f"`{name}` ({words})" for name, words in HEALTH_WORDS.items())


READ_APART = {"verdict", "audit_id", "retired", "health_class"}
"""Filters that are not handed on as they are given."""


class RowFilters(BaseModel):
    """Which rows; all filters that are given must hold."""

    verdict: Annotated[list[VerdictName], BeforeValidator(parted)] = Field(
        [], description="Only these verdicts; may be given several times, or several with commas between."
    )
    reliability: ReliabilityName | None = Field(None, description="Only verdicts of this reliability.")
    table2_reading: ReadingName | None = Field(None, description="Only this reading of table 2.")
    unit: str | None = Field(None, max_length=200, description="Only loops of this plant unit.")
    no_unit: bool | None = Field(None, description="true: loops that name no unit; false: those that name one.")
    type: str | None = Field(None, max_length=200, description="Only loops of this type.")
    owner: str | None = Field(None, max_length=200, description="Only loops that this owner looks after.")
    likely_cause: str | None = Field(
        None, max_length=100, description="Only this likely cause; `data`: not auditable, and no cause is named."
    )
    min_probability: float | None = Field(
        None, ge=0, le=1, allow_inf_nan=False, description="Least probability of stiction."
    )
    health_class: HealthClass | None = Field(None, description=f"Only loops whose health is so: {HEALTH_CLASSES}.")
    open_order: bool | None = Field(
        None, description="true: with a work order that no repair was stated since; false: without one."
    )
    audit_id: str | None = Field(None, max_length=40, description="The verdicts of this run instead of the newest.")
    search: str | None = Field(None, max_length=200, description="Part of a tag, of a description or of an owner.")
    retired: WhichRetired | None = Field(
        None,
        description="true: loops that are retired; false: those that are not; any: both. None: false, or with "
        "audit_id any: what a run found stays.",
    )

    def filters(self) -> service.RowFilter:
        given = self.model_dump(include={*RowFilters.model_fields} - READ_APART)
        run = None if self.audit_id is None else identifier(self.audit_id)
        health = None if self.health_class is None else BOUNDS[self.health_class]
        retired = RETIRED[self.retired or ("false" if run is None else "any")]
        return service.RowFilter(
            verdict=tuple(self.verdict) or None, audit_id=run, retired=retired, health=health, **given
        )


class TableQuery(RowFilters):
    """Which rows, in which order."""

    limit: int = Field(1000, ge=1, le=service.MOST_ROWS, description="Rows a page.")
    cursor: str | None = Field(None, max_length=LONGEST_CURSOR, description=CURSOR)
    sort: str = Field("loop", max_length=60, description=SORTING)
    format: Format = Field(Format.json, description="json or csv.")
    columns: str | None = Field(
        None,
        max_length=4000,
        description="Columns in the order wanted, with commas between: the fields of a row and "
        f"{', '.join(service.OF_LOOP)}; `{ALL}`: all of these; none: the fields of a row. As JSON, rows then have "
        "these alone.",
    )
    byte_order_mark: bool = Field(
        False, description="As CSV: begins with the mark by which spreadsheets know UTF-8; programs want none."
    )
    raw: bool = Field(
        False,
        description="As CSV: texts as they are, without the apostrophe that keeps a spreadsheet from calculating them; "
        "for programs alone.",
    )

    @property
    def as_stored(self) -> bool:
        """Whether its rows are sent as they were written when their verdicts were made."""
        return self.format is Format.json and self.columns is None and self.audit_id is None

    @property
    def page(self) -> dict[str, Any]:
        return {"limit": self.limit, "cursor": self.cursor, "sort": self.sort, "filters": self.filters()}

    def wanted_columns(self) -> tuple[str, ...] | None:
        """Raises RequestError where a column is not there."""
        if self.columns is None:
            return None
        if self.columns == ALL:
            return CHOOSABLE
        names = tuple(dict.fromkeys(name.strip() for name in self.columns.split(",")))
        unknown = [name for name in names if name not in CHOOSABLE]
        if unknown:
            raise RequestError(
                "bad_columns", f"no column is called {unknown[0][:60]!r}; there is {', '.join(CHOOSABLE)}"
            )
        return names


Filters = Annotated[TableQuery, Query()]


@router.get(
    "/reliability",
    response_model=ReliabilityPage,
    responses={**responses(400, 404, 422), **CSV, **NOT_MODIFIED},
    summary="The reliability table of the plant",
)
async def reliability(
    request: Request,
    backend: Services,
    query: Filters,
) -> Any:
    """One row a loop, its newest verdict, or that of the run `audit_id`; where neither `retired` nor `audit_id`
    is given, none of loops that are retired. `next_cursor` is always there and null on the last page.

    As CSV, texts that a spreadsheet would calculate begin with an apostrophe, unless `raw` asks for them as they are;
    the cursor is in X-Next-Cursor, empty on the last page. It has no byte order mark, which programs would take for a
    part of the first column's name, unless `byte_order_mark` asks for it.
    Both have an ETag, which stays the same until a verdict, a loop or what is written of one changes.
    """
    found = await run_in_threadpool(looked_up, backend, query)
    written = [query.format, query.byte_order_mark, query.raw, query.wanted_columns()]
    tag = tag_of({"rows": found.version, "as": written})
    headers = {"ETag": tag}
    if known(request.headers.get("If-None-Match", ""), tag):
        return Response(status_code=304, headers=headers)
    if query.as_stored:
        return InParts(await run_in_threadpool(found.as_json), media_type="application/json", headers=headers)
    media_type, parts = "application/json", found.json_parts(query.wanted_columns())
    if query.format is Format.csv:
        media_type, parts = "text/csv; charset=utf-8", as_csv(found, query)
        headers["Content-Disposition"] = 'attachment; filename="reliability.csv"'
        headers["X-Next-Cursor"] = found.next_cursor or ""
    others = in_turn(parts, request.app.state.table_places)
    first = await anext(others)  # made before anything goes out: what is wrong by then is told as it is
    if len(found.asked) <= service.PART_ROWS:
        return InParts(b"".join([first, *[part async for part in others]]), media_type=media_type, headers=headers)
    return StreamingResponse(with_first(first, others), media_type=media_type, headers=headers)


async def with_first(first: bytes, others: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
    yield first
    async for part in others:
        yield part


def looked_up(backend: Backend, query: TableQuery) -> service.TableParts:
    of_loop = any(name in service.OF_LOOP for name in query.wanted_columns() or ())
    if query.audit_id is not None:
        get_audit(backend, query.audit_id)
    return service.in_parts(backend, **query.page, of_loop=of_loop)


def as_csv(found: service.TableParts, query: TableQuery) -> Iterator[bytes]:
    columns, mark = query.wanted_columns() or COLUMNS, BYTE_ORDER_MARK if query.byte_order_mark else ""

    def text(part: service.Part) -> bytes:
        return csv_text(part.rows, columns, raw=query.raw).encode()

    head, parts = (mark + "".join(csv_lines((), columns))).encode(), map(text, found.parts())
    yield head + next(parts, b"")  # no part of its own: an answer begins with what may fail
    yield from parts
