"""The plant's loops, each with its newest verdict and its history."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache
from typing import Any

from sqlalchemy import Connection

from app.errors import FieldError, LoopauditError, NotFoundError, RequestError
from app.services.audit_json.rows import FORM, KEY_FIGURES, as_row, compact, sent
from app.services.backend import Backend
from app.services.cursors import decode, identifier, page_of
from app.services.moments import iso_utc, moment_of
from app.services.plant.continuing import CONTINUES, check, check_retired, follow, taken_over
from app.services.plant.shelving import Shelf
from app.services.plant.written import marks_of, written_of
from app.services.results import FailureView, LoopsChanged, LoopView, Page
from app.storage import continuing, items, loops, verdicts
from app.storage.loops import SETTABLE, SPANS, ListFilter, LoopRow
from app.storage.types import storable

__all__ = [
    "RETIRED",
    "ListFilter",
    "change_loops",
    "find",
    "get_loop",
    "list_loops",
    "loop_health",
    "loop_health_json",
    "newest_failure",
    "patch_loop",
    "refusal",
    "unknown",
    "verdict_detail",
    "verdict_history",
    "view_of",
]

KNOWN_TYPES = ("flow", "pressure", "level", "temperature", "composition", "speed", "position", "other")
WORDS = ("unit", "type", "description", "pv_unit", "continues")
LONGEST_WORDS, MOST_IMPORTANT = 200, 1000
RETIRED: dict[str, bool | None] = {"true": True, "false": False, "any": None}
"""Which loops are asked for: those that are retired, those that are not, or both."""
OneLoop = str | LoopRow
"""A loop by its tag, or as it was found: a page asks the data base for it once."""
USUAL = {"importance": 1.0, "retired": False}
"""What a loop is where nobody says otherwise, of what it cannot be without."""


def list_loops(
    backend: Backend,
    limit: int = 100,
    cursor: str | None = None,
    wanted: ListFilter | None = None,
) -> Page[LoopView]:
    """Loops in the order of their tags; `search` of the filter is a part of the tag."""
    after = decode(cursor, (str,))
    with backend.database.read() as connection:
        rows = loops.page(connection, limit + 1, after[0] if after else None, wanted)
    return page_of(rows, limit, view_of, lambda row: (row.tag,))


def get_loop(backend: Backend, tag: str) -> LoopView:
    return view_of(find(backend, tag))


def patch_loop(
    backend: Backend, tag: str, changes: Mapping[str, Any], only_if: Callable[[LoopView], bool] | None = None
) -> LoopView:
    """Sets what `changes` names (None, or blanks, forget it), where `only_if` holds of the loop as it is; nobody else
    changes it meanwhile. Raises RequestError for an unknown field, a span that is none, ("unknown_type") for a type
    that is neither of `KNOWN_TYPES` nor of a loop of this plant, and ("changed_meanwhile") where `only_if` does not
    hold.
    """
    unknown_fields = sorted(set(changes) - set(SETTABLE))
    if unknown_fields:
        raise RequestError("unknown_field", f"a loop has no {unknown_fields[0]!r} to set; it has {', '.join(SETTABLE)}")
    with backend.database.write() as connection:
        loops.to_change(connection, loops.ids_of(connection, _named(tag, changes)).values())  # in one order for all
        row = loops.by_tag(connection, tag, to_change=True)
        if row is None:
            raise unknown(tag)
        if only_if is not None and not only_if(view_of(row)):
            text = f"loop {tag!r} is not as the request takes it to be: get it again and look at what has changed"
            raise RequestError("changed_meanwhile", text)
        values = _wanted(row, changes, lambda: loops.types(connection))
        values, earlier = _continuing(connection, row, values)
        loops.change(connection, row.id, values)
        if values[CONTINUES] != row.continues:
            follow(connection, row, earlier)
        return view_of(loops.by_ids(connection, [row.id])[row.id])


def change_loops(backend: Backend, wanted: Sequence[tuple[str, Mapping[str, Any]]]) -> LoopsChanged:
    """Sets of many loops, by tag, what `patch_loop` sets of one. Each loop is for itself: what cannot be set of one is
    refused with its code, and the others are changed.
    """
    refused: list[FailureView] = []
    with backend.database.write() as connection:
        ids = loops.ids_of(connection, sorted({one for tag, changes in wanted for one in _named(tag, changes)}))
        rows = loops.to_change(connection, ids.values())
        own_types = cache(lambda: frozenset(loops.types(connection)))
        changed: dict[int, dict[str, Any]] = {}
        before: dict[int, LoopRow | None] = {}
        for tag, changes in wanted:
            try:
                row = _named_once(tag, ids, rows, changed)
                values = _wanted(row, changes, own_types)
                changed[row.id], before[row.id] = _continuing(connection, row, values)
            except LoopauditError as error:
                refused.append(refusal(tag, error.code, error.message))
        news = {loop_id: values for loop_id, values in changed.items() if _differs(rows[loop_id], values)}
        loops.change_each(connection, news)
        for loop_id in (one for one in news if news[one][CONTINUES] != rows[one].continues):
            follow(connection, rows[loop_id], before[loop_id])
    return LoopsChanged(len(news), len(changed) - len(news), refused)


def refusal(tag: str, code: str, text: str) -> FailureView:
    """Whatever a list calls a loop: half of a letter could not be answered."""
    return FailureView(storable(tag), code, storable(text))


def _named(tag: str, changes: Mapping[str, Any]) -> list[str]:
    """The tags that a change is about, as far as they can be stored."""
    earlier = changes.get(CONTINUES)
    return sorted({one for one in (tag, earlier) if isinstance(one, str) and storable(one) == one})


def _continuing(connection: Connection, row: LoopRow, values: dict[str, Any]) -> tuple[dict[str, Any], LoopRow | None]:
    """The values, with what the loop takes of the one that it continues from now on, and that one."""
    anew = values[CONTINUES] not in (row.continues, None)
    earlier = check(connection, row.tag, values[CONTINUES]) if anew else None
    if row.retired and not values["retired"]:
        check_retired(connection, row.tag)
    return values | (taken_over(values, earlier) if earlier else {}), earlier


def _named_once(tag: str, ids: Mapping[str, int], rows: Mapping[int, LoopRow], changed: Mapping[int, Any]) -> LoopRow:
    if tag not in ids:
        raise unknown(tag)
    if ids[tag] in changed:
        raise RequestError("named_twice", f"loop {tag!r} is named twice; the first time counts")
    return rows[ids[tag]]


def _differs(row: LoopRow, values: Mapping[str, Any]) -> bool:
    return any(getattr(row, name) != value for name, value in values.items())


def _wanted(row: LoopRow, changes: Mapping[str, Any], own_types: Callable[[], Collection[str]]) -> dict[str, Any]:
    """own_types: those that loops of this plant have."""
    wanted = {name: changes.get(name, getattr(row, name)) for name in SETTABLE}
    wanted |= {name: _stripped(wanted[name]) for name in WORDS if name in changes}
    wanted |= {name: usual for name, usual in USUAL.items() if wanted[name] is None}
    _check_values(wanted)
    _check_spans(wanted)
    if wanted["type"] != row.type:
        _check_type(wanted["type"], own_types)
    return wanted


def loop_health(backend: Backend, tag: str, shelved: Shelf | None = None) -> dict[str, Any]:
    """The newest verdict and the key figures, flat; shelved: None: as of now. Raises NotFoundError where the loop was
    never audited."""
    with backend.database.read() as connection:
        found = verdicts.newest(connection, tag)
    if found is None:
        raise unknown(tag)
    loop_id, newest = found
    if newest is None:
        raise NotFoundError("not_audited", f"loop {tag!r} has not been audited yet")
    figures = newest.get(KEY_FIGURES)
    if figures is None:  # a verdict that an older version wrote
        with backend.database.read() as connection:
            figures = (verdicts.detail(connection, loop_id, newest["audit_id"]) or {}).get(KEY_FIGURES, {})
    row = as_row(newest)
    return written_of(backend, [row], shelved).beside(row) | figures


def loop_health_json(backend: Backend, tag: str) -> str:
    """`loop_health` as JSON, in most cases as it was written with the verdict."""
    with backend.database.read() as connection:
        written = verdicts.sent_health(connection, tag, FORM)
    if written is None or marks_of(backend, [tag]).tags:
        return compact(loop_health(backend, tag))
    row, figures, unit = written
    return sent(row, unit, figures)


def verdict_history(
    backend: Backend, loop: OneLoop, limit: int = 100, cursor: str | None = None
) -> Page[dict[str, Any]]:
    """A loop's verdicts, the newest first."""
    row = find(backend, loop)
    before = decode(cursor, (int,))
    with backend.database.read() as connection:
        found = verdicts.history(connection, row.id, limit + 1, before[0] if before else None)
    return page_of(found, limit, as_row, lambda verdict: (verdict["audit_id"],))


def chained_history(backend: Backend, loop: OneLoop, limit: int) -> list[dict[str, Any]]:
    """The same with the verdicts of the loops that it continues behind its own, `loop` of each the tag that it had."""
    row = find(backend, loop)
    with backend.database.read() as connection:
        before = continuing.earlier_of(connection, [row.tag]).get(row.tag, [])
    told: list[dict[str, Any]] = []
    chain: tuple[OneLoop, ...] = (row, *before)
    for one in chain:
        told += verdict_history(backend, one, limit - len(told)).rows if len(told) < limit else []
    return told


def newest_failure(backend: Backend, loop: OneLoop) -> tuple[int, str] | None:
    """Run and reason where the audit of a loop has failed since its newest verdict."""
    row = find(backend, loop)
    with backend.database.read() as connection:
        return items.newest_failure(connection, row.id, row.newest_audit_id or 0)


def verdict_detail(backend: Backend, loop: OneLoop, audit_id: str | None = None) -> dict[str, Any]:
    """What a verdict rests on: findings, rungs with their curves, spectra. Without `audit_id`: the newest verdict."""
    row = find(backend, loop)
    run = row.newest_audit_id if audit_id is None else identifier(audit_id)
    with backend.database.read() as connection:
        found = verdicts.detail(connection, row.id, run or 0)
    if found is None:
        raise NotFoundError("not_audited", f"loop {row.tag!r} has no verdict from this run")
    return found


def find(backend: Backend, loop: OneLoop) -> LoopRow:
    """Raises NotFoundError for a tag that no loop has."""
    if isinstance(loop, LoopRow):
        return loop
    with backend.database.read() as connection:
        row = loops.by_tag(connection, loop)
    if row is None:
        raise unknown(loop)
    return row


def unknown(tag: str) -> NotFoundError:
    return NotFoundError("unknown_loop", f"there is no loop {tag!r}")


def _stripped(words: str | None) -> str | None:
    return (words or "").replace("\x00", "").strip() or None


def _check_type(type_: str | None, own_types: Callable[[], Collection[str]]) -> None:
    """What a plant's mapping calls its loops is known as well."""
    if type_ is None or type_ in KNOWN_TYPES or type_ in own_types():
        return
    known = ", ".join(dict.fromkeys((*KNOWN_TYPES, *sorted(own_types()))))
    raise FieldError("unknown_type", f"{type_[:40]!r} is no type of loop; there are {known}", "type")


def _check_values(wanted: Mapping[str, Any]) -> None:
    if not 0.0 <= wanted["importance"] <= MOST_IMPORTANT:
        text = f"importance is 0 to {MOST_IMPORTANT:g}, got {wanted['importance']:g}"
        raise FieldError("bad_value", text, "importance")
    for name in WORDS:
        if wanted[name] is not None and len(wanted[name]) > LONGEST_WORDS:
            text = f"{name} has {len(wanted[name])} characters; at most {LONGEST_WORDS} are kept"
            raise FieldError("bad_value", text, name)


def _check_spans(wanted: Mapping[str, Any]) -> None:
    for low, high in SPANS:
        ends = (wanted[low], wanted[high])
        if any(end is not None and not math.isfinite(end) for end in ends):
            raise FieldError("bad_span", f"{low} and {high} must be finite numbers", low)
        if None not in ends and ends[0] >= ends[1]:
            raise FieldError("bad_span", f"{low} must be below {high}, got {ends[0]} and {ends[1]}", low)


def view_of(row: LoopRow) -> LoopView:
    own = {name: getattr(row, name) for name in ("tag", *SETTABLE)}
    return LoopView(**own, samples_to=None if row.newest_ns is None else iso_utc(moment_of(row.newest_ns)))
