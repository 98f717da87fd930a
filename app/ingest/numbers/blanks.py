"""Plain blanks between thousands, as in `1 234,5`. Two numbers in one field stand so too, which none of them is."""

from collections import Counter
from collections.abc import Callable

import polars as pl

from app.ingest.numbers.marks import BESIDE_DECIMALS, NEGLIGIBLE, PARTED_FROM, largest
from app.ingest.times.time_reader import to_numbers

_GROUPS = r"^[ \"]*[+-]?([1-9]\d{0,2})(?: \d{3})+"
_BEHIND = r"(?:[ \"]*|\s*[^\d\s.,eE+\-\"].*)$"
GROUPED = _GROUPS + r"(?:[.,]\d+)?" + _BEHIND
WITH_DECIMALS = _GROUPS + r"[.,]\d+" + _BEHIND
_TWO_NUMBERS = r"\d +[+-]?[.,]?\d"
_PLAIN = r"^[ \"]*[+-]?(\d+(?:[.,]\d+)?)" + _BEHIND


class Blanks:
    """Which tags part thousands so: those of which a number has decimals behind them, or whose numbers without a blank
    are far beyond what stands before the blanks: 998 beside `1 002`, but not 45 beside `45 192`, a value and its
    quality. Where one does, the file does; but never a tag that has two numbers in more than next to no fields."""

    def __init__(self) -> None:
        self._parted: set[str] = set()
        self._two: set[str] = set()
        self._spaced: Counter[str] = Counter()  # by tag, how many fields have blanks between digits
        self._apart: Counter[str] = Counter()  # and how many of these are two numbers
        self._joins: dict[str, set[bool]] = {}  # of tags with blanks, whether they part thousands, as it was known then

    def learn(self, odd: pl.DataFrame, rest: Callable[[], pl.DataFrame]) -> None:
        """odd: tag and text of what the fast reader left. rest: of what it read."""
        spaced = odd.filter(odd["text"].str.contains(_TWO_NUMBERS).fill_null(False))
        if not len(spaced):
            return
        grouped = spaced["text"].str.contains(GROUPED)
        self._count(spaced["tag"], grouped)
        self._look(spaced.filter(grouped & ~spaced["tag"].is_in([*self._two, *self._parted])), odd, rest)
        joins = bool(self._parted - self._two)
        for tag in spaced["tag"].filter(grouped).unique():
            self._joins.setdefault(tag, set()).add(joins and tag not in self._two)

    def _count(self, tags: pl.Series, grouped: pl.Series) -> None:
        self._spaced.update(dict(tags.value_counts().iter_rows()))
        self._apart.update(dict(tags.filter(~grouped).value_counts().iter_rows()))
        self._two = {tag for tag, times in self._apart.items() if times >= NEGLIGIBLE * self._spaced[tag]}

    @property
    def are_settled(self) -> bool:
        """Whether the blanks of each tag were read in one way, and nothing can tell otherwise."""
        return all(joins == {tag not in self._two} for tag, joins in self._joins.items())

    def _look(self, spaced: pl.DataFrame, odd: pl.DataFrame, rest: Callable[[], pl.DataFrame]) -> None:
        if not len(spaced):
            return
        self._parted.update(spaced["tag"].filter(spaced["text"].str.contains(WITH_DECIMALS)))
        tags = spaced["tag"].unique().implode()
        beside = pl.concat((odd, rest())).filter(pl.col("tag").is_in(tags))
        self._parted |= _far_beyond(_found(beside, _PLAIN), _found(spaced, _GROUPS))

    def joined(self, texts: pl.Series, tags: pl.Series) -> pl.Series:
        """Texts without the blanks between thousands."""
        if not self._parted - self._two:
            return texts
        parted = texts.str.contains(GROUPED).fill_null(False) & ~tags.is_in(list(self._two))
        return texts.zip_with(~parted, texts.str.replace_all(" ", "")) if parted.any() else texts


def _found(texts: pl.DataFrame, form: str) -> pl.DataFrame:
    """Tag and number of what a form takes out of texts."""
    found = texts.select("tag", text=pl.col("text").str.extract(form)).drop_nulls()
    return found.select("tag", number=pl.Series(to_numbers(found["text"])))


def _far_beyond(plain: pl.DataFrame, leading: pl.DataFrame) -> set[str]:
    """The tags whose plain numbers are far beyond the leading groups of the others, and none of which had been parted
    as well."""
    number = pl.col("number")
    beside = plain.group_by("tag").agg(number.median().alias("usual"), largest(number).alias("largest"))
    both = leading.group_by("tag").agg(number.median()).join(beside, on="tag")
    far = (pl.col("usual") > BESIDE_DECIMALS * number) & (pl.col("largest") < PARTED_FROM)
    return set(both.filter(far)["tag"])
