"""The plant's loops as a list that a spreadsheet can change: out as CSV, and read again."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from app.errors import DataError, RequestError
from app.ingest import BEYOND, list_rows, list_text
from app.services.backend import Backend
from app.services.plant.loops import WORDS, change_loops, list_loops
from app.services.results import FailureView
from app.services.spreadsheet import csv_lines, safe_cell
from app.storage.loops import SETTABLE

COLUMNS = ("tag", *SETTABLE)
FLAGS = ("integrating", "moves_valve")
SAID = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False}
PAGE = 1000
MOST_LOOPS = 20_000

_LIST = ("the loop list", "bad_loop_list")


@dataclass(frozen=True)
class ListTaken:
    """What became of a list: see `LoopsChanged`; ignored: columns that say nothing of a loop here."""

    changed: int
    unchanged: int
    refused: list[FailureView]
    ignored: list[str]


@dataclass(frozen=True)
class LoopList:
    """What a list sets, by tag; which rows of it cannot be read, and which columns are of no use here."""

    wanted: list[tuple[str, dict[str, Any]]]
    refused: list[FailureView]
    ignored: list[str]


def written(backend: Backend, unit: str | None = None, search: str | None = None) -> Iterator[str]:
    """The list of these loops, line by line."""
    return csv_lines(_rows(backend, unit, search), COLUMNS)


def _rows(backend: Backend, unit: str | None, search: str | None) -> Iterator[dict[str, Any]]:
    cursor = None
    while True:
        page = list_loops(backend, PAGE, cursor, unit=unit, search=search)
        for view in page.rows:
            yield {name: _told(value) for name, value in vars(view).items()}
        cursor = page.next_cursor
        if cursor is None:
            return


def _told(value: Any) -> Any:
    return ("no", "yes")[value] if isinstance(value, bool) else value


def take(backend: Backend, sent: LoopList) -> ListTaken:
    """Sets what a list says. Raises DataError("bad_loop_list") where it has more than `MOST_LOOPS`."""
    if len(sent.wanted) > MOST_LOOPS:
        raise DataError("bad_loop_list", f"the list has {len(sent.wanted)} loops; at most {MOST_LOOPS} go at once")
    done = change_loops(backend, sent.wanted)
    return ListTaken(done.changed, done.unchanged, [*sent.refused, *done.refused], sent.ignored)


def read(data: bytes) -> LoopList:
    """A list with the column tag and any of `SETTABLE`. An empty cell leaves what it stands for as it is.

    Raises DataError("bad_loop_list") where it is no CSV, has no column tag or no row, or sets nothing.
    """
    rows = list_rows(list_text(data, *_LIST), *_LIST)
    if not rows:
        raise DataError("bad_loop_list", "the loop list has no row; it needs a row of names and then one a loop")
    names = [name for name in dict.fromkeys(name for row in rows for name in row) if name != BEYOND]
    known = {name: plain for name in names if (plain := name.replace(" ", "_")) in COLUMNS}
    if "tag" not in known.values() or len(known) < 2:
        text = f"the loop list has the columns {', '.join(names)[:200]}; it needs tag, and one of {', '.join(SETTABLE)}"
        raise DataError("bad_loop_list", text)
    found = LoopList([], [], [name for name in names if name not in known])
    for row in rows:
        told = {plain: row.get(name, "") for name, plain in known.items()}
        tag = unsafe(told.pop("tag"))
        try:
            found.wanted.append((_named(tag), _values(told, row.get(BEYOND))))
        except RequestError as error:
            found.refused.append(FailureView(tag, error.code, error.message))
    return found


def _named(tag: str) -> str:
    if not tag:
        raise RequestError("no_tag", "a row of the loop list names no loop")
    return tag


def _values(told: Mapping[str, str], beyond: str | None) -> dict[str, Any]:
    if beyond is not None:
        text = f"the row has {beyond[:60]!r} beyond the columns that have names: a cell may hold what parts cells"
        raise RequestError("ragged_row", text)
    return {name: _value(name, text) for name, text in told.items() if text}


def _value(name: str, text: str) -> Any:
    """A word, a yes or no, or a number, with a point or a comma."""
    if name in WORDS:
        return unsafe(text)
    if name in FLAGS:
        if text.lower() not in SAID:
            raise RequestError("bad_value", f"{name} is yes or no, got {text[:60]!r}")
        return SAID[text.lower()]
    try:
        return float(text.replace(",", "."))
    except ValueError:
        raise RequestError("bad_value", f"{name} is a number, got {text[:60]!r}") from None


def unsafe(cell: str) -> str:
    """A text as it was before `safe_cell` put an apostrophe before it."""
    return cell[1:] if cell.startswith("'") and safe_cell(cell[1:]) == cell else cell
