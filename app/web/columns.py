"""The columns that the table of the plant can show, and the addresses of its other views."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal
from urllib.parse import urlencode

Kind = Literal[
    "text", "number", "verdict", "reliability", "health", "cause", "time", "recorded", "reasons", "code", "flag"
]


@dataclass(frozen=True)
class Column:
    """`sort` names the order that a click on the head starts with; empty: from the least, None: there is no order."""

    label: str
    kind: Kind = "number"
    digits: int = 1
    sort: str | None = ""


COLUMNS: Mapping[str, Column] = {
    "unit": Column("Unit", "text"),
    "type": Column("Type", "text"),
    "description": Column("Description", "text", 1, None),
    "owner": Column("Owner", "text"),
    "verdict": Column("Verdict", "verdict", 1, "verdict_words"),
    "reliability": Column("Rely on it?", "reliability"),
    "health": Column("Health", "health"),
    "importance": Column("Importance", "number", 1, "-importance"),
    "priority": Column("Priority", "number", 0, "-priority"),
    "stiction_probability": Column("Probability of stiction", "number", 2, "-stiction_probability"),
    "stiction_band_pct_of_op_range": Column(
        "Band d of the published rule, % of OP range", "number", 1, "-stiction_band_pct_of_op_range"
    ),
    "stiction_S": Column("Size S, units of OP", "number", 2, None),
    "stiction_S_pct_of_span": Column("Size S, % of OP span", "number", 1, None),
    "likely_cause": Column("Likely cause", "cause", 1, "likely_cause_words"),
    "oscillation_period_s": Column("Period, s", "number", 0),
    "oscillation_strength": Column("Oscillation strength", "number", 2, "-oscillation_strength"),
    "oscillation_regularity": Column("Regularity", "number", 1, "-oscillation_regularity"),
    "yper_pct": Column("Yper, %", "number", 1, "-yper_pct"),
    "table2_reading": Column("Table 2", "code"),
    "filled_share": Column("Filled share", "number", 2, "-filled_share"),
    "samples": Column("Samples", "number", 0),
    "window_samples": Column("Samples judged", "number", 0, None),
    "sampling_interval_s": Column("Sampling interval, s", "number", 1),
    "recorded_to": Column("Recorded until", "recorded"),
    "audited_at": Column("Audited", "time", 0, "-audited_at"),
    "reasons_text": Column("Why", "reasons", 1, None),
    "next_step": Column("What to do", "text", 1, None),
    "work_order": Column("Work order", "text", 1, None),
    "repaired_at": Column("Repaired", "time", 1, None),
    "shelved_until": Column("Shelved until", "time", 1, None),
    "of_old_record": Column("Of an old record", "flag", 1, None),
}

USUAL = ("unit", "verdict", "reliability", "health", "stiction_probability", "likely_cause", "reasons_text")

USUAL_ORDERS: Mapping[str, str] = {"-priority": "worst first: health, importance", "loop": "by tag"}


def sorted_column(sort: str) -> str:
    """The name of the column whose head turns this order around; that of the order itself where there is none."""
    asked = sort.removeprefix("-")
    heads = {(column.sort or name).removeprefix("-"): name for name, column in COLUMNS.items()}
    return heads.get(asked, asked)


def orders(names: Iterable[str], sort: str) -> Mapping[str, str]:
    """The orders to choose from, in words: the usual ones, those that the heads of these columns start with, and the
    one in use."""
    heads = [COLUMNS[name].sort or name for name in names if COLUMNS[name].sort is not None]
    return {order: USUAL_ORDERS.get(order) or _in_words(order) for order in (*USUAL_ORDERS, *heads, sort)}


def _in_words(order: str) -> str:
    name = sorted_column(order)
    if order == "-loop":
        return "by tag, last first"
    label = COLUMNS[name].label if name in COLUMNS else name
    return f"{label}, greatest first" if order.startswith("-") else label


def query_without(told: Mapping[str, Any], *left_out: str, **changed: Any) -> str:
    """The query of an address with what the form says, less `left_out`, with `changed`; empty values left away."""
    values = {name: value for name, value in {**told, **changed}.items() if name not in left_out and value}
    return urlencode(values, doseq=True)
