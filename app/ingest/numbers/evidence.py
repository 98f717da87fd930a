"""What tells how the numbers of a file are written, gathered from all of its rows."""

from collections.abc import Collection

import numpy as np
import polars as pl
from numpy.typing import NDArray

MOST_HELD = 1 << 20  # texts, of more than that each second one of a form, and where that is not enough of all
_TELL = r"^[\s\"]*[+-]?[.,]?\d|\d +[+-]?[.,]?\d"


class Evidence:
    """Texts of the `tags` in the order in which they come: those that the fast reader left, or may have taken for other
    numbers, are odd. Of many each tag keeps some of each form, be it rare or not: `9 999,9`, `999,9 bar`."""

    def __init__(self, tags: Collection[str]) -> None:
        self.tags = list(tags)
        self._texts = pl.DataFrame(schema={"tag": pl.String, "text": pl.String, "odd": pl.Boolean, "form": pl.String})
        self._every = 1

    def add(self, tags: pl.Series, texts: pl.Series, odd: NDArray[np.bool_]) -> None:
        """(n,) of a chunk."""
        found = pl.DataFrame({"tag": tags, "text": texts, "odd": odd})
        found = found.filter(pl.col("tag").is_in(self.tags) & pl.col("text").str.contains(_TELL))
        found = found.with_columns(form=pl.col("text").str.replace_all(r"\d", "9"))
        self._texts = pl.concat((self._texts, _each(found, self._every)))
        if self._texts.height > MOST_HELD:
            self._texts, self._every = _each(self._texts, 2), 2 * self._every
        if self._texts.height > MOST_HELD:
            self._texts = self._texts.gather_every(2)  # remarks, of which each is of another form

    @property
    def odd(self) -> pl.DataFrame:
        """Tag and text."""
        return self._texts.filter(pl.col("odd")).select("tag", "text")

    def rest(self) -> pl.DataFrame:
        return self._texts.filter(~pl.col("odd")).select("tag", "text")


def _each(texts: pl.DataFrame, step: int) -> pl.DataFrame:
    """Each so many-th of a tag's texts of one form, the first one among them."""
    return texts if step == 1 else texts.filter(pl.int_range(pl.len()).over("tag", "odd", "form") % step == 0)
