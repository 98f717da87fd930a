"""Modes of a controller, in words or numbers, to automatic or not."""

import re
import unicodedata
from collections import Counter
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import polars as pl

from app.ingest.model import FloatArray
from app.ingest.numbers.no_data import NO_WORD
from app.ingest.times.stamps import to_numbers

UNKNOWN_MODE = -1.0
_AUTOMATIC = frozenset(
    (
        *("auto", "aut", "a", "automatic", "automatik", "automatisch", "automatico", "automatique", "pauto", "prd"),
        *("cas", "casc", "cascade", "kaskade", "cascada", "cascata", "rcas", "remcas", "bcas", "rmt", "remote"),
        *("spc", "supervisory", "true", "on"),
    )
)
_MANUAL = frozenset(
    (
        *("man", "m", "manual", "manuell", "manuel", "manuelle", "manuale", "hand", "handbetrieb", "rout", "iman"),
        *("lo", "oos", "o/s", "tracking", "trk", "track", "init", "false", "off"),
    )
)
_BESIDE = frozenset(["mode", "loc", "local", "lcl", "b", "nr", "act", "actual", "operator", "oper", "program", "prog"])
"""Words beside that of a mode that say nothing against it: where the controller is worked from, or its backup."""
_NO_WORD = NO_WORD | {"nan"}
_NUMBERS = {0.0: 0.0, 1.0: 1.0, 2.0: 1.0, 3.0: 1.0, 4.0: 1.0, 8.0: 1.0, 16.0: 0.0, 32.0: 0.0, 64.0: 0.0, 128.0: 0.0}
"""0 and 1 as all count them; 2 and 3 cascade and remote where these go on; above that the bits of Foundation Fieldbus
and DeltaV (4 CAS, 8 AUTO, 16 MAN, 32 LO, 64 IMAN, 128 OOS)."""
_SHOWN = 5
_MOST = 1000  # words are kept to be told


def automatic_flags(texts: pl.Series) -> FloatArray:
    """(n,) 1 for automatic or cascade, 0 for manual, UNKNOWN_MODE for what is not understood, NaN where nothing
    stands."""
    flags = flags_of_numbers(to_numbers(texts))
    left = np.flatnonzero(np.isnan(flags) & texts.is_not_null().to_numpy())
    if len(left):
        words = texts[left]
        known = {word: _flag_of(word) for word in words.unique().to_list()}
        flags[left] = words.replace_strict(known, return_dtype=pl.Float64).to_numpy()
    return flags


def flags_of_numbers(numbers: FloatArray) -> FloatArray:
    flags = np.where(np.isfinite(numbers), UNKNOWN_MODE, np.nan)
    for number, flag in _NUMBERS.items():
        flags[numbers == number] = flag
    return flags


@lru_cache(maxsize=1 << 12)
def _flag_of(text: str) -> float:
    """Of a word, or of words and numbers around it that do not contradict each other: `1 - Auto`, `LOCAL MANUAL`."""
    word = _without_accents(text.strip(' "').lower())
    if word in _NO_WORD:
        return np.nan
    if (flag := _flag_of_word(word)) is not None:
        return flag
    told = {_flag_of_word(part) for part in re.findall(r"[a-z]+", word) if part not in _BESIDE}
    (flag,) = told if len(told) == 1 else (None,)
    return UNKNOWN_MODE if flag is None else flag


def _flag_of_word(word: str) -> float | None:
    return 1.0 if word in _AUTOMATIC else 0.0 if word in _MANUAL else None


def _without_accents(word: str) -> str:
    return "".join(c for c in unicodedata.normalize("NFKD", word) if not unicodedata.combining(c))


@dataclass
class ModesMet:
    """What modes were written that are not understood, or only probably, and how often."""

    unknown: Counter[str] = field(default_factory=Counter)
    numbers: set[float] = field(default_factory=set)

    def of_texts(self, texts: pl.Series) -> FloatArray:
        """Their flags."""
        flags = automatic_flags(texts)
        unknown = texts.filter(pl.Series(flags == UNKNOWN_MODE, dtype=pl.Boolean)).str.strip_chars(' "')
        if len(unknown) and len(self.unknown) < _MOST:
            self.unknown.update(unknown.to_list())
        self._note(to_numbers(texts.unique()))
        return flags

    def of_numbers(self, numbers: FloatArray) -> FloatArray:
        """Their flags."""
        flags = flags_of_numbers(numbers)
        unknown = numbers[flags == UNKNOWN_MODE]
        if len(unknown) and len(self.unknown) < _MOST:
            self.unknown.update(f"{number:g}" for number in unknown)
        self._note(numbers)
        return flags

    def _note(self, numbers: FloatArray) -> None:
        self.numbers.update(number for number in _NUMBERS if number > 1 and np.any(numbers == number))

    def notes(self) -> list[str]:
        shown = ", ".join(
            f"{number:g} {'automatic' if _NUMBERS[number] else 'manual'}" for number in sorted(self.numbers)
        )
        unknown = ", ".join(f"{word[:40]} ({times})" for word, times in self.unknown.most_common(_SHOWN))
        more = ", ..." if len(self.unknown) > _SHOWN else ""
        told = {
            "modes as numbers other than 0 and 1 were read as": shown,
            "modes that are not understood count neither as automatic nor as manual": unknown and unknown + more,
        }
        return [f"{what}: {which}" for what, which in told.items() if which]
