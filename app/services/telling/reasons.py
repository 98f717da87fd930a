"""The reasons of a verdict one by one, where its row has them as one text, and what else a row keeps in one."""

import json
from collections.abc import Mapping
from typing import Any

from app.services.telling.naming import isolated, with_capital
from app.services.telling.wording import MOVES_NO_VALVE, MOVES_SET_POINT, SHAKEN_BY_NEIGHBOUR, STOOD_TOGETHER, codes_of

BETWEEN = ". "
"""What stands between two reasons in the text of a row. No sentence of ours has it inside."""

NAMING_LOOPS = {SHAKEN_BY_NEIGHBOUR, MOVES_SET_POINT, MOVES_NO_VALVE, STOOD_TOGETHER}
"""Reasons that name other loops, whose tags may hold it ("T. 101"); a row has one of them at most."""

SINCE, TOGETHER_SINCE = "unanswered_since", "stood_together_since"
"""The fields of a row that tell since when PV does not answer OP, and when it came to stand with other loops."""


def reasons_of(row: Mapping[str, Any]) -> list[str]:
    """The sentences in the order of their codes, the weightiest first. What is more than there are codes belongs to
    the reason that names other loops; where there is none, the parts are told as they stand."""
    parts, codes = (row["reasons_text"] or "").split(BETWEEN), codes_of(row)
    more = len(parts) - len(codes)
    at = next((place for place, code in enumerate(codes) if code in NAMING_LOOPS), None)
    if at is None or more <= 0:
        return parts
    return [*parts[:at], BETWEEN.join(parts[at : at + more + 1]), *parts[at + more + 1 :]]


def extra_in(extra_json: str | None) -> Mapping[str, Any]:
    """The fields of a row that have no column of their own."""
    found: dict[str, Any] = json.loads(extra_json or "{}")
    return found


def first_reasons(row: Mapping[str, Any], count: int = 2) -> str:
    """The weightiest reasons of a row as sentences, for pages and reports; the page of its loop has all of them."""
    told = reasons_of(row)
    first = BETWEEN.join(map(with_capital, told[:count]))
    return isolated(first) + (" ..." if len(told) > count else "")
