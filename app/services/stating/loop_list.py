"""The plant's loops as a list that a spreadsheet can change: out as CSV, and read again."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from app.errors import DataError, FieldError, RequestError
from app.ingest import BEYOND, MAY_PART_THOUSANDS, Listed, list_rows, list_text
from app.services.backend import Backend
from app.services.loops import list_loops
from app.services.outward import FailureOut, LoopsChangedOut
from app.services.spreadsheet import BYTE_ORDER_MARK, csv_lines, plain_cell
from app.services.stating.properties import WORDS, change_loops, refusal
from app.storage.loops import SETTABLE, ListFilter

COLUMNS = ("tag", *SETTABLE)
FLAGS = ("integrating", "moves_valve", "retired")
SAID = {
    **dict.fromkeys(("yes", "true", "1", "ja", "wahr", "oui", "vrai", "si", "sí", "verdadero"), True),
    **dict.fromkeys(("no", "false", "0", "nein", "falsch", "non", "faux", "falso"), False),
}
"""As people write it, and as spreadsheets do in some languages."""

NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?", re.ASCII)
THOUSANDS = re.compile(r"[+-]?\d{1,3}([., '\u2019\xa0\u202f]\d{3})+([.,]\d*)?", re.ASCII)
PAGE = 1000
MOST_LOOPS = 20_000

_LIST = ("the loop list", "bad_loop_list")


@dataclass(frozen=True)
class LoopList:
    """What a list sets, by tag; which rows or cells of it cannot be read, and which columns are of no use here.
    by_cell: whether of a loop of which one value cannot be set the others are set."""

    wanted: list[tuple[str, dict[str, Any]]]
    refused: list[FailureOut]
    ignored: list[str]
    by_cell: bool = False


def written(
    backend: Backend, wanted: ListFilter | None = None, limit: int | None = None, cursor: str | None = None
) -> tuple[str, str | None]:
    """The list of these loops, from the mark on by which spreadsheets know UTF-8, and the cursor of those that come
    after `limit` of them; limit None: all."""
    page = list_loops(backend, PAGE if limit is None else limit, cursor, wanted)
    rows = [*page.rows]
    while limit is None and page.next_cursor is not None:
        page = list_loops(backend, PAGE, page.next_cursor, wanted)
        rows += page.rows
    told = ({name: _told(value) for name, value in vars(view).items()} for view in rows)
    return BYTE_ORDER_MARK + "".join(csv_lines(told, COLUMNS)), page.next_cursor


def _told(value: Any) -> Any:
    return ("no", "yes")[value] if isinstance(value, bool) else value


def take(backend: Backend, sent: LoopList) -> LoopsChangedOut:
    """Sets what a list says. Raises DataError("bad_loop_list") where it has more than `MOST_LOOPS`."""
    if len(sent.wanted) > MOST_LOOPS:
        raise DataError("bad_loop_list", f"the list has {len(sent.wanted):,} loops; at most {MOST_LOOPS:,} go at once")
    done = change_loops(backend, sent.wanted, by_cell=sent.by_cell)
    return replace(done, refused=[*sent.refused, *done.refused], ignored=sent.ignored)


def read(data: bytes) -> LoopList:
    """A list with the column tag (or loop, as the reliability table calls it) and any of `SETTABLE`. An empty cell
    leaves what it stands for as it is; one that cannot be read is refused by itself.

    Raises DataError("bad_loop_list") where it is no CSV, has no column tag or no row, or sets nothing.
    """
    listed = list_rows(list_text(data, *_LIST), *_LIST)
    if not listed.rows:
        raise DataError("bad_loop_list", "the loop list has no row; it needs a row of names and then one a loop")
    names = [name for name in dict.fromkeys(name for _, row in listed.rows for name in row) if name != BEYOND]
    known = {name: plain for name in names if (plain := name.replace(" ", "_")) in COLUMNS}
    if "tag" not in known.values() and "loop" in names:
        known["loop"] = "tag"
    if "tag" not in known.values() or len(known) < 2 or len(set(known.values())) < len(known):
        needed = f"it needs tag (or loop), and one of {', '.join(SETTABLE)}, each once"
        raise DataError("bad_loop_list", f"the loop list has the columns {', '.join(names)[:200]}; {needed}")
    found = LoopList([], [], [name for name in names if name and name not in known], by_cell=True)
    for number, row in listed.rows:
        told = {plain: row.get(name, "") for name, plain in known.items()}
        tag = plain_cell(told.pop("tag"))
        wrong: list[RequestError] = []
        values = _values(tag, told, row.get(BEYOND), listed, wrong)
        found.refused.extend(refusal(tag, error.code, f"row {number}: {error.message}") for error in wrong)
        if values or not wrong:
            found.wanted.append((tag, values))
    return found


def _values(
    tag: str, told: Mapping[str, str], beyond: str | None, listed: Listed, wrong: list[RequestError]
) -> dict[str, Any]:
    """What the cells of a row set, and into `wrong` what of it cannot be set."""
    values: dict[str, Any] = {}
    if not tag or beyond is not None:
        wrong.append(_no_row(beyond if tag else None))
        return values
    for name, text in ((name, text) for name, text in told.items() if text):
        try:
            values[name] = _value(name, text, listed)
        except RequestError as error:
            wrong.append(error)
    return values


def _no_row(beyond: str | None) -> RequestError:
    """Of a row of which no cell can be taken."""
    if beyond is None:
        return RequestError("no_tag", "it names no loop")
    text = f"it has {beyond[:60]!r} beyond the columns that have names: a cell may hold what parts cells"
    return RequestError("ragged_row", text)


def _value(name: str, text: str, listed: Listed) -> Any:
    """A word, a yes or no, or a number."""
    if name in WORDS:
        return plain_cell(text)
    if name in FLAGS:
        if text.casefold() not in SAID:
            raise RequestError("bad_value", f"{name} is yes or no, got {text[:60]!r}")
        return SAID[text.casefold()]
    if "," in text and "." not in text and listed.delimiter == ",":
        why = "; with commas between cells a comma in it may part thousands"
        raise RequestError("bad_value", f"{name} is a number, got {text[:60]!r}{why}")
    if listed.in_doubt(text):
        raise RequestError("bad_value", f"{name} is {text!r}, {MAY_PART_THOUSANDS}")
    return number(name, text)


def number(name: str, text: str) -> float:
    """As people write it, with a point or a comma before its decimals. Raises FieldError("bad_value")."""
    if not NUMBER.fullmatch(text):
        why = "; write it without marks between thousands" if THOUSANDS.fullmatch(text) else ""
        raise FieldError("bad_value", f"{name} is a number, got {text[:60]!r}{why}", name)
    return float(text.replace(",", "."))
