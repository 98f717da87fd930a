"""The tags of a long table, numbered in the order in which they come, and where each of them belongs."""

import numpy as np
import polars as pl
from numpy.typing import NDArray

from app.errors import DataError
from app.ingest.model import IngestOptions
from app.ingest.tables.spilling import NumberOfLoop
from app.ingest.tags.grouping import Place
from app.ingest.tags.loops import Grouping
from app.ingest.tags.settling import family

NOWHERE = Place("", "", "OTHER")  # of tags whose rows are refused


class NumberedTags:
    """`places`, `modes` (tags of modes) and `usable` (tags whose rows are not refused) are by number; `places` grow
    while rows are gathered."""

    def __init__(self, grouping: Grouping, options: IngestOptions) -> None:
        self._grouping, self._options = grouping, options
        self.places: list[Place] = []
        self.modes = np.zeros(0, dtype=bool)
        self.usable = np.zeros(0, dtype=bool)
        self._number_of: dict[str, int] = {}
        self._known = np.zeros(0, dtype=bool)  # by polars' code, which depends on which chunk was parsed first
        self._number = np.zeros(0, dtype=np.uint32)  # by polars' code
        self._loops: list[int] = []
        self._number_of_loop = NumberOfLoop()
        self._new: list[str] = []

    def __len__(self) -> int:
        return len(self.places)

    def number(self, tag: str) -> int:
        """Of a tag that came."""
        return self._number_of[tag]

    def numbered(self, tag: str) -> int:
        """The number of a tag, a new one where it has none."""
        number = self._number_of.get(tag)
        if number is not None:
            return number
        if self._grouping.tags >= self._options.max_signals:
            raise DataError(
                "too_many_tags", f"more than {self._options.max_signals:,} tags in one file; send it in parts"
            )
        number = self._number_of[tag] = len(self.places)
        self._new.append(tag)
        self.places.append(self._grouping.place(tag) if len(tag) <= self._options.max_name else NOWHERE)
        return number

    def of_codes(self, codes: NDArray[np.uint32], tags: pl.Series, timed: NDArray[np.bool_]) -> NDArray[np.uint32]:
        """The number of each row's tag by polars' code of it; 0 where there is none. New tags are placed where rows
        have a time: others are comments, or have something else where tags stand."""
        more = int(codes.max(initial=0)) + 1 - len(self._known)
        if more > 0:
            self._known = np.append(self._known, np.zeros(more, dtype=bool))
            self._number = np.append(self._number, np.zeros(more, dtype=np.uint32))
        if not self._known.all():
            new = np.flatnonzero(~self._known[codes] & tags.is_not_null().to_numpy())
            new = new[timed[new]]
            _, first = np.unique(codes[new], return_index=True)
            for row in new[np.sort(first)]:
                code = int(codes[row])
                self._known[code], self._number[code] = True, self.numbered(tags[int(row)])
        return self._number[codes]

    def taken_in(self) -> list[str]:
        """The tags that are new since it was asked last; `modes` and `usable` tell of them from now on."""
        new, self._new = self._new, []
        if new:
            self.usable = np.array([place is not NOWHERE for place in self.places], dtype=bool)
            self.modes = np.array([place.signal == "MODE" for place in self.places], dtype=bool)
        return new

    def settle(self) -> None:
        """When all tags have come: a later one may have taken the signal of one that came before."""
        self._grouping.settle()
        self.places[:] = [at if at is NOWHERE else self._grouping.place(at.tag) for at in self.places]

    def loops(self) -> NDArray[np.uint32]:
        """The number of each tag's loop."""
        for place in self.places[len(self._loops) :]:
            self._loops.append(self._number_of_loop.of(family(place.loop)))
        return np.array(self._loops, dtype=np.uint32)

    def by_code(self) -> list[tuple[int, Place]]:
        """Polars' codes with the places of their tags, in the order in which these came."""
        known = np.flatnonzero(self._known)
        in_order = known[np.argsort(self._number[known])]
        return [(code, self.places[self._number[code]]) for code in in_order.tolist()]
