"""The per-loop reliability table, and the plant in a few numbers."""

from collections import Counter
from typing import Any

from app.errors import RequestError
from app.services.audits import list_audits
from app.services.backend import Backend
from app.services.cursors import decode, encode
from app.services.results import Page, PlantSummary
from app.services.rows import as_row
from app.storage import verdicts
from app.storage.loops import count as count_loops
from app.storage.verdicts import SORTABLE, After, RowFilter

MOST_ROWS = 20_000
ANYTHING: tuple[type, ...] = (object,)

__all__ = ["RowFilter", "plant_summary", "reliability_page", "sortable"]


def sortable() -> tuple[str, ...]:
    """Names to sort by; a minus before one turns the order round."""
    return tuple(sorted({*SORTABLE} - {"extra_json"}))


def reliability_page(
    backend: Backend,
    limit: int = 1000,
    cursor: str | None = None,
    sort: str = "loop",
    filters: RowFilter | None = None,
) -> Page[dict[str, Any]]:
    """One row a loop, its newest verdict. `sort`: a name of `sortable()`, `-name` for descending; unknowns last."""
    if not 1 <= limit <= MOST_ROWS:
        raise RequestError("bad_limit", f"limit must be from 1 to {MOST_ROWS}, got {limit}")
    name = sort.removeprefix("-")
    if name not in SORTABLE:
        raise RequestError("bad_sort", f"cannot sort by {name!r}; there is {', '.join(sortable())}")
    with backend.database.read() as connection:
        after = _after(cursor, sort)
        rows = verdicts.table(connection, limit + 1, name, sort.startswith("-"), filters or RowFilter(), after)
    more = len(rows) > limit
    last = rows[limit - 1] if more else None
    following = encode(sort, last["tag" if name == "loop" else name], last["tag"]) if last else None
    return Page([as_row(row) for row in rows[:limit]], following)


def plant_summary(backend: Backend) -> PlantSummary:
    """Counts over the newest verdict of each loop."""
    with backend.database.read() as connection:
        known = count_loops(connection)
        counted = verdicts.counts(connection, ("unit", "verdict", "reliability", "likely_cause"))
    totals: list[Counter[str]] = [Counter(), Counter(), Counter()]
    units: dict[str | None, Counter[str]] = {}
    for unit, verdict, reliability, cause, count in counted:
        for total, value in zip(totals, (verdict, reliability, cause), strict=True):
            if value is not None:
                total[value] += count
        units.setdefault(unit, Counter())[verdict] += count
    newest = list_audits(backend, limit=1).rows
    return PlantSummary(
        loops=known,
        audited=sum(totals[0].values()),
        verdicts=dict(totals[0]),
        reliability=dict(totals[1]),
        likely_causes=dict(totals[2]),
        units=[{"unit": unit, **verdict} for unit, verdict in sorted(units.items(), key=lambda u: u[0] or "")],
        newest_audit=newest[0] if newest else None,
    )


def _after(cursor: str | None, sort: str) -> After | None:
    values = decode(cursor, (str, ANYTHING, str))
    if values is None:
        return None
    if values[0] != sort:
        raise RequestError("bad_cursor", f"this cursor belongs to sort={values[0]!r}, not to sort={sort!r}")
    return After(values[1], values[2])
