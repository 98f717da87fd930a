"""Which column of a wide table says how good which values are: by its name, or by where it stands."""

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

from app.ingest.columns.plans import Plan, ValueColumn, WidePlan
from app.ingest.files.head import Head
from app.ingest.tags.grouping import spelled_out
from app.ingest.tags.quality import may_be_quality, tell_quality_for_sure, tells_quality

_WORDS = "quality|status|qualitycode|confidence|statuscode|validity|isgood|isvalid|qstatus|qualitaet|qualite|calidad"
_ENDING = re.compile(rf"(.+?)[_. \-#:/]({_WORDS})", re.IGNORECASE)
_SHORT = "q|qc|qual|qlty|st|sts|stat"
_SHORT_ENDING = re.compile(rf"(.+?)[_. \-#:/]({_SHORT})", re.IGNORECASE)
_SHORT_NAME = re.compile(_SHORT, re.IGNORECASE)
"""Of what may be anything else, too: what stands in the columns tells."""
_PERCENT = re.compile(r"\d{1,3}(\.0*)?")
MOST_QUALITIES = 8
_CONFIDENCE = re.compile(r"(.+?)[_. \-#:/](conf)", re.IGNORECASE)
"""Of PHD, in percent."""
_VALUE = re.compile(r"(.+?)[_. \-#:/](value|val)", re.IGNORECASE)


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
    judged, late = _by_name(head, names, first_row, values)
    used = set(judged.values())
    general = [
        index for index, name in enumerate(names) if _is_general(name, head.column(index, first_row), is_general)
    ]
    rest = [value for value in values if value.index not in used.union(general)] or [*values]
    return tuple(
        replace(
            value,
            quality=judged.get(value.index, _right_of(value.index, general, rest)),
            may_judge=late.get(value.index),
        )
        for value in rest
    )


def _is_general(name: str, fields: list[str], is_general: Callable[[str], bool]) -> bool:
    """Whether a column that names no value holds qualities: under a short name for sure."""
    if name and is_general(name):
        return tells_quality(fields)
    return _SHORT_NAME.fullmatch(name) is not None and _are_qualities(fields)


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


def _are_qualities(fields: list[str]) -> bool:
    """Whether a column holds them for sure, and so few different ones as a tag has."""
    return len(set(fields)) <= MOST_QUALITIES and tell_quality_for_sure(fields)


def _are_confidences(fields: list[str]) -> bool:
    """Whether a column holds percentages, most of them 100."""
    numbers = [float(field) if _PERCENT.fullmatch(field) else -1.0 for field in fields]
    return all(0 <= number <= 100 for number in numbers) and 2 * numbers.count(100.0) > len(numbers)


def _fullmatch(name: str) -> Callable[[re.Pattern[str]], re.Match[str] | None]:
    return lambda form: form.fullmatch(spelled_out(name) if form is _ENDING else name)


def _by_name(
    head: Head, names: tuple[str, ...], first_row: int, values: tuple[ValueColumn, ...]
) -> tuple[dict[int, int], dict[int, int]]:
    """By column of values, the one that judges it, and the one that may if further rows show qualities there."""
    judging: dict[str, int] = {}
    late: dict[str, int] = {}
    for index, name in enumerate(names):
        found = next(filter(None, map(_fullmatch(name), (_ENDING, _SHORT_ENDING, _CONFIDENCE))), None)
        if found is None:
            continue
        fields = head.column(index, first_row)
        if found.re is _ENDING or (_are_confidences if found.re is _CONFIDENCE else _are_qualities)(fields):
            judging.setdefault(found[1].casefold(), index)
        elif found.re is _SHORT_ENDING and may_be_qualities(fields):
            late.setdefault(found[1].casefold(), index)
    return _judged(values, judging), _judged(values, late)


def _judged(values: tuple[ValueColumn, ...], judging: Mapping[str, int]) -> dict[int, int]:
    judged: dict[int, int] = {}
    for value in values if judging else ():
        without_value = _VALUE.fullmatch(value.tag)
        for name in (value.tag, without_value[1] if without_value else value.tag):
            at = judging.get(spelled_out(name).casefold(), value.index)
            if at != value.index:
                judged.setdefault(value.index, at)
    return judged


def _right_of(column: int, general: list[int], values: list[ValueColumn]) -> int | None:
    """The nearest column of qualities on the right, or the one that stands left of all values."""
    right = next((index for index in general if index > column), None)
    if right is not None or not general:
        return right
    return general[-1] if general[-1] < values[0].index else None
