"""Quality of a value: words, numbers of OPC (0 bad, 64 uncertain, 192 good, whatever stands above their byte; of UA the
two highest of 32 bits tell, 0 good), codes of which one is good."""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from math import isfinite
from typing import TypeVar

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.ingest.numbers.no_data import NO_WORD

_GOOD = frozenset(
    (
        *("good", "ok", "g", "true", "valid", "normal", "raw", "interpolated", "goodsubstituted", "good[sub]"),
        *("goodlocaloverride", "gut", "bon", "bonne", "bueno", "buena", "buono", "goed", "bra", "nr"),
    )
)
_UNCERTAIN = frozenset(
    (
        *("uncertain", "questionable", "doubtful", "suspect", "u", "uncertaingood", "unsicher", "incertain"),
        *("qst", "cnd", "clp+", "clp-"),
    )
)
"""The last ones and `nr`, normal, are CENTUM's: questionable, conditional, and clamped, which the value is indeed."""
_BAD = frozenset(["bad", "schlecht", "mauvais", "malo", "invalid", "false", "nodata"])
_OF_QUALITY_ALONE = frozenset(
    (
        *("gut", "schlecht", "unsicher", "bon", "bonne", "mauvais", "mauvaise", "incertain", "bueno", "buena", "malo"),
        *("mala", "buono", "cattivo", "goed", "slecht", "questionable", "doubtful", "suspect"),
    )
)
"""Words that the state of something has not, as `normal`, `true` and `ok`."""
_SET = frozenset(("1", "1.0", "true", "t", "yes", "y", "on", "ja", "j", "wahr", "oui", "vrai", "si"))
_NOT_SET = frozenset(("0", "0.0", "false", "f", "no", "n", "off", "nein", "falsch", "non", "faux"))
_SHORT_GOOD = _GOOD - {"true", "normal", "raw", "interpolated"}
_OF_STATES_TOO = frozenset(("ok", "valid", "g", "nr"))
"""Of a machine, of a lamp that is green, or of an alarm of CENTUM's, which is `NR` or `HI`."""
_OF_LIMITS = frozenset(("hi", "lo", "hh", "ll", "hihi", "lolo", "mhi", "mlo", "dv+", "dv-", "vel+", "vel-"))
"""Alarms: what is beyond a limit is measured."""
_OF_CENTUM = frozenset(("iop", "iop+", "iop-", "oop", "ptpf", "nrdy", "ncom", "nefv"))
_SHORT_BAD = _OF_CENTUM.union(("b", "nok", "notok", "ng", "err", "error", "fail", "failed", "invalid", "nodata"))
_HEX = ("0x", "16#")
_CODE = re.compile(r"([A-Za-z])\s*\((?:0x)?[0-9A-Fa-f]+\)\s*$")
OPC_GOOD, OPC_UNCERTAIN = 192.0, 64.0
_GOOD_OF_OPC = (OPC_GOOD, 216.0)  # plain, and overridden locally
PROFIBUS_GOOD = 128.0  # below OPC's good ones, which leaves these out; WinCC has them
_BEHIND_OPC = OPC_GOOD + 28  # none has a meaning behind 219
OPC_MOST = 255.0  # of a byte; what stands above it is the vendor's
_BAD_OF_IGNITION = frozenset((300, 301, 310, 311, 312, 330, 340, 403, 404, 405, 410, 500, 600, 900, 901, 902, 1000))
"""Of which the lowest byte tells nothing: 410 is a disabled tag, 500 a stale value. They are others where no good one
of OPC's stands: 500 may be the good one of another system."""
UA_UNCERTAIN, UA_BAD, UA_END = 2.0**30, 2.0**31, 2.0**32
_EMPTY = ("", "nan")
_MAY_BE_GOOD = (1.0, 0.0, -1.0)
_SHOWN = 3
_MOST_TEXTS = 1 << 16  # are held: a quality has few


class Quality:
    """Judges texts of quality columns; each distinct text of a chunk once.

    zero_is_good: None where the file does not tell. Numbers that are none of OPC's are judged by the most frequent one
    then: most values of a plant are good. good_if_set: what flags as `true` and `N` say; None where there are none.

    What numbers mean is learnt from the chunks so far; `settled` judges by all of them.
    """

    def __init__(self, zero_is_good: bool | None = None, good_if_set: bool | None = None) -> None:
        self._good_if_set, self._zero_is_good = good_if_set, zero_is_good
        self._told = zero_is_good is not None
        self._good = 0.0 if zero_is_good else 1.0  # beside numbers of OPC, if there are any
        self._with_good_of_opc = zero_is_good is False
        self._ua = False  # numbers are those of OPC UA, whose low bits say nothing of good and bad
        self._chosen = False
        self._knows_all = False
        self._numbers: Counter[float] = Counter()
        self._judgements: dict[str, set[bool]] = {}  # of each text
        self._judged: Counter[bool] = Counter()
        self._refused: Counter[str] = Counter()

    def learn(self, texts: pl.Series, weights: NDArray[np.int64] | None = None) -> None:
        """Looks for what numbers mean, before they are judged. weights: how often each text stands."""
        counts = _counted(texts, weights)
        if not self._knows_all:
            self._learn_numbers(counts)
        for text, times in counts.items():
            bad = self.is_bad(text)
            if text in self._judgements or len(self._judgements) < _MOST_TEXTS:
                self._judgements.setdefault(text, set()).add(bad)
            self._judged[bad] += times
            if bad and len(self._refused) < 1000:
                self._refused[text] += times

    def _learn_numbers(self, counts: Mapping[str, int]) -> None:
        found = {text: number for text in counts if (number := _number(text)) is not None}
        for text, number in found.items():
            self._numbers[number] += counts[text]
        self._with_good_of_opc = self._with_good_of_opc or any(map(_is_good_of_opc, found.values()))
        if not self._told:
            self._look_at(found.values())

    def _look_at(self, numbers: Collection[float]) -> None:
        high = [number for number in numbers if number >= OPC_UNCERTAIN]
        self._ua = bool(high) and (max(high) >= UA_UNCERTAIN or all(map(_may_be_of_ua, high)))
        if self._ua or any(number <= OPC_MOST or _is_good_below_bits_of_a_vendor(number) for number in high):
            self._told, self._good = True, 1.0
        elif not self._chosen and any(self._numbers[number] for number in _MAY_BE_GOOD):
            self._good = max(_MAY_BE_GOOD, key=lambda number: self._numbers[number])
            self._chosen = True  # none is read both ways

    def settled(self) -> "Quality":
        """One that has judged nothing yet, and knows all numbers that this one has met."""
        settled = Quality(self._zero_is_good, self._good_if_set)
        settled._numbers = self._numbers.copy()
        settled._with_good_of_opc = self._with_good_of_opc
        if not settled._told:
            settled._look_at(self._numbers)
        settled._knows_all = True
        return settled

    @property
    def is_settled(self) -> bool:
        """Whether each text was judged as all numbers together tell."""
        if self._knows_all or not self._numbers:
            return True
        settled = self.settled()
        return all(judged == {settled.is_bad(text)} for text, judged in self._judgements.items())

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
        word = _word(text)
        if word in _EMPTY:
            return False
        if self._good_if_set is not None and word in _SET | _NOT_SET:
            return (word in _SET) != self._good_if_set
        if self._good_if_set is False:  # what else stands beside flags of what is bad says what is wrong
            return not (word in NO_WORD or word in _GOOD or word.startswith("good") or _number(text) == 0.0)
        number = _number(text)
        if number is not None:
            return self._judge_number(number)
        of_use = word in _GOOD or word in _UNCERTAIN or word in _OF_LIMITS
        return not (of_use or word.startswith(("good", "uncertain")))

    def _judge_number(self, number: float) -> bool:
        if number >= UA_UNCERTAIN:
            return number >= UA_BAD
        if self._ua:
            return False
        if not self._told or self._good == 0.0:
            return number != self._good
        if number == self._good:
            return False
        if self._with_good_of_opc and number in _BAD_OF_IGNITION:
            return True
        return (number if number <= OPC_MOST else float(int(number) & 0xFF)) < OPC_UNCERTAIN

    def notes(self) -> list[str]:
        """What is to be said of how qualities were read."""
        notes = []
        if not self._told and self._good != 1.0:
            seen = ", ".join(f"{number:g}" for number, _ in _most(self._numbers))
            taken = f"{self._good:g} was taken, the most frequent of {seen}"
            notes.append(f"the file does not tell which quality number is good, {taken}")
        if self._judged[True] > self._judged[False]:
            words = ", ".join(f"{text[:40]} ({times})" for text, times in _most(self._refused))
            notes.append(f"most values were refused for their quality: {words}")
        return notes


def tells_quality(fields: list[str]) -> bool:
    """Whether most of a column's fields are words or numbers that a quality has, and not the state of something."""
    words = list(map(_word, fields))
    known = [word for word in words if is_number(word) or _is_known(word)]
    if "nr" in known and not _is_of_centum(set(words).difference(known, _OF_LIMITS), known):
        known = [word for word in known if word != "nr"]
    return 2 * len(known) > len(words)


def _is_of_centum(others: Collection[str], known: Collection[str]) -> bool:
    """Whether `NR` is CENTUM's: beside `R` a pump is not running."""
    return not others or not _OF_CENTUM.isdisjoint(others) or any(word.startswith("bad") for word in known)


def are_flags(fields: list[str], rows: int, good_if_set: bool) -> bool:
    """Whether all of a column's fields are flags that are set or not, and half of the rows at most are called bad by
    them: a code of which 0 is good has the names of flags as well."""
    words = [_word(text) for text in fields]
    bad = sum((word in _SET) != good_if_set for word in words)
    return bool(words) and set(words) <= _SET | _NOT_SET and 2 * bad <= rows


def tell_quality_for_sure(fields: list[str]) -> bool:
    """Whether all of a column's fields are words of qualities, or numbers of OPC with good ones among them: none that a
    state, a count or a flow may have as well."""
    words = set(map(_word, fields))
    if any(map(is_number, words)):
        return all(map(is_number, words)) and numbers_tell_quality(Counter(fields))
    known = _SHORT_GOOD | _UNCERTAIN | _SHORT_BAD
    return bool(words) and all(word in known or word.startswith(("good", "bad", "uncertain")) for word in words)


def numbers_tell_quality(counts: Mapping[str, int]) -> bool:
    """Whether all numbers among texts, each with how often it stands, are OPC's with good ones, or PROFIBUS's in
    hexadecimal, of which most are good: set points are 150 and 192, and bits of states 0x80 and 0x00."""
    numbers = {_word(text): times for text, times in counts.items() if is_number(text)}
    if any(_number(word) in _GOOD_OF_OPC for word in numbers):
        return all(map(_is_number_of_quality, numbers))
    good = sum(times for word, times in numbers.items() if _tells_good(word))
    return 2 * good > sum(numbers.values()) and all(map(_is_number_of_quality, numbers))


def _is_number_of_quality(word: str) -> bool:
    number = _number(word)
    return number is not None and (_is_of_opc(number) or (word.startswith(_HEX) and _is_of_profibus(number)))


def holds_good(fields: Iterable[str]) -> bool:
    """Whether a word or an OPC number among the fields says that a value is good."""
    words = set(map(_word, fields))
    return any(word in _SHORT_GOOD or word.startswith("good") or _tells_good(word) for word in words)


def _tells_good(word: str) -> bool:
    """Whether it is a number that is good for sure: of OPC, or, in hexadecimal, as no count or flow is, of PROFIBUS."""
    number = _number(word)
    return number in _GOOD_OF_OPC or (word.startswith(_HEX) and number is not None and _is_of_profibus(number))


def are_mostly_good(fields: list[str]) -> bool:
    """Whether all of a column's fields are words and half of them at least say that a value is good: the others say
    then what is wrong, as `Comm Fail` and `OOS` do. What is `OK` may be a state, but for one beside a bad quality."""
    words = list(map(_word, fields))
    good = [word for word in words if word in _SHORT_GOOD or word.startswith("good")]
    for_sure = bool(set(good) - _OF_STATES_TOO) or any(word in _OF_CENTUM or word.startswith("bad") for word in words)
    return for_sure and 2 * len(good) >= len(words) and not any(map(is_number, fields))


def is_number(field: str) -> bool:
    """Whether a field is a number as qualities are."""
    return _number(field) is not None


def may_be_quality(field: str) -> bool:
    """Whether a field is a word of qualities or a number that OPC or PROFIBUS has for one."""
    number = _number(field)
    return tell_quality_for_sure([field]) if number is None else _is_of_opc(number) or _is_of_profibus(number)


def _is_of_profibus(number: float) -> bool:
    """Good, which OPC has not."""
    return PROFIBUS_GOOD <= number < OPC_GOOD and number == int(number)


def _is_of_opc(number: float) -> bool:
    """Good, uncertain or bad, with why, and at which limit."""
    if not 0 <= number < _BEHIND_OPC or number != int(number) or int(number) & 0xC0 == 0x80:
        return False
    return number < OPC_GOOD or float(int(number) & ~3) in _GOOD_OF_OPC


def _is_good_of_opc(number: float) -> bool:
    return OPC_GOOD <= number < _BEHIND_OPC


def holds_quality_words(fields: list[str]) -> bool:
    """Whether all of a column's fields are words of qualities and of nothing else."""
    words = set(map(_word, fields))
    return bool(words) and all(
        word in _OF_QUALITY_ALONE or word.startswith(("good", "bad", "uncertain")) for word in words
    )


def tell_good_from_bad(fields: list[str]) -> bool:
    """Whether all of a column's fields are words of qualities, and a good one or plain ones alone: `Bad Homburg` is a
    town."""
    words = set(map(_word, fields))
    plain = words <= _OF_QUALITY_ALONE | {"good", "bad", "uncertain"}
    return holds_quality_words(fields) and (plain or any(word in _GOOD or word.startswith("good") for word in words))


def _is_known(word: str) -> bool:
    return word in _GOOD | _UNCERTAIN | _BAD or word.startswith(("good", "bad", "uncertain"))


def _word(text: str) -> str:
    """Without the code behind it, as in `OK (0x0)`."""
    return _CODE.sub(r"\1", text).strip(' "').lower().replace(" ", "")


def _number(text: str) -> float | None:
    """Those of OPC UA as they are without a sign; one without a size is none."""
    word = _word(text)
    try:
        number = float(int(word.removeprefix(_HEX[1]), 16)) if word.startswith(_HEX) else float(word)
    except (ValueError, OverflowError):
        return None
    if not isfinite(number):
        return None
    return number + UA_END if number <= -UA_UNCERTAIN else number


def _may_be_of_ua(number: float) -> bool:
    """Whether a number that is not negative is a good quality of UA that says more: below the sixteen bits that say why
    there are none, or those that the eleventh one announces."""
    low = int(number) & 0xFFFF
    return number > OPC_MOST and (low == 0 or bool(low & 0x400))


def _is_good_below_bits_of_a_vendor(number: float) -> bool:
    """As OPC HDA's 0x000400C0, raw and good, is; UA has no use for both of these bits."""
    return OPC_MOST < number < UA_UNCERTAIN and int(number) & 0xC0 == 0xC0


_Shown = TypeVar("_Shown", float, str)


def _most(counts: Mapping[_Shown, int]) -> list[tuple[_Shown, int]]:
    """The most frequent that are shown; of those that are as frequent, the first by name."""
    return sorted(counts.items(), key=lambda one: (-one[1], one[0]))[:_SHOWN]


def _counted(texts: pl.Series, weights: NDArray[np.int64] | None) -> dict[str, int]:
    """How often each text stands, in the order of the texts: a group has no place of its own."""
    frame = pl.DataFrame({"text": texts, "times": np.ones(len(texts), np.int64) if weights is None else weights})
    found = frame.drop_nulls().group_by("text").agg(pl.col("times").sum())
    return dict(sorted(zip(found["text"].cast(pl.String).to_list(), found["times"].to_list(), strict=True)))
