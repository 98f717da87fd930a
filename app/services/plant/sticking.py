"""All valves that stick reliably, unit by unit: the list that a turnaround is planned from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from app.services.audit_json.rows import OLD
from app.services.backend import Backend
from app.services.plant.reliability import table
from app.services.stating.shelving import Shelf
from app.services.telling.size_wording import equal_digits
from app.storage.asked_rows import RowFilter

MOST = 1000


@dataclass(frozen=True)
class StickingValve:
    """size: S with its 95 % interval and share of OP's span, empty where the record does not tell it. row: of the
    reliability table, with what its loop is, its work order and repair."""

    loop: str
    unit: str | None
    size: str
    row: Mapping[str, Any]


@dataclass(frozen=True)
class Sticking:
    """The valves of each unit, those first that lack most to full health, times their importance. more: how many the
    list has no room for. apart: rows of those that are listed in none, for what is said of them is of an old record, or
    of before a repair."""

    units: list[tuple[str | None, list[StickingValve]]]
    more: int
    apart: Sequence[Mapping[str, Any]]


def sticking(backend: Backend, shelved: Shelf, counted: int, most: int = MOST) -> Sticking:
    """counted: how many there are in the plant, without those apart. Shelved ones are among them, and say so."""
    asked = RowFilter(verdict=("stiction",), reliability="reliable")
    found = table(backend, most, filters=asked, shelved=shelved).rows
    apart = [row for row in found if _is_past(row)]
    rows = [row for row in found if not _is_past(row)]
    valves = [StickingValve(row["loop"], row["unit"], size_with_interval(row), row) for row in rows]
    # A sort keeps the order within a unit; loops that name none stand last.
    by_unit = sorted(valves, key=lambda valve: (valve.unit is None, valve.unit or ""))
    units = [(unit, list(some)) for unit, some in groupby(by_unit, lambda valve: valve.unit)]
    return Sticking(units, max(0, counted - len(rows)), apart)


def _is_past(row: Mapping[str, Any]) -> bool:
    return bool(row["of_before_repair"] or row[OLD])


def size_with_interval(row: Mapping[str, Any]) -> str:
    """ "S 5.02 (4.71 to 5.33) units of OP, 5.0 % of OP's span"."""
    if row["stiction_S"] is None:
        return ""
    size, low, high = equal_digits(row["stiction_S"], row["stiction_S_low"], row["stiction_S_high"])
    share = row["stiction_S_pct_of_span"]
    return f"S {size} ({low} to {high}) units of OP" + ("" if share is None else f", {share:.1f} % of OP's span")
