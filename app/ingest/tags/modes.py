"""Modes of a controller, in words or numbers, to automatic or not."""

import re
import unicodedata
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import repeat

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.model import FloatArray
from app.ingest.numbers.no_data import NO_WORD
from app.ingest.rejecting import RejectLog
from app.ingest.remembering import remembered
from app.ingest.telling import first_of
from app.ingest.times.time_reader import to_numbers

Lines = NDArray[np.integer]

UNKNOWN_MODE = -1.0
_AUTOMATIC = frozenset(
    (
        *("auto", "aut", "a", "automatic", "automatik", "automatisch", "automatico", "automatique", "pauto", "prd"),
        *("cas", "casc", "cascade", "kaskade", "cascada", "cascata", "rcas", "remcas", "bcas", "rmt", "remote"),
        *("rsp", "remotesp", "remotesetpoint", "automat", "automatikbetrieb", "kaskadenbetrieb", "bauto"),
        *("spc", "supervisory", "true", "on", "авто", "автомат", "автоматическии", "каскад", "каскадныи"),
        *("自动", "自動", "自动模式", "串级", "串级模式"),
    )
)
_MANUAL = frozenset(
    (
        *("man", "m", "manual", "manuell", "manuel", "manuelle", "manuale", "hand", "handbetrieb", "rout", "iman"),
        *("bman", "pman", "forcedmanual", "reczny", "rucni"),
        *("lo", "oos", "o/s", "tracking", "trk", "track", "init", "false", "off", "ручнои", "руч", "手动", "手動"),
        "手动模式",
    )
)
"""Without accents, as words are looked up."""
_BESIDE = frozenset(
    (
        *("mode", "loc", "local", "lokal", "lcl", "b", "p", "nr", "act", "actual", "operator", "oper"),
        *("program", "prog"),
    )
)
"""Words beside that of a mode that say nothing against it: where the controller is worked from, or its backup."""
_NO_WORD = NO_WORD | {"nan"}
_WORDS_FOR_NO_DATA = """
    nodata iotimeout timeout scantimeout scanoff commfail commfailure nosample noresult ptcreated pointcreated intfshut
    calcfailed notconnect notconnected dcsfailed settobad invaliddata invalidfloat arcoffline schlecht
    nogooddataforcalculation
"""
_NO_DATA = frozenset(_WORDS_FOR_NO_DATA.split())
"""Letters of what a historian writes where it has no value, but for `Bad` and what stands behind it. `Shutdown` may be
a mode."""
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
_MANUAL_IF_SET = {0.0: 1.0, 1.0: 0.0}
_CONTRARY = frozenset((8.0, 16.0, 32.0, 64.0))
_OF_DELTAV = frozenset((48.0, 80.0, 144.0))
_OF_FIELDBUS = 4.0  # beside contrary ones: CAS, where DeltaV has a local override
_DELTAVS_NAME = re.compile(r"(?i)/MODE\.(ACTUAL|TARGET|CV)$")
_FIELDBUS_NAME = re.compile(r"(?i)MODE_BLK")
_NAME_OF_MANUAL = re.compile(r"(?i)\.MANUAL$")
_SET = ("true", "on", "false", "off")
_TOLD = _OF_DELTAV | _CONTRARY | {_OF_FIELDBUS}
_SHOWN = 5
_MOST = 1000  # words are kept to be told
_COUNTED = np.array(sorted({*_USUAL, *_FIELDBUS, *_DELTAV}))
_ASKED = _COUNTED[_COUNTED > 1].tolist()  # which those are, and how they are read, is told
NUMBERED = 1000.0
MOST_LINES = 100_000  # are held until it is known whether what stands in them is understood


def automatic_flags(texts: pl.Series) -> FloatArray:
    """(n,) of one tag's modes: 1 for automatic or cascade, 0 for manual, UNKNOWN_MODE for what is not understood, NaN
    where nothing stands."""
    met = ModesMet()
    return met.flags(met.of_texts(texts, ""), "")


def _flags_of_words(texts: pl.Series) -> FloatArray:
    known = {word: _flag_of(word) for word in texts.unique().to_list()}
    return texts.replace_strict(known, return_dtype=pl.Float64).to_numpy()


def _counting_by_name(tag: str) -> Mapping[float, float] | None:
    if _NAME_OF_MANUAL.search(tag):
        return _MANUAL_IF_SET
    if _DELTAVS_NAME.search(tag):
        return _DELTAV
    return _FIELDBUS if _FIELDBUS_NAME.search(tag) else None


@remembered(1 << 12)
def _flag_of(text: str) -> float:
    """Of a word, or of words and numbers around it that do not contradict each other: `1 - Auto`, `LOCAL MANUAL`."""
    word = _without_accents(text.strip(' "').lower())
    if word in _NO_WORD or _stands_for_no_data(word):
        return np.nan
    if (flag := _flag_of_word(word)) is not None:
        return flag
    if (flag := _flag_of_word(re.sub(r"[\s_\-]", "", word))) is not None:
        return flag
    told = {_flag_of_word(part) for part in re.findall(r"[^\W\d_]+", word) if part not in _BESIDE}
    (flag,) = told if len(told) == 1 else (None,)
    return UNKNOWN_MODE if flag is None else flag


def _stands_for_no_data(word: str) -> bool:
    return re.match(r"bad(?![a-z])|#[a-z]", word) is not None or re.sub(r"[\W\d_]", "", word) in _NO_DATA


def stand_for_no_data(texts: pl.Series) -> NDArray[np.bool_]:
    """(n,) where modes are words of a historian that has no value: they say nothing of the mode, which goes on."""
    words = texts.drop_nulls().unique().to_list()
    found = [word for word in words if _stands_for_no_data(word.strip(' "').lower())]
    return texts.is_in(found).fill_null(False).to_numpy() if found else np.zeros(len(texts), dtype=bool)


def _flag_of_word(word: str) -> float | None:
    return 1.0 if word in _AUTOMATIC else 0.0 if word in _MANUAL else None


def _without_accents(word: str) -> str:
    return "".join(c for c in unicodedata.normalize("NFKD", word) if not unicodedata.combining(c))


@dataclass
class _Times:
    """How often one number came, and the first lines in which it did."""

    count: int = 0
    lines: list[int] = field(default_factory=list)


@dataclass
class ModesMet:
    """Modes as they come, chunk by chunk. How a tag counts is known when all of its numbers have come: a number stands
    for itself until then, NUMBERED more than it is, among the flags of words. What is not understood is told, and what
    only probably is."""

    unknown: Counter[str] = field(default_factory=Counter)
    numbers: set[tuple[float, float]] = field(default_factory=set)  # with their flags
    untold: dict[str, None] = field(default_factory=dict)  # tags whose numbers DeltaV and Fieldbus read contrarily
    _understood: dict[str, bool] = field(default_factory=dict)  # by tag, whether one of its modes is
    _telling: dict[str, set[float]] = field(default_factory=dict)
    _met: dict[str, dict[float, _Times]] = field(default_factory=dict)  # by tag, those above 1
    _lines_held: int = 0

    def of_texts(self, texts: pl.Series, tag: str, lines: Lines | None = None) -> FloatArray:
        """(n,) of one tag's: flags of words, numbers as they stand until all are there."""
        modes = self.of_numbers(to_numbers(texts), tag, lines)
        left = np.flatnonzero(np.isnan(modes) & texts.is_not_null().to_numpy())
        if len(left):
            modes[left] = _flags_of_words(texts[left])
            if _NAME_OF_MANUAL.search(tag):
                switch = left[texts[left].str.strip_chars(' "').str.to_lowercase().is_in(_SET).to_numpy()]
                modes[switch] = 1 - modes[switch]
            unknown = texts[left].filter(pl.Series(modes[left] == UNKNOWN_MODE)).str.strip_chars(' "')
            self._note_unknown(Counter(unknown.to_list()))
            self._note_understood(tag, modes[left])
        return modes

    def of_numbers(self, numbers: FloatArray, tag: str, lines: Lines | None = None) -> FloatArray:
        """The same of one tag's numbers, in these lines of the file. UNKNOWN_MODE for those that count nowhere."""
        self._meet(numbers, tag, lines)
        counted, given = np.isin(numbers, _COUNTED), np.isfinite(numbers)
        self._note_unknown(Counter(f"{number:g}" for number in numbers[given & ~counted]))
        modes = np.where(counted, numbers + NUMBERED, UNKNOWN_MODE)
        self._note_understood(tag, np.where(given & (~counted | (numbers <= 1)), modes, np.nan))
        return np.where(given, modes, np.nan)

    def may_be_understood(self, numbers: FloatArray) -> bool:
        """Whether all of them count somewhere."""
        return bool(np.isin(numbers, _COUNTED).all())

    def _meet(self, numbers: FloatArray, tag: str, lines: Lines | None) -> None:
        for number in _ASKED:
            at = np.flatnonzero(numbers == number)
            if not len(at):
                continue
            times = self._met.setdefault(tag, {}).setdefault(number, _Times())
            times.count += len(at)
            if lines is not None:
                shown = lines[at[: MOST_LINES - self._lines_held]].tolist()
                times.lines += shown
                self._lines_held += len(shown)
            if number in _TOLD:
                self._telling.setdefault(tag, set()).add(number)

    def flags(self, modes: FloatArray, tag: str) -> FloatArray:
        """(n,) flags of one tag's modes, when all of them have come."""
        flags, counting = modes.copy(), self._counting(tag)
        for number in _COUNTED.tolist():
            flags[modes == NUMBERED + number] = counting.get(number, UNKNOWN_MODE)
        return flags

    def settle(self, log: RejectLog) -> None:
        """When all modes of some tags have come: refuses the numbers that are not understood beside the others."""
        for tag, met in self._met.items():
            counting = self._counting(tag)
            if counting is _UNTOLD:
                self.untold[tag] = None
            self.numbers |= {(number, counting[number]) for number in met if number in counting}
            self._note_understood(tag, np.array([counting.get(number, UNKNOWN_MODE) for number in met]))
            for number, times in met.items():
                if number not in counting:
                    self._note_unknown({f"{number:g}": times.count})
                    more = times.count - len(times.lines)
                    log.add_many("unknown_mode", times.lines, repeat(f"{number:g}"), tag, more)
        self._met, self._lines_held = {}, 0

    def _note_unknown(self, words: Mapping[str, int]) -> None:
        if len(self.unknown) < _MOST:
            self.unknown.update(words)

    def _note_understood(self, tag: str, flags: FloatArray) -> None:
        """flags: NaN where nothing is said."""
        if not np.isnan(flags).all():
            self._understood[tag] = self._understood.get(tag, False) or bool((flags >= 0).any())

    def _counting(self, tag: str) -> Mapping[float, float]:
        """How a tag counts, by its name, else by what it holds."""
        named = _counting_by_name(tag)
        if named is not None:
            return named
        telling = self._telling.get(tag, set())
        if not telling & _OF_DELTAV and not telling & _CONTRARY:
            return _USUAL
        if not telling & (_OF_DELTAV | {_OF_FIELDBUS}):
            return _UNTOLD
        return _DELTAV if telling & _OF_DELTAV else _FIELDBUS

    def notes(self) -> list[str]:
        shown = ", ".join(f"{number:g} {'automatic' if flag else 'manual'}" for number, flag in sorted(self.numbers))
        unknown = first_of([f"{word[:40]} ({times})" for word, times in self.unknown.most_common(_SHOWN + 1)], _SHOWN)
        untold = ", ".join(tag[:80] for tag in list(self.untold)[:_SHOWN])
        strange = [tag[:80] for tag, some in self._understood.items() if tag and not some]
        alone = first_of(strange, _SHOWN)
        judged = "their loops are judged as if no mode had been recorded, unless other files have some"
        whose = "nothing tells whether modes are counted as in DeltaV (8 MAN, 16 AUTO) or in FOUNDATION Fieldbus"
        told = {
            "modes as numbers other than 0 and 1 were read as": shown,
            f"{whose} (8 AUTO, 16 MAN)": untold,
            "modes that are not understood count neither as automatic nor as manual": unknown,
            f"not one mode of these tags is understood, and {judged}": alone,
        }
        return [f"{what}: {which}" for what, which in told.items() if which]
