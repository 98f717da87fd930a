"""What people state of loops, of one or many at once: unit, type, spans, importance, and which loop one continues."""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache
from typing import Any

from sqlalchemy import Connection

from app.errors import FieldError, LoopauditError, RequestError
from app.services.backend import Backend
from app.services.loops import unknown, view_of
from app.services.outward import FailureOut, LoopOut, LoopsChangedOut
from app.services.stating.continuing import CONTINUES, check, check_retired, follow, taken_over
from app.services.telling.naming import without_commands
from app.storage import loops
from app.storage.loops import SETTABLE, SPANS, LoopRow
from app.storage.types import storable

KNOWN_TYPES = ("flow", "pressure", "level", "temperature", "composition", "speed", "position", "other")
WORDS = ("unit", "type", "description", "owner", "pv_unit", "continues")
LONGEST_WORDS, MOST_IMPORTANT = 200, 1000
USUAL = {"importance": 1.0, "retired": False}
"""What a loop is where nobody says otherwise, of what it cannot be without."""


def patch_loop(
    backend: Backend, tag: str, changes: Mapping[str, Any], only_if: Callable[[LoopOut], bool] | None = None
) -> LoopOut:
    """Sets what `changes` names (None, or blanks, forget it), where `only_if` holds of the loop as it is; nobody else
    changes it meanwhile. Raises RequestError for an unknown field, a span that is none, ("unknown_type") for a type
    that is neither of `KNOWN_TYPES` nor of a loop of this plant, and ("changed_meanwhile") where `only_if` does not
    hold.
    """
    unknown_fields = sorted(set(changes) - set(SETTABLE))
    if unknown_fields:
        raise RequestError("unknown_field", f"a loop has no {unknown_fields[0]!r} to set; it has {', '.join(SETTABLE)}")
    with backend.database.write() as connection:
        spelled = loops.as_spelled(connection, _named(tag, changes))
        loops.to_change(connection, loops.ids_of(connection, [*spelled.values()]).values())  # in one order for all
        row = loops.by_tag(connection, spelled[tag], to_change=True) if tag in spelled else None
        if row is None:
            raise unknown(tag)
        if only_if is not None and not only_if(view_of(row)):
            text = f"loop {tag!r} is not as the request takes it to be: get it again and look at what has changed"
            raise RequestError("changed_meanwhile", text)
        values = _wanted(row, _spelled(changes, spelled), lambda: loops.types(connection))
        values, earlier = _continuing(connection, row, values)
        loops.change(connection, row.id, values)
        if values[CONTINUES] != row.continues:
            follow(connection, row, earlier)
        return view_of(loops.by_ids(connection, [row.id])[row.id])


def change_loops(
    backend: Backend, wanted: Sequence[tuple[str, Mapping[str, Any]]], *, by_cell: bool = False
) -> LoopsChangedOut:
    """Sets of many loops, by tag, what `patch_loop` sets of one. Each loop is for itself: what cannot be set of one is
    refused with its code, and the others are changed. by_cell: so is each value of a loop for itself.
    """
    refused: list[FailureOut] = []
    with backend.database.write() as connection:
        named = sorted({one for tag, changes in wanted for one in _named(tag, changes)})
        spelled = loops.as_spelled(connection, named)
        by_tag = loops.ids_of(connection, [*set(spelled.values())])
        ids = {tag: by_tag[own] for tag, own in spelled.items()}
        rows = loops.to_change(connection, by_tag.values())
        own_types = cache(lambda: frozenset(loops.types(connection)))
        changed: dict[int, dict[str, Any]] = {}
        before: dict[int, LoopRow | None] = {}
        for tag, changes in wanted:
            try:
                row, told = _named_once(tag, ids, rows, changed), _spelled(changes, spelled)
                values, wrong = _settable(row, told, own_types) if by_cell else (_wanted(row, told, own_types), [])
                refused += [refusal(tag, error.code, error.message) for error in wrong]
                changed[row.id], before[row.id] = _continuing(connection, row, values)
            except LoopauditError as error:
                refused.append(refusal(tag, error.code, error.message))
        news = {loop_id: values for loop_id, values in changed.items() if _differs(rows[loop_id], values)}
        loops.change_each(connection, news)
        for loop_id in (one for one in news if news[one][CONTINUES] != rows[one].continues):
            follow(connection, rows[loop_id], before[loop_id])
    return LoopsChangedOut(len(news), len(changed) - len(news), refused, [])


def refusal(tag: str, code: str, text: str) -> FailureOut:
    """Whatever a list calls a loop: half of a letter could not be answered."""
    return FailureOut(storable(tag), code, storable(text))


def _named(tag: str, changes: Mapping[str, Any]) -> list[str]:
    """The tags that a change is about, as far as they can be stored."""
    earlier = changes.get(CONTINUES)
    told = (tag, _stripped(earlier) if isinstance(earlier, str) else None)
    return sorted({one for one in told if isinstance(one, str) and storable(one) == one})


def _spelled(changes: Mapping[str, Any], spelled: Mapping[str, str]) -> Mapping[str, Any]:
    """With the loop that is continued as it is spelled itself: great and small letters tell no loops apart."""
    earlier = changes.get(CONTINUES)
    own = spelled.get(_stripped(earlier) or "") if isinstance(earlier, str) else None
    return changes if own is None else {**changes, CONTINUES: own}


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


def _settable(
    row: LoopRow, changes: Mapping[str, Any], own_types: Callable[[], Collection[str]]
) -> tuple[dict[str, Any], list[FieldError]]:
    """What can be set of it, and why the rest cannot; both ends of a span that is none are left as they are. Raises as
    `_wanted` where nothing is left."""
    wrong: list[FieldError] = []
    while True:
        try:
            return _wanted(row, changes, own_types), wrong
        except FieldError as error:
            pair = next((ends for ends in SPANS if error.field in ends), (error.field,))
            left = {name: value for name, value in changes.items() if name not in pair}
            if not left or len(left) == len(changes):
                raise
            changes, wrong = left, [*wrong, error]


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


def _stripped(words: str | None) -> str | None:
    return without_commands(words or "").strip() or None


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
