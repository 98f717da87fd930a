"""How a file writes numbers that are not plain: what stands between their thousands, and the units behind them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import polars as pl

from app.ingest.numbers.blanks import Blanks
from app.ingest.numbers.evidence import Evidence
from app.ingest.numbers.kinds import decimal_mark_of
from app.ingest.numbers.marks import (
    DECIMALS,
    DOUBTFUL,
    GROUPED,
    NEGLIGIBLE,
    WHOLE,
    DoubtfulMarks,
    before_decimals,
    groups_for_sure,
    hardly_any,
    near_decimals,
    other_mark,
)
from app.ingest.numbers.signs import Signs, with_minus_before
from app.ingest.numbers.units import UnitsOfTags, are_units
from app.ingest.telling import tags_by
from app.ingest.times.time_reader import to_numbers

SENTINELS = (-9999.0, -99.125)
MARKED = "[.,]"
MOST_SLIPS, MOST_SLIPS_SHARE = 3, 0.1  # of a tag's numbers with a mark
_BETWEEN_DIGITS = "['\N{RIGHT SINGLE QUOTATION MARK}\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}]"  # never decimal marks
_BEHIND_NUMBER = r"^[ \"]*[+-]?[\d.,]+(?:[eE][+-]?\d+)?([^\"]*)"
_NOTHING_BEHIND = r"[\s\"]*$"
_STYLES = {",": "decimal points", ".": "decimal commas", "": "both"}


@dataclass
class Writing:
    """thousands: the mark between them, empty as long as the file does not tell it from the decimal mark; what is in
    doubt until then is left to `marks`. own: the same of tags that show another one than the file, empty where they
    show point and comma before decimals. units: behind the numbers of each tag. odd: tags with numbers that are not
    plain.

    It is learnt chunk by chunk. Where a later one tells what would have had earlier ones read otherwise, it is not
    settled: `learn_once` from all rows then, and read again."""

    thousands: str = ""
    own: dict[str, str] = field(default_factory=dict)
    units: UnitsOfTags = field(default_factory=UnitsOfTags)
    marks: DoubtfulMarks = field(default_factory=DoubtfulMarks)
    blanks: Blanks = field(default_factory=Blanks)
    signs: Signs = field(default_factory=Signs)
    odd: set[str] = field(default_factory=set)
    _chunks: int = 0  # that were read to their end
    _unsettled: bool = False
    _knows_all: bool = False
    _told_before: bool = field(init=False)
    _slips: set[str] = field(default_factory=set)  # tags of which a few numbers are written otherwise
    _ignored: dict[str, set[str]] = field(default_factory=lambda: {".": set(), ",": set()})
    """By a mark before decimals, the tags of which hardly any number shows it, where the file does not tell."""
    _late: set[str] = field(default_factory=set)  # tags of which numbers were read before they showed their own
    _parted: set[str] = field(default_factory=set)  # tags whose thousands are parted for sure

    def __post_init__(self) -> None:
        self._told_before = bool(self.thousands)

    def learn_once(self, evidence: Evidence) -> None:
        """From what all rows tell."""
        odd = evidence.odd
        self.learn(odd["text"], odd["tag"], evidence.rest)
        self._knows_all = True

    def end_chunk(self) -> None:
        self._chunks += 1

    def is_settled(self, kinds: Mapping[str, int]) -> bool:
        """Whether all numbers were read as all chunks together tell. kinds: of the fields of tags, as far as they were
        seen."""
        if self._knows_all or self._chunks < 2:
            return True
        if self._unsettled or not self.blanks.are_settled or "" in self.own.values():
            return False
        if self.thousands:
            return self.marks.are_decimals(kinds, self.thousands)
        return not self.marks.may_be_told(kinds)

    def settle(self) -> None:
        """When all chunks were read: what was taken for decimals before the file told it is no longer in doubt."""
        if self.thousands and self._chunks > 1:
            self.marks.forget()

    def learn(
        self,
        texts: pl.Series,
        tags: pl.Series,
        rest: Callable[[], pl.DataFrame],
        before: Callable[[str], float | None] = lambda _: None,
    ) -> None:
        """Looks for what tells thousands from decimals, before numbers are read. texts: what the fast reader left.
        rest: tag and text of what it read. before: how large the numbers of a tag are at most that were read before;
        None where none of it was."""
        if self._knows_all:
            return
        odd = pl.DataFrame({"tag": tags, "text": with_minus_before(texts)})
        self.odd.update(odd["tag"].unique().drop_nulls())
        decided = self._decided()
        self._learn(odd, rest, before)
        if self._chunks:
            self._unsettled |= self._would_change(decided, before)

    def _decided(self) -> dict[tuple[str, str], str]:
        return self.marks.decided() | {("own", tag): mark for tag, mark in self.own.items()}

    def _would_change(self, decided: Mapping[tuple[str, str], str], before: Callable[[str], float | None]) -> bool:
        """Whether what is known now of tags is not what was decided when earlier chunks were read."""
        now = self._decided()
        if any(now.get(what) != how for what, how in decided.items()):
            return True
        new = now.keys() - decided.keys()
        own = not self._told_before and any(kind == "own" for kind, _ in new)
        return own or any(before(tag) is not None for _, tag in new)

    def _learn(
        self, odd: pl.DataFrame, rest: Callable[[], pl.DataFrame], before: Callable[[str], float | None]
    ) -> None:
        self.blanks.learn(odd, rest)
        odd = odd.with_columns(text=self._without_groups(odd["text"], odd["tag"]))
        otherwise = self._otherwise(odd, rest)
        doubtful = odd.filter(_contains(odd["text"], self._doubtful()))
        concerned = otherwise | self.own.keys() | set(doubtful["tag"].unique())
        if not concerned:
            return
        every = pl.concat((odd, rest())).filter(pl.col("tag").is_in(list(concerned)))
        slips = self._that_slip(every)
        otherwise -= slips
        self._unsettled |= not slips.isdisjoint(self._slips)
        self._slips |= slips
        self._learn_own(otherwise, every, lambda tag: before(tag) is not None)
        self._learn_changing(doubtful, every, before)
        doubtful = doubtful.filter(~pl.col("tag").is_in(list(self.own)))
        if len(doubtful):
            self._look(doubtful, every)

    def learn_from(self, kinds: int) -> None:
        """The same from the kinds of all fields, where no text is needed to tell."""
        if not self._knows_all and not self.thousands and not self.own and (mark := decimal_mark_of(kinds)):
            self.thousands = other_mark(mark)

    def _doubtful(self) -> str:
        return _doubtful(self.thousands) if self.thousands else DOUBTFUL

    def _otherwise(self, odd: pl.DataFrame, rest: Callable[[], pl.DataFrame]) -> set[str]:
        """The tags that write otherwise than the file. It tells how it is written where all that show it agree."""
        if self.thousands:
            return _that_show(odd, self.thousands)
        shown = {mark: _that_show(odd, mark) for mark in (".", ",")}
        if any(shown.values()):
            every = pl.concat((odd, rest())).filter(pl.col("tag").is_in(list(set().union(*shown.values()))))
            shown = {mark: tags - self._ignore(mark, tags, every) for mark, tags in shown.items()}
        if all(shown.values()):
            return set().union(*shown.values())
        self.thousands = next((other_mark(mark) for mark, tags in shown.items() if tags), "")
        return set()

    def _ignore(self, mark: str, tags: set[str], every: pl.DataFrame) -> set[str]:
        """Those of the tags that show a mark of which hardly any number does, where the others show another one, or are
        near to these few only as decimals: the few are refused."""
        written = _written_so(every, f"{before_decimals(mark)}|{_doubtful(mark)}")
        of_few = every.filter(pl.col("tag").is_in(written["tag"].filter(written["share"] < NEGLIGIBLE).implode()))
        others, few = _numbers(of_few, _doubtful(other_mark(mark))), _numbers(of_few, DECIMALS % mark)
        ignored = tags & (near_decimals(others, few, {}) | _that_show(of_few, other_mark(mark)))
        self._unsettled |= not tags.isdisjoint(self._ignored[mark])
        self._ignored[mark] = (self._ignored[mark] - tags) | ignored
        return ignored

    def _that_slip(self, every: pl.DataFrame) -> set[str]:
        """The tags that are written otherwise than the file tells by hardly any number, or by a few where no other one
        of theirs tells how it is meant: these are refused, and the others are not read as they are."""
        if not self.thousands:
            return set()
        written = _written_so(every, before_decimals(self.thousands))
        few = (pl.col("count") <= MOST_SLIPS) & (pl.col("share") <= MOST_SLIPS_SHARE)
        slips = set(written.filter(few)["tag"]) - _that_show(every, other_mark(self.thousands))
        return (slips | _hardly_show(every, self.thousands)) - self.own.keys()

    def _learn_own(self, otherwise: set[str], every: pl.DataFrame, was_read: Callable[[str], bool]) -> None:
        if not otherwise and not self.own:
            return
        points, commas = (_that_show(every, mark) - self._ignored[mark] for mark in (".", ","))
        both = points & commas
        points -= both & _hardly_show(every, ".")
        commas -= both & _hardly_show(every, ",")
        for tag in sorted(otherwise | (self.own.keys() & (points | commas))):
            shown = "" if tag in points & commas else "," if tag in points else "."
            if self.thousands and tag not in self.own and was_read(tag):
                self._late.add(tag)
            self.own[tag] = shown if self.own.get(tag, shown) == shown else ""

    def _learn_changing(
        self, doubtful: pl.DataFrame, every: pl.DataFrame, before: Callable[[str], float | None]
    ) -> None:
        """The tags of which numbers with the mark between thousands are near to those with the one before decimals, or
        to what was read before: then their marks change over. Not those that part thousands for sure."""
        for thousands in {self.thousands, *self.own.values()} - {""}:
            tags = [tag for tag in doubtful["tag"].unique() if self.own.get(tag, self.thousands) == thousands]
            own = every.filter(pl.col("tag").is_in(tags))
            self._parted.update(own["tag"].filter(_contains(own["text"], groups_for_sure(thousands))))
            parted = _numbers(own, _doubtful(thousands))
            decimals = _numbers(own, DECIMALS % other_mark(thousands))
            decimals = decimals.filter(~pl.col("tag").is_in(list(hardly_any(parted, decimals))))
            largest = {tag: size for tag in tags if (size := before(tag))}
            self.marks.changing.update(near_decimals(parted, decimals, largest) - self._parted)

    def _look(self, doubtful: pl.DataFrame, every: pl.DataFrame) -> None:
        """What the numbers without a mark say of the doubtful ones; what the file tells needs no word where the tag
        shows it too."""
        if self.thousands:
            known = _that_show(every, other_mark(self.thousands)).union(self.marks.met())
            doubtful = doubtful.filter(~pl.col("tag").is_in(list(known)))
        whole = _numbers(every, WHOLE).filter(~pl.col("number").is_in(SENTINELS))
        beside = doubtful.filter(pl.col("tag").is_in(whole["tag"].unique().implode()))
        if self.thousands:
            self.marks.look_as_file(doubtful["tag"].unique(maintain_order=True), _numbers(beside, DOUBTFUL), whole)
        else:
            self.marks.look(_numbers(beside, DOUBTFUL), whole)

    def are_decimals(self, tag: str) -> bool:
        """Whether the marks of a tag's numbers, which tell nothing of how they are meant, stand before decimals; the
        same from now on."""
        if tag in self.own:
            return False
        return (bool(self.thousands) and tag not in self.marks.met()) or self.marks.meant(tag) == "decimals"

    def whole(self, texts: pl.Series, tags: pl.Series) -> pl.Series:
        """Texts with the thousands of their numbers joined, null where it is not clear which these are."""
        texts = self._without_groups(texts, tags)
        thousands = self._thousands_of(tags)
        for mark, ignored in self._ignored.items() if not self.thousands else ():
            texts = texts.set(tags.is_in(list(ignored)) & _contains(texts, before_decimals(mark)), None)
        in_doubt = _contains(texts, DOUBTFUL)
        if in_doubt.any():
            texts = texts.set(in_doubt & self._refused(texts, tags, thousands), None)
        for mark in sorted({self.thousands, *self.own.values()} - {""}):
            form = GROUPED % (f"[{mark}]", f"[{other_mark(mark)}]")
            texts = _joined(texts, form, f"[{mark}]", thousands == mark)
        return texts if self.thousands else self._by_tag(texts, tags, in_doubt & ~tags.is_in(list(self.own)))

    def _without_groups(self, texts: pl.Series, tags: pl.Series) -> pl.Series:
        """With the thousands joined that no decimal mark parts."""
        return self.blanks.joined(_joined(texts, GROUPED % (_BETWEEN_DIGITS, MARKED), _BETWEEN_DIGITS), tags)

    def _thousands_of(self, tags: pl.Series) -> pl.Series:
        if not self.own:
            return pl.repeat(self.thousands, len(tags), dtype=pl.String, eager=True)
        return tags.replace_strict(self.own, default=self.thousands, return_dtype=pl.String)

    def _refused(self, texts: pl.Series, tags: pl.Series, thousands: pl.Series) -> pl.Series:
        """Where a doubtful number is refused: what its tag has beside it tells otherwise than the file, or it was read
        otherwise before its tag told: none is read both ways."""
        met = {tag: self.marks.meant(tag) for tag in self.marks.met()} if self.thousands or self.own else {}
        unlike = [*self._late, *self.marks.changing, *self.marks.as_file("")]
        unlike_before = [tag for tag in self.marks.as_file("thousands", "") if tag in self.own]
        if not (met or unlike or unlike_before):
            return pl.repeat(False, len(texts), dtype=pl.Boolean, eager=True)
        parted = ((thousands == ",") & _contains(texts, ",")) | ((thousands == ".") & _contains(texts, "[.]"))
        refused = (parted & tags.is_in(unlike)) | (~parted & tags.is_in(unlike_before))
        if met:
            before = tags.replace_strict(met, default=None, return_dtype=pl.String)
            refused |= ((thousands != "") & ((before == "") | ((before == "thousands") != parted))).fill_null(False)
        return refused

    def _by_tag(self, texts: pl.Series, tags: pl.Series, in_doubt: pl.Series) -> pl.Series:
        """With the thousands joined of the numbers in doubt whose tag has them; null where its tag does not tell."""
        meant: dict[str, list[str]] = {"": [], "thousands": [], "decimals": []}
        for tag in tags.filter(in_doubt).unique(maintain_order=True):
            meant[self.marks.meant(tag)].append(tag)
        if meant["thousands"]:
            parted = in_doubt & tags.is_in(meant["thousands"])
            texts = texts.zip_with(~parted, texts.str.replace_all(MARKED, ""))
        return texts.set(in_doubt & tags.is_in(meant[""]), None) if meant[""] else texts

    def notes(self, order: Sequence[str] = ()) -> list[str]:
        """What is to be said of how numbers were read. order: that of the tags."""
        return [*self.units.notes(order), *self.signs.notes(order), *self.doubts(order)]

    def doubts(self, order: Sequence[str] = ()) -> list[str]:
        """What is to be said of numbers that may be read in two ways."""
        told = {
            "decimals are written in two ways, and were read as each tag writes them": self._styles(order),
            "the mark of numbers such as 1,000 may part thousands or decimals": self.marks.told(order),
        }
        return [f"{what}: {tags}" for what, tags in told.items() if tags]

    def _styles(self, order: Sequence[str]) -> str:
        own = "; ".join(f"{_STYLES[mark]}: {tags}" for mark, tags in tags_by(self.own, order).items())
        return f"{own}; in the others {_STYLES[self.thousands]}" if own and self.thousands else own


def _contains(texts: pl.Series, form: str) -> pl.Series:
    return texts.str.contains(form).fill_null(False)


def _that_show(numbers: pl.DataFrame, mark: str) -> set[str]:
    """The tags of which a number shows that the mark stands before decimals."""
    bare = set(numbers["tag"].filter(_contains(numbers["text"], before_decimals(mark, _NOTHING_BEHIND))).unique())
    others = numbers.filter(~pl.col("tag").is_in(list(bare))) if bare else numbers
    found = others.filter(_contains(others["text"], before_decimals(mark)))
    found = found.select("tag", behind=pl.col("text").str.extract(_BEHIND_NUMBER).str.strip_chars()).unique()
    return bare.union(found["tag"].filter((found["behind"] == "") | are_units(found["behind"])))


def _doubtful(mark: str) -> str:
    return DOUBTFUL.replace("[.,]", f"[{mark}]")


def _written_so(numbers: pl.DataFrame, form: str) -> pl.DataFrame:
    """By tag, how many of its numbers with a mark are of a form, and their share."""
    marked = numbers.filter(_contains(numbers["text"], MARKED))
    found = marked.with_columns(found=_contains(marked["text"], form)).group_by("tag")
    return found.agg(count=pl.col("found").sum(), share=pl.col("found").mean()).filter(pl.col("count") > 0)


def _hardly_show(numbers: pl.DataFrame, mark: str) -> set[str]:
    return set(_written_so(numbers, before_decimals(mark)).filter(pl.col("share") < NEGLIGIBLE)["tag"])


def _numbers(texts: pl.DataFrame, form: str) -> pl.DataFrame:
    """Tag and number of the texts of that form."""
    found = texts.select("tag", number=pl.col("text").str.extract(form)).drop_nulls()
    return found.with_columns(number=pl.Series(to_numbers(found["number"])))


def _joined(texts: pl.Series, form: str, marks: str, where: pl.Series | bool = True) -> pl.Series:
    at = _contains(texts, form) & where
    return texts.zip_with(~at, texts.str.replace_all(marks, "")) if at.any() else texts
