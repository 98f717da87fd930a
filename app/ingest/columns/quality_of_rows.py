"""Which column of a long table says how good its values are, where none is called a quality: by a name that makes it a
flag, or by a short name and what stands there."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

from app.ingest.columns.names import SKIPPED_NAMES, counts_rows, name_at, numbers_of
from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import LongPlan
from app.ingest.files.head import Head
from app.ingest.tags.quality import are_flags, tell_quality_for_sure

_GOOD_IF_SET = ("isvalid", "valid", "gueltig", "isgood", "good")
_BAD_IF_SET = (
    *("bad", "isbad", "invalid", "isinvalid", "error", "iserror", "haserror"),
    *("fehler", "ungueltig", "schlecht"),
)
_SHORT = ("qual", "qc", "q", "sts", "vtq", "qcode", "qualcode", "guete")
_MOST_SHOWN = 300


def with_flags(plan: LongPlan, head: Head) -> LongPlan:
    """The plan with it, where a row has one value. Flags of what is bad, as Error is, may be anything else where
    not all are flags."""
    if plan.has_signals:
        return plan
    names = {index: plain(name) for index, name in _names(plan, head).items()}
    if plan.quality is not None:
        return replace(plan, good_if_set=True) if names.get(plan.quality) in _GOOD_IF_SET else plan
    left = {name: index for index, name in reversed(names.items()) if index not in plan.read}

    def found(among: tuple[str, ...], fits: Callable[[list[str]], bool]) -> int | None:
        named = (left[name] for name in among if name in left)
        return next((index for index in named if fits(head.column(index, plan.first_row))), None)

    rows = len(head.rows) - plan.first_row
    for among, is_good in ((_GOOD_IF_SET, True), (_BAD_IF_SET, False)):
        if (index := found(among, partial(are_flags, rows=rows, good_if_set=is_good))) is not None:
            return replace(plan, quality=index, zero_is_good=not is_good, good_if_set=is_good)
    return replace(plan, quality=found((*_GOOD_IF_SET, *_SHORT), tell_quality_for_sure))


def with_columns_left(plan: LongPlan, head: Head) -> LongPlan:
    """The plan with a note of the columns that hold something and are not read, but for the number of the row."""
    if plan.has_signals:
        return plan
    names = {index: name for index, name in _names(plan, head).items() if index not in plan.read}
    nameless = columns_without_name(head, names, plan.first_row)
    shown = ", ".join(
        name[:80]
        for index, name in (names | nameless).items()
        if name and plain(name) not in SKIPPED_NAMES and head.column(index, plan.first_row)
    )
    if not shown:
        return plan
    return replace(
        plan, notes=(*plan.notes, f"columns beside tag, time and value were not read: {shown[:_MOST_SHOWN]}")
    )


def columns_without_name(head: Head, names: Mapping[int, str], first_row: int) -> dict[int, str]:
    """How columns that hold something under an empty name are called in notes, but for those of the number of the
    row."""
    empty = (index for index, name in names.items() if not name and head.column(index, first_row))
    return {index: f"column {index + 1}" for index in empty if not counts_rows(numbers_of(head, index, first_row))}


def _names(plan: LongPlan, head: Head) -> dict[int, str]:
    names = head.row(plan.first_row - 1) if plan.first_row else ()
    return {index: name_at(names, index) for index in range(plan.width)}
