"""The per-loop reliability table, and the plant in a few numbers."""

from collections import Counter
from collections.abc import Iterable
from typing import Any

from app.errors import RequestError
from app.services.audits import list_audits
from app.services.backend import Backend
from app.services.cursors import decode, encode
from app.services.results import Page, PlantSummary
from app.services.rows import FORM, as_row, compact, sent
from app.storage import verdicts
from app.storage.loops import count as count_loops
from app.storage.verdicts import SORTABLE, After, RowFilter, SentRow

MOST_ROWS = 20_000
OF_LOOP = ("type", "importance", "priority")  # of the loop, not of its verdict
THE_SAME = {"audited_at_ms": "audited_at", "window_start_ms": "window_start", "window_end_ms": "window_end"}
ANYTHING: tuple[type, ...] = (object,)

__all__ = ["RowFilter", "checked", "plant_summary", "reliability_json", "reliability_page", "sortable"]


def sortable() -> tuple[str, ...]:
    """Names to sort by; a minus before one turns the order round."""
    return tuple(sorted({*SORTABLE, *THE_SAME} - {"extra_json"}))


def reliability_page(
    backend: Backend,
    limit: int = 1000,
    cursor: str | None = None,
    sort: str = "loop",
    filters: RowFilter | None = None,
    of_loop: bool = False,
) -> Page[dict[str, Any]]:
    """One row a loop, its newest verdict. `sort`: a name of `sortable()`, `-name` for descending; unknowns last.

    of_loop: with the loop's type and importance, and its priority.
    """
    name = checked(limit, sort)
    with backend.database.read() as connection:
        after = _after(cursor, sort)
        rows = verdicts.table(connection, limit + 1, name, sort.startswith("-"), filters or RowFilter(), after)
    more = len(rows) > limit
    last = rows[limit - 1] if more else None
    following = encode(sort, last["tag" if name == "loop" else name], last["tag"]) if last else None
    besides = OF_LOOP if of_loop else ()
    return Page([as_row(row) | {name: row[name] for name in besides} for row in rows[:limit]], following)


def reliability_json(
    backend: Backend,
    limit: int = 1000,
    cursor: str | None = None,
    sort: str = "loop",
    filters: RowFilter | None = None,
) -> str:
    """The page as JSON, `{"rows": [...], "next_cursor": ...}`: each row as it was written when its verdict was made."""
    filters = filters or RowFilter()
    if filters.audit_id is not None:
        page = reliability_page(backend, limit, cursor, sort, filters)
        return _body((compact(row) for row in page.rows), page.next_cursor)
    name = checked(limit, sort)
    with backend.database.read() as connection:
        after = _after(cursor, sort)
        rows = verdicts.sent_rows(connection, limit + 1, name, sort.startswith("-"), filters, after, FORM)
        unwritten = [row.loop_id for row in rows if row.row_json is None]
        made = verdicts.newest_of(connection, unwritten) if unwritten else {}
    last = rows[limit - 1] if len(rows) > limit else None
    written = (_written(row, made.get(row.tag)) for row in rows[:limit])
    return _body(filter(None, written), encode(sort, last.value, last.tag) if last else None)


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


def checked(limit: int, sort: str) -> str:
    """The name to sort by, of an order that there is."""
    if not 1 <= limit <= MOST_ROWS:
        raise RequestError("bad_limit", f"limit must be from 1 to {MOST_ROWS}, got {limit}")
    name = sort.removeprefix("-")
    name = THE_SAME.get(name, name)
    if name not in SORTABLE:
        raise RequestError("bad_sort", f"cannot sort by {name!r}; there is {', '.join(sortable())}")
    return name


def _written(row: SentRow, made: dict[str, Any] | None) -> str | None:
    """The row's JSON as stored, else made from its columns; None where its verdict has been dropped meanwhile."""
    if row.row_json is not None:
        return sent(row.row_json, row.unit)
    return None if made is None else compact(as_row(made))


def _body(rows: Iterable[str], next_cursor: str | None) -> str:
    return f'{{"rows":[{",".join(rows)}],"next_cursor":{compact(next_cursor)}}}'


def _after(cursor: str | None, sort: str) -> After | None:
    values = decode(cursor, (str, ANYTHING, str))
    if values is None:
        return None
    if values[0] != sort:
        raise RequestError("bad_cursor", f"this cursor belongs to sort={values[0]!r}, not to sort={sort!r}")
    return After(values[1], values[2])
