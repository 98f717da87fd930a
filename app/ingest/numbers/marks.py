"""Points and commas in numbers: which of them stands before decimals and which between thousands.

Either may be meant where exactly three digits follow one to three others that do not begin with 0: 1,000 is one or a
thousand.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

import numpy as np
import polars as pl

from app.ingest.numbers.kind_codes import WHOLE as WITHOUT_MARK
from app.ingest.numbers.kinds import WITH
from app.ingest.telling import tags_by

POINT, RETURN, LINE_FEED, QUOTE, BLANK = b'.\r\n" '
_BEFORE, _BEHIND = r"^[ \"]*[+-]?", r"(?:[^\d.,eE].*)?$"
GROUPED = _BEFORE + r"[1-9]\d{0,2}(?:%s\d{3})+(?:%s\d+)?" + _BEHIND
DOUBTFUL = r"^[ \"]*([+-]?[1-9]\d{0,2}[.,]\d{3})" + _BEHIND
WHOLE = r"^[ \"]*([+-]?\d+)(?:\s*[^\d\s.,:+-].*)?$"
DECIMALS = r"^[ \"]*([+-]?\d+[%s]\d+)" + _BEHIND
WRITTEN = r"^[ \"]*[+-]?[1-9]\d{0,2}\.\d\d0[ \"]*$"  # in doubt, and no number of a cell: these end in no zero
ALL_DOUBTFUL = r"^(?:[+-]?[1-9]\d{0,2}[.,]\d{3}|\D*)$"
POINTED = _BEFORE + r"\d+\.\d+[ \"]*$"
FIRST_BYTES = 1 << 16
PARTED_FROM = 1000.0  # what parts thousands writes no such number without a mark
BETWEEN_BOTH = 1000**0.5  # of a tag's decimals over what is doubtful: halfway from 1 to 1,000
BESIDE_DECIMALS, BESIDE_THOUSANDS = 10.0, 100.0  # how far off what has no mark is from 1 where it is meant as 1,000

NEGLIGIBLE = 0.01  # of a tag's numbers: so few tell nothing of the others, whatever they look like
MOST_CODES, MOST_CODES_SHARE = 3, 0.1  # of a tag's numbers, for how many stand for no data or a limit


def other_mark(mark: str) -> str:
    return "." if mark == "," else ","


def before_decimals(mark: str, behind: str = _BEHIND) -> str:
    """What a number looks like where the mark stands before decimals for sure, or the other one between thousands."""
    decimals = rf"0?[{mark}]\d+|\d+[{mark}](?:\d{{1,2}}|\d{{4,}})|\d{{4,}}[{mark}]\d+|\d+[{mark}]\d+[eE][+-]?\d+"
    parted = rf"[1-9]\d{{0,2}}(?:[{other_mark(mark)}]\d{{3}})+[{mark}]\d+"
    twice = rf"[1-9]\d{{0,2}}(?:[{other_mark(mark)}]\d{{3}}){{2,}}"
    return rf"{_BEFORE}(?:{decimals}|{parted}|{twice}){behind}"


def groups_for_sure(mark: str) -> str:
    """What a number looks like whose thousands are parted by the mark for sure: twice, or with decimals behind."""
    return rf"{_BEFORE}[1-9]\d{{0,2}}(?:(?:[{mark}]\d{{3}}){{2,}}|[{mark}]\d{{3}}[{other_mark(mark)}]\d+){_BEHIND}"


def near_decimals(doubtful: pl.DataFrame, decimals: pl.DataFrame, largest: Mapping[str, float]) -> set[str]:
    """The tags whose doubtful numbers, taken as decimals, are nearer to their others than as thousands. Tags and
    numbers: doubtful, and decimals beside them; largest: by tag, of numbers that were read before."""
    sizes = _sizes(doubtful)
    sizes = sizes.join(_sizes(decimals), on="tag", how="left", suffix="_beside")
    return {
        tag
        for tag, size, _, beside, _ in sizes.iter_rows()
        if min(beside or math.inf, largest.get(tag, math.inf)) < BETWEEN_BOTH * size
    }


class DoubtfulMarks:
    """How numbers with a doubtful mark are read. In a file that does not tell: by what a tag's numbers without a mark
    are near to, but for codes, each tag by itself; tags without any as the others; where none has any, as usual. In a
    file that tells: as it does, unless a tag's numbers without a mark are near to the other reading."""

    def __init__(self, usual: str = "decimals") -> None:
        self._usual = usual
        self._of: dict[str, str] = {}  # decimals, thousands or, where neither is clear, nothing
        self._as_file: dict[str, str] = {}  # thousands or nothing, of tags that are read as the others tell
        self._assumed: set[str] = set()  # tags that were read as others or as usual
        self.changing: set[str] = set()  # tags whose marks change over: what would be thousands is refused

    def look(self, doubtful: pl.DataFrame, beside: pl.DataFrame) -> None:
        """Tags and numbers. doubtful: their mark is taken for one before decimals. beside: those without a mark."""
        beside = _without_codes(doubtful, beside)
        few = hardly_any(doubtful, beside)
        for tag, ratio, _, largest_beside in _ratios(doubtful, beside):
            found = _meant(ratio, largest_beside)
            if not found and tag in few:
                continue
            self._of[tag] = found if self._of.get(tag, found) == found else ""

    def look_as_file(self, tags: Iterable[str], doubtful: pl.DataFrame, beside: pl.DataFrame) -> None:
        """The same of some tags where the file tells that the mark stands between thousands."""
        near = {tag for tag, ratio, largest, _ in _ratios(doubtful, beside) if _is_near_decimals(ratio, largest)}
        for tag in tags:
            found = "" if tag in near else "thousands"
            self._as_file[tag] = found if self._as_file.get(tag, found) == found else ""

    def meant(self, tag: str) -> str:
        """decimals, thousands or nothing where it is not clear; the same from now on."""
        if tag not in self._of:
            self._of[tag] = next(filter(None, self._of.values()), self._usual)
            self._assumed.add(tag)
        return self._of[tag]

    def decided(self) -> dict[tuple[str, str], str]:
        """By what was decided, and of which tag."""
        changing = dict.fromkeys(self.changing, "")
        kinds = {"in doubt": self._of, "as the file": self._as_file, "changing": changing}
        return {(kind, tag): found for kind, of in kinds.items() for tag, found in of.items()}

    def are_decimals(self, kinds: Mapping[str, int], thousands: str) -> bool:
        """Whether all marks in doubt were read as decimals, and none of them parts thousands as the file tells it."""
        return all(
            found == "decimals" and not kinds.get(tag, WITH[thousands]) & WITH[thousands]
            for tag, found in self._of.items()
        )

    def forget(self) -> None:
        """What was in doubt before the file told it."""
        self._of, self._assumed = {}, set()

    def may_be_told(self, kinds: Mapping[str, int]) -> bool:
        """Whether the numbers of all chunks together may tell more of doubtful marks than those of each: where numbers
        without a mark stand in the tags that have some, or others tell of tags that were read as usual. kinds: of the
        fields of tags, as far as they were seen."""
        if any(kinds.get(tag, WITHOUT_MARK) & WITHOUT_MARK for tag in self._of):
            return True
        meant = {found for tag, found in self._of.items() if tag not in self._assumed}
        return any(self._of[tag] not in meant for tag in self._assumed) and bool(meant)

    def met(self) -> Collection[str]:
        """The tags whose marks were in doubt before the file told them."""
        return self._of.keys()

    def as_file(self, *found: str) -> list[str]:
        """The tags whose marks were read so as the file tells."""
        return [tag for tag, meant in self._as_file.items() if meant in found]

    def told(self, order: Sequence[str] = ()) -> str:
        """What was read as what; nothing where no mark was in doubt. order: that of the tags."""
        words = {"decimals": "read as decimals", "thousands": "read as thousands", "": "refused"}
        found_of = self._as_file | dict.fromkeys(sorted(self.changing), "") | self._of
        return "; ".join(f"{words[found]}: {tags}" for found, tags in tags_by(found_of, order).items())


def _without_codes(doubtful: pl.DataFrame, beside: pl.DataFrame) -> pl.DataFrame:
    """Beside, but for the few numbers that seldom stand in a tag, far off its doubtful ones however these are meant:
    -999 and 32767 stand for no data, 100 for a limit."""
    number = pl.col("number")
    of_tag = doubtful.group_by("tag").agg(
        pl.len().alias("doubtful"), (number.min() * 1000).alias("low"), (number.max() * 1000).alias("high")
    )
    kinds = beside.group_by("tag", "number").len().join(of_tag, on="tag")
    size = pl.max_horizontal(pl.col("low").abs(), pl.col("high").abs())
    clear = pl.max_horizontal(pl.col("high") - pl.col("low"), size / 2)
    off_thousands = ~number.is_between(pl.col("low") - clear, pl.col("high") + clear) | (number.abs() >= PARTED_FROM)
    off_decimals = number.abs() > BESIDE_DECIMALS * size / 1000
    few = (pl.len().over("tag") <= MOST_CODES) & (pl.sum("len").over("tag") <= MOST_CODES_SHARE * pl.col("doubtful"))
    return beside.join(kinds.filter(few & off_thousands & off_decimals), on=["tag", "number"], how="anti")


def hardly_any(doubtful: pl.DataFrame, beside: pl.DataFrame) -> set[str]:
    """The tags that have next to no numbers beside their doubtful ones."""
    counts = doubtful.group_by("tag").len().join(beside.group_by("tag").len(), on="tag", suffix="_beside")
    return set(counts["tag"].filter(counts["len_beside"] < NEGLIGIBLE * counts["len"]))


def _ratios(doubtful: pl.DataFrame, beside: pl.DataFrame) -> Iterator[tuple[str, float, float, float]]:
    """Tag, its numbers beside in the middle and at most, over the doubtful ones in the middle, and at most."""
    both = _sizes(doubtful).join(_sizes(beside), on="tag", maintain_order="left", suffix="_beside")
    for tag, size, _, size_beside, largest_beside in both.iter_rows():
        yield tag, size_beside / size, largest_beside / size, largest_beside


def largest(numbers: pl.Expr) -> pl.Expr:
    """But for so few that they tell nothing."""
    return numbers.quantile(1 - NEGLIGIBLE, "higher")


def _sizes(numbers: pl.DataFrame) -> pl.DataFrame:
    """How large the numbers of a tag are, in the middle and at most, but for zeros."""
    size = numbers.select("tag", pl.col("number").abs()).filter(pl.col("number").is_between(0, np.inf, closed="none"))
    return size.group_by("tag", maintain_order=True).agg(
        pl.col("number").median(), largest(pl.col("number")).alias("largest")
    )


def _meant(ratio: float, largest_beside: float) -> str:
    if ratio <= BESIDE_DECIMALS:
        return "decimals"
    if largest_beside >= PARTED_FROM:
        return "decimals" if ratio < BESIDE_THOUSANDS else ""
    return "thousands" if ratio >= BESIDE_THOUSANDS else ""


def _is_near_decimals(ratio: float, largest_ratio: float) -> bool:
    return ratio <= BESIDE_DECIMALS and largest_ratio < BESIDE_THOUSANDS


def has_points(data: bytes, delimiter: str) -> bool:
    """Whether a whole field of the lines, the last of them ended too, is a number with a point."""
    if b"." not in data:
        return False
    behind = data.find(b"\n", FIRST_BYTES) + 1  # the first lines mostly tell
    text = np.frombuffer(data, np.uint8)
    return _has_points(text[:behind], delimiter) or _has_points(text[behind:], delimiter)


def _has_points(text: np.ndarray, delimiter: str) -> bool:
    at = np.flatnonzero(text == POINT)
    at = at[(at > 0) & (at < len(text) - 1)]
    at = at[_is_digit(text[at - 1]) & _is_digit(text[at + 1])]
    end = _past_digits(text, at + 1, 1)
    at = at[_is_one_of(text[end], ord(delimiter), RETURN, LINE_FEED, QUOTE, BLANK)]
    start = _past_digits(text, at - 1, -1)
    start -= _is_one_of(text[start], *b"+-") & (start > 0)
    return bool(((start <= 0) | _is_one_of(text[start], ord(delimiter), LINE_FEED, QUOTE, BLANK)).any())


def _past_digits(text: np.ndarray, at: np.ndarray, step: int) -> np.ndarray:
    """Where the digits end on which each place is; the text's own end is none."""
    at = at.copy()
    going = np.arange(len(at))
    while len(going):
        going = going[_is_digit(text[at[going]]) & (at[going] > 0)]
        at[going] += step
    return at


def _is_digit(found: np.ndarray) -> np.ndarray:
    return (found >= ord("0")) & (found <= ord("9"))


def _is_one_of(found: np.ndarray, *bytes_: int) -> np.ndarray:
    same = found == bytes_[0]
    for byte in bytes_[1:]:
        same |= found == byte
    return same


def all_doubtful(texts: pl.Series) -> bool:
    """Whether there are numbers among texts, all with a mark that may part thousands: none tells how it is meant."""
    return bool(texts.str.contains(ALL_DOUBTFUL).all() and texts.str.contains(r"\d").any())


def marked(texts: pl.Series) -> np.ndarray:
    """Where numbers with a mark stand that may part thousands, and whatever has a comma."""
    return texts.str.contains(f",|{POINTED}").fill_null(False).to_numpy()


def pointed(texts: pl.DataFrame) -> dict[str, np.ndarray]:
    """By column, where numbers with a point stand, of the columns that have any."""
    found = {column.name: column.str.contains(POINTED).fill_null(False).to_numpy() for column in texts}
    return {name: at for name, at in found.items() if at.any()}
