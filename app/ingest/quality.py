"""Quality of a value: words, OPC's numbers (0 bad, 64 uncertain, 192 good) or codes that count from 0 = good."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

_GOOD = frozenset(
    [
        "good",
        "ok",
        "g",
        "true",
        "valid",
        "normal",
        "raw",
        "interpolated",
        "1",
        "goodsubstituted",
        "good[sub]",
        "goodlocaloverride",
    ]
)
_UNCERTAIN = frozenset(["uncertain", "questionable", "doubtful", "suspect", "u", "uncertaingood"])
OPC_GOOD, OPC_UNCERTAIN = 192.0, 64.0


class Quality:
    """Judges texts of a quality column; each distinct text of a chunk once."""

    def __init__(self, drop_uncertain: bool, zero_is_good: bool = False) -> None:
        self._drop_uncertain, self._zero_is_good = drop_uncertain, zero_is_good

    def bad(self, texts: pl.Series) -> NDArray[np.bool_]:
        """(n,) True where a value cannot be used; an empty quality says nothing against it."""
        if texts.dtype != pl.String and texts.null_count() == 0 and len(texts):
            return self._bad_codes(texts)
        distinct = texts.unique()
        bad = [text for text in distinct.cast(pl.String).to_list() if text is not None and self.is_bad(text)]
        if not bad:
            return np.zeros(len(texts), dtype=bool)
        return texts.cast(pl.String).is_in(bad).fill_null(False).to_numpy()

    def _bad_codes(self, texts: pl.Series) -> NDArray[np.bool_]:
        codes = texts.to_physical().to_numpy()
        bad = np.zeros(int(codes.max()) + 1, dtype=bool)
        first = np.flatnonzero(np.bincount(codes))
        if len(first) == 1:
            return np.full(len(codes), self.is_bad(texts[0]))
        distinct = texts.unique()
        for text, code in zip(distinct.cast(pl.String), distinct.to_physical(), strict=True):
            bad[code] = self.is_bad(text)
        return bad[codes]

    def is_bad(self, text: str) -> bool:
        word = text.strip(' "').lower().replace(" ", "")
        if not word:
            return False
        try:
            return self._judge_number(float(word))
        except ValueError:
            pass
        if word in _UNCERTAIN or word.startswith("uncertain"):
            return self._drop_uncertain
        return not (word in _GOOD or word.startswith("good"))

    def _judge_number(self, number: float) -> bool:
        if self._zero_is_good:
            return number != 0
        if number == 1 or number >= OPC_GOOD:
            return False
        return self._drop_uncertain if number >= OPC_UNCERTAIN else True
