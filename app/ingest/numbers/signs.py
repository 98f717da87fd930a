"""Minus signs that stand behind numbers, as SAP and COBOL write them, and numbers in brackets, which accountants take
for negative ones and laboratories for doubted ones."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import polars as pl

from app.ingest.model import FloatArray
from app.ingest.telling import tags_by

_MINUS_BEHIND = '^([ "]*)(\\d[\\d.,]*)[-\N{MINUS SIGN}\N{EN DASH}]([ "]*)$'  # behind a blank it is the unit of shares
_IN_BRACKETS = r"^[ \"]*\([ ]*\d[\d.,]*[ ]*\)[ \"]*$"


@dataclass
class Signs:
    """The tags whose numbers are written so."""

    behind: dict[str, str] = field(default_factory=dict)
    bracketed: dict[str, str] = field(default_factory=dict)

    def see(self, texts: pl.Series, tags: pl.Series, numbers: FloatArray) -> None:
        """Text and tag of what the fast reader left, and which numbers (n,) these were read as, NaN where as none."""
        were_read = pl.Series(np.isfinite(numbers))
        forms = ((_MINUS_BEHIND, were_read, self.behind), (_IN_BRACKETS, ~were_read, self.bracketed))
        for form, of_form, found in forms:
            such = texts.str.contains(form).fill_null(False) & of_form
            if such.any():
                at = int(such.arg_true()[0])
                shown = texts[at].strip(' "')
                found.update({tag: found.get(tag, shown) for tag in tags.filter(such).unique().drop_nulls()})

    def notes(self, order: Sequence[str] = ()) -> list[str]:
        """order: that of the tags."""
        told = {
            "numbers have their minus behind them, and were read as negative": self.behind,
            "numbers in brackets may be negative or doubted, and were refused; needed is a minus before them": (
                self.bracketed
            ),
        }
        return [f"{what}: {_shown(tags, order)}" for what, tags in told.items() if tags]


def with_minus_before(texts: pl.Series) -> pl.Series:
    """The numbers with a minus behind them as they are usually written."""
    return texts.str.replace(_MINUS_BEHIND, "$1-$2$3")


def _shown(tags: dict[str, str], order: Sequence[str]) -> str:
    return "; ".join(f"{text} ({names})" for text, names in tags_by(tags, order).items())
