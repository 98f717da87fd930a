"""Modes of a controller, in words or numbers, to automatic or not."""

import re
import unicodedata
from collections import Counter
from collections.abc import Mapping
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
        *("spc", "supervisory", "true", "on", "авто", "автомат", "автоматическии", "каскад", "каскадныи"),
        *("自动", "自動", "自动模式", "串级", "串级模式"),
    )
)
_MANUAL = frozenset(
    (
        *("man", "m", "manual", "manuell", "manuel", "manuelle", "manuale", "hand", "handbetrieb", "rout", "iman"),
        *("lo", "oos", "o/s", "tracking", "trk", "track", "init", "false", "off", "ручнои", "руч", "手动", "手動"),
        "手动模式",
    )
)
"""Without accents, as words are looked up."""
_BESIDE = frozenset(["mode", "loc", "local", "lcl", "b", "nr", "act", "actual", "operator", "oper", "program", "prog"])
"""Words beside that of a mode that say nothing against it: where the controller is worked from, or its backup."""
_NO_WORD = NO_WORD | {"nan"}
_USUAL = {0.0: 0.0, 1.0: 1.0, 2.0: 1.0, 3.0: 1.0, 4.0: 1.0, 128.0: 0.0}
"""0 and 1 as all count them; 2 and 3 cascade and remote where these go on, as 4 is where it does or is a CAS bit."""
_FIELDBUS = {0.0: 0.0, 1.0: 0.0, 2.0: 1.0, 4.0: 1.0, 8.0: 1.0, 16.0: 0.0, 32.0: 0.0, 64.0: 0.0, 128.0: 0.0}
"""Bits of FOUNDATION Fieldbus: 1 ROUT, 2 RCAS, 4 CAS, 8 AUTO, 16 MAN, 32 LO, 64 IMAN, 128 OOS."""
_DELTAV = {
    **{0.0: 0.0, 1.0: 0.0, 2.0: 0.0, 4.0: 0.0, 8.0: 0.0, 16.0: 1.0, 32.0: 1.0, 48.0: 1.0, 64.0: 1.0, 80.0: 1.0},
    **{128.0: 0.0, 144.0: 0.0},
}
"""DeltaV counts the other way round: 1 OOS, 2 IMAN, 4 LO, 8 MAN, 16 AUTO, 32 CAS, 64 RCAS, 128 ROUT; 48, 80 and 144 are
those with AUTO."""
_UNTOLD = {0.0: 0.0, 1.0: 0.0, 128.0: 0.0}
"""What both agree in: for where bits stand that mean the one here and the other there, and nothing tells whose."""
_CONTRARY = frozenset((8.0, 16.0, 32.0, 64.0))
_OF_DELTAV = frozenset((48.0, 80.0, 144.0))
_OF_FIELDBUS = 4.0  # beside contrary ones: CAS, where DeltaV has a local override
_DELTAVS_NAME = re.compile(r"(?i)/MODE\.(ACTUAL|TARGET|CV)$")
_FIELDBUS_NAME = re.compile(r"(?i)MODE_BLK")
_TOLD = _OF_DELTAV | _CONTRARY | {_OF_FIELDBUS}
_SHOWN = 5
_MOST = 1000  # words are kept to be told


def automatic_flags(texts: pl.Series) -> FloatArray:
    """(n,) of one tag's modes: 1 for automatic or cascade, 0 for manual, UNKNOWN_MODE for what is not understood, NaN
    where nothing stands."""
    return ModesMet().of_texts(texts, "")


def _flags_of_texts(texts: pl.Series, numbers: FloatArray, counting: Mapping[float, float]) -> FloatArray:
    flags = _flags_of_numbers(numbers, counting)
    left = np.flatnonzero(np.isnan(flags) & texts.is_not_null().to_numpy())
    if len(left):
        words = texts[left]
        known = {word: _flag_of(word) for word in words.unique().to_list()}
        flags[left] = words.replace_strict(known, return_dtype=pl.Float64).to_numpy()
    return flags


def _flags_of_numbers(numbers: FloatArray, counting: Mapping[float, float]) -> FloatArray:
    flags = np.where(np.isfinite(numbers), UNKNOWN_MODE, np.nan)
    for number, flag in counting.items():
        flags[numbers == number] = flag
    return flags


def _counting_by_name(tag: str) -> Mapping[float, float] | None:
    if _DELTAVS_NAME.search(tag):
        return _DELTAV
    return _FIELDBUS if _FIELDBUS_NAME.search(tag) else None


@lru_cache(maxsize=1 << 12)
def _flag_of(text: str) -> float:
    """Of a word, or of words and numbers around it that do not contradict each other: `1 - Auto`, `LOCAL MANUAL`."""
    word = _without_accents(text.strip(' "').lower())
    if word in _NO_WORD:
        return np.nan
    if (flag := _flag_of_word(word)) is not None:
        return flag
    told = {_flag_of_word(part) for part in re.findall(r"[^\W\d_]+", word) if part not in _BESIDE}
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
    numbers: set[tuple[float, float]] = field(default_factory=set)  # with their flags
    untold: dict[str, None] = field(default_factory=dict)  # tags whose numbers DeltaV and Fieldbus read contrarily
    _telling: dict[str, set[float]] = field(default_factory=dict)

    def of_texts(self, texts: pl.Series, tag: str) -> FloatArray:
        """Flags of one tag's."""
        numbers = to_numbers(texts)
        counting = self._counting(numbers, tag)
        flags = _flags_of_texts(texts, numbers, counting)
        unknown = texts.filter(pl.Series(flags == UNKNOWN_MODE, dtype=pl.Boolean)).str.strip_chars(' "')
        if len(unknown) and len(self.unknown) < _MOST:
            self.unknown.update(unknown.to_list())
        self._note(numbers, counting)
        return flags

    def of_numbers(self, numbers: FloatArray, tag: str) -> FloatArray:
        """Flags of one tag's."""
        counting = self._counting(numbers, tag)
        flags = _flags_of_numbers(numbers, counting)
        unknown = numbers[flags == UNKNOWN_MODE]
        if len(unknown) and len(self.unknown) < _MOST:
            self.unknown.update(f"{number:g}" for number in unknown)
        self._note(numbers, counting)
        return flags

    def are_understood(self, numbers: FloatArray, tag: str) -> bool:
        """Whether all of one tag's are; nothing is counted."""
        return not np.any(_flags_of_numbers(numbers, self._counting(numbers, tag)) == UNKNOWN_MODE)

    def _counting(self, numbers: FloatArray, tag: str) -> Mapping[float, float]:
        """How a tag counts, by its name, else by what it held so far."""
        named = _counting_by_name(tag)
        if named is not None:
            return named
        telling = self._telling.setdefault(tag, set())
        telling |= {number for number in _TOLD if np.any(numbers == number)}
        if not telling & _OF_DELTAV and not telling & _CONTRARY:
            return _USUAL
        if not telling & (_OF_DELTAV | {_OF_FIELDBUS}):
            self.untold[tag] = None
            return _UNTOLD
        self.untold.pop(tag, None)
        return _DELTAV if telling & _OF_DELTAV else _FIELDBUS

    def _note(self, numbers: FloatArray, counting: Mapping[float, float]) -> None:
        met = {(number, flag) for number, flag in counting.items() if number > 1}
        self.numbers |= {(number, flag) for number, flag in met - self.numbers if np.any(numbers == number)}

    def notes(self) -> list[str]:
        shown = ", ".join(f"{number:g} {'automatic' if flag else 'manual'}" for number, flag in sorted(self.numbers))
        unknown = ", ".join(f"{word[:40]} ({times})" for word, times in self.unknown.most_common(_SHOWN))
        more = ", ..." if len(self.unknown) > _SHOWN else ""
        untold = ", ".join(tag[:80] for tag in list(self.untold)[:_SHOWN])
        whose = "nothing tells whether modes are counted as in DeltaV (8 MAN, 16 AUTO) or in FOUNDATION Fieldbus"
        told = {
            "modes as numbers other than 0 and 1 were read as": shown,
            f"{whose} (8 AUTO, 16 MAN)": untold,
            "modes that are not understood count neither as automatic nor as manual": unknown and unknown + more,
        }
        return [f"{what}: {which}" for what, which in told.items() if which]
