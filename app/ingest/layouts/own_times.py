"""Wide logs of KEPServerEX, in which each tag has a time of its own: FIC101_PV_VALUE, FIC101_PV_TIMESTAMP,
FIC101_PV_QUALITY. Where the times of a row are one, the usual wide layout reads them."""

import re

from app.ingest.columns.names import SKIPPED_NAMES, name_at, numbers_rows
from app.ingest.columns.plain_names import plain
from app.ingest.columns.plans import TimedColumns, ValueColumn, WidePlan
from app.ingest.columns.time_columns import form_of
from app.ingest.columns.time_names import is_full_time
from app.ingest.columns.widths import named_width
from app.ingest.files.head import PREAMBLE_ROWS, Head
from app.ingest.model import IngestOptions

_PART = re.compile(r"(?i)(?P<tag>.*[^._ ])[._ ](?P<part>value|timestamp|quality)")
_BESIDE = re.compile(r"(?i)(?:.*[._ ])?(?:numericid|timestamp|quality)")
_VALUE, _TIME, _QUALITY = "value", "timestamp", "quality"


def sniff(head: Head, options: IngestOptions) -> WidePlan | None:
    for at, names in enumerate(head.rows[:PREAMBLE_ROWS]):
        tags = _parts_of_tags(names)
        if (
            len(tags) > 1
            and not _others_have_values(names, tags)
            and _times_differ(head, [parts[_TIME] for parts in tags.values()], at + 1)
        ):
            groups = [_group(head, names, at + 1, tag, parts, options) for tag, parts in tags.items()]
            known = tuple(group for group in groups if group is not None)
            if len(known) == len(groups):
                return WidePlan("own_times", at + 1, named_width(head, names, at + 1), known, names=names)
    return None


def _parts_of_tags(names: tuple[str, ...]) -> dict[str, dict[str, int]]:
    """The columns of each tag that has values and times."""
    found: dict[str, dict[str, int]] = {}
    for index, name in enumerate(names):
        if match := _PART.fullmatch(name):
            found.setdefault(match["tag"], {}).setdefault(match["part"].lower(), index)
    return {tag: parts for tag, parts in found.items() if parts.keys() >= {_VALUE, _TIME}}


def _others_have_values(names: tuple[str, ...], tags: dict[str, dict[str, int]]) -> bool:
    """Whether a column beside those of the tags may hold values, which have no times of their own."""
    taken = {index for parts in tags.values() for index in parts.values()}
    others = (name for index, name in enumerate(names) if index not in taken)
    return any(name and not (_BESIDE.fullmatch(name) or is_full_time(name) or _tells_rows(name)) for name in others)


def _tells_rows(name: str) -> bool:
    return plain(name) in SKIPPED_NAMES or numbers_rows(name)


def _times_differ(head: Head, times: list[int], first_row: int) -> bool:
    return any(len({name_at(row, at) for at in times} - {""}) > 1 for row in head.rows[first_row:])


def _group(
    head: Head, names: tuple[str, ...], first_row: int, tag: str, parts: dict[str, int], options: IngestOptions
) -> TimedColumns | None:
    time = (parts[_TIME],)
    form = form_of(head, time, first_row, options, names[parts[_TIME]])
    if form is None or form.kind == "relative":
        return None
    return TimedColumns(time, form, (ValueColumn(parts[_VALUE], tag, quality=parts.get(_QUALITY)),))
