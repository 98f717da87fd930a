"""Columns of tags, values, qualities and rows, by their names and by what stands in them; shared by the layouts."""

import re
from collections.abc import Callable, Collection, Sequence

import numpy as np

from app.ingest.columns.plain_names import plain
from app.ingest.files.head import Head, is_number
from app.ingest.model import FloatArray
from app.ingest.numbers.units import as_number
from app.ingest.tags.grouping import place
from app.ingest.tags.quality import tell_good_from_bad
from app.ingest.tags.settling import tells_of_controller

TAG_NAMES = frozenset(
    (
        *("tag", "tagname", "name", "point", "pointname", "tagpath", "path", "item", "itemid", "signal"),
        *("wwtagname", "tagid", "tagindex", "pointid", "variable", "series", "datasource", "messstelle"),
        *("varname", "nodeid", "etiqueta", "valueid", "fullname"),
    )
)
VALUE_NAMES = (
    "value",
    "val",
    "vvalue",
    "wert",
    "pointvalue",
    "floatvalue",
    "numvalue",
    "reading",
    "varvalue",
    "iptrendvalue",
    "valuedouble",
    "valeur",
    "valor",
    "messwert",
    "mesure",
    "medida",
    "测量值",
    "realvalue",
    "valueasreal",
)
QUALITY_NAMES = (
    "opcquality",
    "dataquality",
    "quality",
    "status",
    "qualitydetail",
    "dataintegrity",
    "good",
    "valuestatus",
    "qualitycode",
    "confidence",
    "statuscode",
    "qstatus",
    "iptrendqstatus",
    "validity",
    "isgood",
    "isvalid",
    "qualitaet",
    "qualite",
    "calidad",
    "qualitydesc",
)
SKIPPED_NAMES = frozenset(("id", "index", "row", "rowid", "ndx", "unnamed0", ""))
_ROW_NAMES = frozenset(("#", "no", "nr", "n°", "nº", "№", "lfd.nr", "id", "row", "rowid", "ndx"))
"""Names of the number of a row, in small letters and without blanks: no times, however they rise."""
_OF_A_LOGGER = re.compile(r"(?i)[^\s_]_ndx\s*$|_numericid\s*$")
"""Behind the names of tables in Ignition, the number of the row; behind those of tags in KEPServerEX, one of theirs."""
_OF_SERIES = ("result", "table", "_measurement", "_field")
_ROWS_OR_VALUES = frozenset(("no", "nr"))
ONE_WAY = 0.98  # of the steps of times that no name tells, at least


def numbers_of(head: Head, column: int, first_row: int) -> FloatArray:
    """(n,) those of a column's fields that are some, without their units."""
    texts = (text for text in head.column(column, first_row) if is_number(text, head.decimal_mark))
    return np.array([as_number(text) for text in texts])


def name_at(names: Sequence[str], index: int) -> str:
    """Empty behind the last one."""
    return names[index] if index < len(names) else ""


def numbers_rows(name: str) -> bool:
    return _bare_name(name) in _ROW_NAMES


def _bare_name(name: str) -> str:
    return re.sub(r"\s", "", name).rstrip(".").lower()


def rises(numbers: FloatArray) -> bool:
    """Whether numbers (n,) in the order of the rows go one way, but for a few: those of a signal turn. One alone does
    not turn."""
    steps = np.diff(numbers[np.isfinite(numbers)])
    if len(steps) == 0:
        return True
    ways = np.mean(steps >= 0.0), np.mean(steps <= 0.0)
    return bool(max(ways) >= ONE_WAY and min(ways) < ONE_WAY)


def counts_rows(numbers: FloatArray) -> bool:
    """Whether numbers (n,) in the order of the rows are whole and grow from each to the next one."""
    return bool(len(numbers) > 1 and np.all(numbers == np.round(numbers)) and np.all(np.diff(numbers) > 0.0))


def _may_name_values(name: str) -> bool:
    return plain(name) not in SKIPPED_NAMES and plain(name) not in QUALITY_NAMES and not numbers_rows(name)


def may_hold_values(head: Head, names: tuple[str, ...], column: int, first_row: int) -> bool:
    """By its name; one that is called NO may be nitric oxide, where it does not rise as the number of a row, and one
    with fractions is no number of a row or a tag."""
    if _bare_name(names[column]) in _ROWS_OR_VALUES:
        return not rises(numbers_of(head, column, first_row))
    return _may_name_values(names[column]) and not _counts_for_a_logger(head, names[column], column, first_row)


def _counts_for_a_logger(head: Head, name: str, column: int, first_row: int) -> bool:
    if not _OF_A_LOGGER.search(name):
        return False
    numbers = numbers_of(head, column, first_row)
    return bool(np.all(numbers == np.round(numbers)))


def of_series(head: Head, names: Sequence[str], first_row: int) -> frozenset[int]:
    """The columns in which InfluxDB tells of which result, table and measurement a row is; a result is no number."""
    found = {name.strip().lower(): index for index, name in enumerate(names)}
    result = found.get("result", len(names))
    if found.get("table", -1) != result + 1 or mostly_numbers(head.column(result, first_row), head.decimal_mark):
        return frozenset()
    return frozenset(found[name] for name in _OF_SERIES if name in found)


def names_no_measurement(name: str) -> bool:
    """Whether a column is by its name a mode, a quality, a control error or a number of the row: nothing that could
    move a PV."""
    if not _may_name_values(name) or _OF_A_LOGGER.search(name) is not None:
        return True
    return tells_of_controller(name) or place(name, "").signal == "MODE"


def quality_of(
    head: Head,
    known: list[str],
    first_row: int,
    others: Collection[int | None],
    tell: Callable[[list[str]], bool] = tell_good_from_bad,
) -> int | None:
    """The column of qualities in a long table by its plain name, else by its words, which `tell` knows. others: those
    of something else."""
    if (named := quality_named(known)) is not None:
        return named
    left = (at for at in range(len(known)) if at not in others)
    return next((at for at in left if tell(head.column(at, first_row))), None)


def quality_named(known: list[str]) -> int | None:
    """The column of qualities by its plain name."""
    return next((known.index(name) for name in QUALITY_NAMES if name in known), None)


def mostly_signals(fields: list[str]) -> bool:
    """Whether most of the words that differ tell a signal."""
    words = set(fields)
    return 2 * sum(place(word, "").signal != "OTHER" for word in words) > len(words)


def mostly_numbers(fields: list[str], decimal_mark: str) -> bool:
    return bool(fields) and sum(is_number(field, decimal_mark) for field in fields) >= 0.5 * len(fields)
