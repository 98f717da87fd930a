"""The per-loop reliability table: the newest verdict of every loop, as JSON or as CSV."""

from enum import StrEnum
from typing import Annotated, Any

from fastapi import APIRouter, Query
from starlette.responses import JSONResponse, Response

from app.api.backend import Cursor, Services
from app.api.models import ReliabilityPage
from app.api.problems import responses
from app.services import reliability as service
from app.services.audit_line import ReliabilityRow
from app.services.spreadsheet import csv_lines

LARGEST_PAGE = 20_000
COLUMNS = tuple(ReliabilityRow.model_fields)
CSV = {200: {"content": {"text/csv": {"schema": {"type": "string"}}}}}

router = APIRouter(tags=["reliability"])


class Format(StrEnum):
    json = "json"
    csv = "csv"


Limit = Annotated[int, Query(ge=1, le=LARGEST_PAGE, description="Rows a page.")]
Sort = Annotated[str | None, Query(max_length=60, description="A column; `-` before it turns the order around.")]
Filters = Annotated[service.RowFilter, Query()]


@router.get(
    "/reliability",
    response_model=ReliabilityPage,
    responses={**responses(400, 422), **CSV},
    summary="The reliability table of the plant",
)
def reliability(
    backend: Services,
    filters: Filters,
    limit: Limit = 1000,
    cursor: Cursor = None,
    sort: Sort = None,
    format: Format = Format.json,
) -> Any:
    """One row a loop, its newest verdict. `next_cursor` is always there and null on the last page.

    As CSV, texts that a spreadsheet would calculate begin with an apostrophe; the cursor is in X-Next-Cursor.
    """
    page = service.reliability_page(backend, limit=limit, cursor=cursor, sort=sort, filters=filters)
    if format is Format.csv:
        headers = {
            "Content-Disposition": 'attachment; filename="reliability.csv"',
            "X-Next-Cursor": page.next_cursor or "",
        }
        text = "".join(csv_lines(page.rows, COLUMNS))
        return Response(text, media_type="text/csv; charset=utf-8", headers=headers)
    # The rows are what the table's model made; checking 20,000 of them again would take longer than reading them.
    return JSONResponse({"rows": page.rows, "next_cursor": page.next_cursor})
