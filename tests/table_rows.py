"""The reliability table as its route gives it."""

from typing import Any

from app.services.backend import Backend
from app.services.plant.reliability import OF_LOOP, RowFilter, in_parts
from app.services.results import Page


def table_page(
    backend: Backend,
    limit: int = 1000,
    cursor: str | None = None,
    sort: str = "loop",
    filters: RowFilter | None = None,
) -> Page[dict[str, Any]]:
    """Each row made of its columns, without what is its loop's."""
    found = in_parts(backend, limit, cursor, sort, filters, of_loop=True)
    rows = [row for part in found.parts() for row in part.rows]
    return Page([{name: row[name] for name in row if name not in OF_LOOP} for row in rows], found.next_cursor)
