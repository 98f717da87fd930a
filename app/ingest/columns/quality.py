"""Which column of a wide table says how good which values are: by its name, or by where it stands."""

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import partial

from app.ingest.columns.names import name_at
from app.ingest.columns.plans import Plan, TimedColumns, ValueColumn, WidePlan
from app.ingest.files.head import Head, is_number
from app.ingest.numbers.units import as_number
from app.ingest.tags.grouping import spelled_out
from app.ingest.tags.quality import (
    are_mostly_good,
    holds_good,
    may_be_quality,
    tell_quality_for_sure,
    tells_quality,
)

_WORDS = "quality|status|qualitycode|confidence|statuscode|validity|isgood|isvalid|qstatus|qualitaet|qualite|calidad"
_ENDING = re.compile(rf"(.+?)[_. \-#:/]({_WORDS})", re.IGNORECASE)
_SHORT = "q|qc|qual|qlty|st|sts|stat"
_SHORT_ENDING = re.compile(rf"(.+?)[_. \-#:/]({_SHORT})", re.IGNORECASE)
_SHORT_NAME = re.compile(_SHORT, re.IGNORECASE)
"""Of what may be anything else, too: what stands in the columns tells."""
_PERCENT = re.compile(r"\d{1,3}(\.0*)?")
MOST_QUALITIES = 8
_UNCERTAIN_AND_BETTER = 64.0  # of OPC, and PROFIBUS's good; what stands below may be steps or states of anything
_CONFIDENCE = re.compile(r"(.+?)[_. \-#:/](conf)", re.IGNORECASE)
"""Of PHD, in percent."""
_CALLED_CONFIDENCE = re.compile(r"conf(idence)?$", re.IGNORECASE)
_VALUE = re.compile(r"(.+?)[_. \-#:/](value|val)", re.IGNORECASE)
_CURRENT = re.compile(r"(.+?)[_. \-#:/](cv)", re.IGNORECASE)
"""DeltaV's current value, PV.CV, has its status in PV.ST. Elsewhere FIC101.CV is a control valve, and FIC101.Status the
state of anything: qualities judge it alone."""


def with_quality(
    head: Head,
    names: tuple[str, ...],
    first_row: int,
    values: tuple[ValueColumn, ...],
    is_general: Callable[[str], bool],
) -> tuple[ValueColumn, ...]:
    """Values beside what judges them. `FIC101.PV_Quality`, `FIC101.PV Status` and `X.Quality` with `X.Value` name it;
    a column called Quality or Status alone, if it holds qualities, judges the columns left of it up to the one before,
    or all where nothing is left of it."""

    def column(at: int) -> list[str]:
        return head.column(at, first_row)

    judged, late = _by_name(head, names, first_row, values)
    used = set(judged.values())
    general = [at for at, name in enumerate(names) if _is_general(name, partial(column, at), is_general)]
    if not (judged or late or general):
        return values
    rest = [value for value in values if value.index not in used.union(general)] or [*values]

    def with_its_own(value: ValueColumn) -> ValueColumn:
        at = judged.get(value.index, _right_of(value.index, general, rest))
        in_percent = at is not None and _CALLED_CONFIDENCE.search(names[at]) and _are_confidences(column(at))
        return replace(value, quality=at, may_judge=late.get(value.index), in_percent=bool(in_percent))

    return tuple(map(with_its_own, rest))


def _is_general(name: str, fields: Callable[[], list[str]], is_general: Callable[[str], bool]) -> bool:
    """Whether a column that names no value holds qualities: under a short name for sure."""
    if name and is_general(name):
        return tells_quality(fields())
    return _SHORT_NAME.fullmatch(name) is not None and _are_qualities(fields())


def as_mapped(plan: Plan, is_signal: Callable[[str], bool], head: Head) -> Plan:
    """The plan in which columns are values though they hold qualities by their names, where a mapping has them as
    signals. Of those that hold words it is told that they judge nothing any more: bad values are read with the good."""
    if not isinstance(plan, WidePlan) or not plan.names:
        return plan
    signals = {at for group in plan.groups for at in _judging(group) if is_signal(name_at(plan.names, at))}
    if not signals:
        return plan

    def freed(value: ValueColumn) -> ValueColumn:
        quality = None if value.quality in signals else value.quality
        return replace(value, quality=quality, may_judge=None if value.may_judge in signals else value.may_judge)

    groups = []
    for group in plan.groups:
        new = sorted(signals & _judging(group) - {value.index for value in group.values})
        added = (ValueColumn(at, name_at(plan.names, at)) for at in new)
        groups.append(replace(group, values=(*map(freed, group.values), *added)))
    freed_names = [name_at(plan.names, at) for at in sorted(signals) if _holds_words(head.column(at, plan.first_row))]
    told = [f"the mapping has {name} as a signal: what it says of the values is not heeded" for name in freed_names]
    return replace(plan, groups=tuple(groups), notes=(*told, *plan.notes))


def _holds_words(fields: list[str]) -> bool:
    return any(field and not is_number(field) for field in fields)


def _judging(group: TimedColumns) -> set[int]:
    """The columns that judge its values, or may do so."""
    return {at for value in group.values for at in (value.quality, value.may_judge) if at is not None}


def judged_by(plan: Plan, judging: Collection[int]) -> Plan:
    """The plan with those of the columns that may judge values as ones that do."""
    if not judging or not isinstance(plan, WidePlan):
        return plan

    def judged(value: ValueColumn) -> ValueColumn:
        return replace(value, quality=value.may_judge, may_judge=None) if value.may_judge in judging else value

    groups = (
        replace(group, values=tuple(judged(value) for value in group.values if value.index not in judging))
        for group in plan.groups
    )
    return replace(plan, groups=tuple(groups))


def may_be_qualities(fields: list[str]) -> bool:
    """Whether fields are none, or so few different words and numbers as a quality has: others may yet tell."""
    return len(set(fields)) <= MOST_QUALITIES and all(map(may_be_quality, set(fields)))


def notes_of_short_names(plan: Plan, head: Head) -> tuple[str, ...]:
    """Of columns that are read as values and are called Q or ST alone, where their numbers are qualities' too, as 0 and
    128: a flow, or what judges all other values."""
    if not isinstance(plan, WidePlan):
        return ()
    values = (value for group in plan.groups for value in group.values if _SHORT_NAME.fullmatch(value.tag))
    found = {value.tag: head.column(value.index, plan.first_row) for value in values}
    return tuple(_may_be_told(name, fields) for name, fields in found.items() if _may_judge(fields))


def _may_judge(fields: list[str]) -> bool:
    told = [field for field in fields if field]
    numbers = [as_number(field) for field in set(told) if is_number(field)]
    return may_be_qualities(told) and max(numbers, default=0.0) >= _UNCERTAIN_AND_BETTER


def _may_be_told(name: str, fields: list[str]) -> str:
    shown = ", ".join(sorted({field for field in fields if field})[:3])
    return (
        f"the column {name} was read as a signal, though what it holds ({shown}) may be qualities; where it says how "
        "good the values are, call it Quality"
    )


def _are_qualities(fields: list[str]) -> bool:
    """Whether a column holds them for sure, and so few different ones as a tag has. Bad alone may stand for values."""
    told = (tell_quality_for_sure(fields) and holds_good(fields)) or are_mostly_good(fields)
    return told and len(set(fields)) <= MOST_QUALITIES


def _are_confidences(fields: list[str]) -> bool:
    """Whether a column holds percentages, most of them 100."""
    numbers = [float(field) if _PERCENT.fullmatch(field) else -1.0 for field in fields]
    return all(0 <= number <= 100 for number in numbers) and 2 * numbers.count(100.0) > len(numbers)


def _follows(head: Head, first_row: int, index: int, other: int) -> bool:
    """Whether a column has the other one's fields in most rows, and these move: a confirmed position has."""
    rows = [row for row in head.rows[first_row:] if len(row) > max(index, other)]
    same = sum(row[index] == row[other] for row in rows)
    return index != other and 2 * same > len(rows) and len({row[other] for row in rows}) > 1


def _by_name(
    head: Head, names: tuple[str, ...], first_row: int, values: tuple[ValueColumn, ...]
) -> tuple[dict[int, int], dict[int, int]]:
    """By column of values, the one that judges it, and the one that may if further rows show qualities there."""
    judging: dict[str, int] = {}
    late: dict[str, int] = {}
    for_sure: set[int] = set()
    by_tag = {value.tag.casefold(): value.index for value in values}
    for index, name in enumerate(names):
        found = _ENDING.fullmatch(spelled_out(name)) or _SHORT_ENDING.fullmatch(name) or _CONFIDENCE.fullmatch(name)
        if found is None:
            continue
        fields = head.column(index, first_row)
        are_qualities = _are_qualities(fields)
        if found.re is _CONFIDENCE:
            judges = _are_confidences(fields) and not _follows(
                head, first_row, index, by_tag.get(found[1].casefold(), index)
            )
        else:
            judges = found.re is _ENDING or are_qualities
        if judges:
            judging.setdefault(found[1].casefold(), index)
            for_sure |= {index} if are_qualities else set()
        elif found.re is _SHORT_ENDING and may_be_qualities(fields):
            late.setdefault(found[1].casefold(), index)
    sure = {name: index for name, index in judging.items() if index in for_sure}
    return _judged(values, judging, sure), _judged(values, late, late)


def _judged(values: tuple[ValueColumn, ...], judging: Mapping[str, int], for_sure: Mapping[str, int]) -> dict[int, int]:
    judged: dict[int, int] = {}
    for value in values if judging else ():
        named = [(value.tag, judging)]
        for ending, among in ((_VALUE, judging), (_CURRENT, for_sure)):
            if found := ending.fullmatch(value.tag):
                named.append((found[1], among))
        for name, among in named:
            at = among.get(spelled_out(name).casefold(), value.index)
            if at != value.index:
                judged.setdefault(value.index, at)
    return judged


def _right_of(column: int, general: list[int], values: list[ValueColumn]) -> int | None:
    """The nearest column of qualities on the right, or the one that stands left of all values."""
    right = next((index for index in general if index > column), None)
    if right is not None or not general:
        return right
    return general[-1] if general[-1] < values[0].index else None
