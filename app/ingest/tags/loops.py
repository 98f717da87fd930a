"""Tags into loops: which tag has which signal of its loop, and which are kept beside them."""

from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

from app.ingest.model import LoopTags, Signal
from app.ingest.tags.grouping import (
    AUDITED,
    OPTIONAL,
    SEPARATORS,
    Place,
    TagMapping,
    number_of,
    place,
    precedence,
    without_unit,
)
from app.ingest.tags.settling import STEPS
from app.ingest.telling import without_controls

_LETTERS: Mapping[str, Signal] = MappingProxyType({"Y": "PV", "U": "OP", "R": "SP"})
"""Of textbooks: names where a table is asked for its columns, but no tags of a plant, where they may be anything."""


class Grouping:
    """Places tags: of those that name one signal of a loop the first by mapping and `precedence` has it, in whatever
    order they come, others are kept as further signals. A mode stays with the tag that came first: its values are read
    as modes from then on."""

    def __init__(self, stem: str, mapping: TagMapping | None = None) -> None:
        self._stem = without_controls(stem)
        self._mapping = mapping
        self._spelling: dict[str, str] = {}
        self._taken: dict[tuple[str, Signal], str] = {}
        self._others: dict[str, list[str]] = {}
        self._places: dict[str, Place] = {}
        self.second: dict[str, Place] = {}  # of the tag that has the signal
        self.of_other_number: list[str] = []
        self.settled: dict[str, dict[str, Place]] = {}  # by what is to be said of it
        self.with_controls: dict[str, None] = {}  # tags, as they are shown

    def place_all(self, tags: Iterable[str]) -> None:
        """Tags that are known at once; of equal ones the first has the signal."""
        for tag in sorted(tags, key=self._rank):
            self.place(tag, in_order=True)
        self.settle()

    def settle(self) -> None:
        """When all tags are known; what a mapping says of one stays."""
        for what, step in STEPS.items():
            free = {tag: at for tag, at in self._places.items() if not (self._mapping and self._mapping.find(tag))}
            moves = step(free, self._taken)
            for tag, at in moves.items():
                self._move(tag, at)
            if moves:
                self.settled[what] = moves

    def _move(self, tag: str, to: Place) -> None:
        loop = self._spelling.setdefault(to.loop.casefold(), to.loop)
        at = self._places[tag]
        if at.signal == "OTHER":
            self._others[at.loop].remove(tag)
            if not self._others[at.loop]:
                del self._others[at.loop]
        else:
            del self._taken[at.loop, at.signal]
        if to.signal == "OTHER":
            self._places[tag] = self._beside(tag, loop)
        else:
            self._taken[loop, to.signal] = tag
            self._places[tag] = Place(tag, loop, to.signal)

    def _rank(self, tag: str) -> tuple[int, tuple[int, int]]:
        return (0 if self._mapping is None else self._mapping.rank(tag)), precedence(tag)

    def place(self, tag: str, in_order: bool = False) -> Place:
        """Of a tag, as far as it is known: a later one may take its signal, unless they come in order."""
        written, tag = tag, without_controls(tag)
        if tag != written:
            self.with_controls[tag] = None
        known = self._places.get(tag)
        if known is None:
            known = self._places[tag] = self._settle(tag, in_order)
        return known

    def _settle(self, tag: str, in_order: bool) -> Place:
        mapped = self._mapping.find(tag) if self._mapping else None
        found = Place(tag, mapped.loop, mapped.signal) if mapped else self._by_name(tag)
        loop = self._spelling.setdefault(found.loop.casefold(), found.loop)
        if found.signal == "OTHER":
            return self._beside(tag, loop)
        owner = self._taken.setdefault((loop, found.signal), tag)
        here = Place(tag, loop, found.signal)
        if owner == tag:
            return here
        if in_order or found.signal == "MODE" or self._equal_less(owner) <= self._equal_less(tag):
            self.second[tag] = Place(owner, loop, found.signal)
            return self._beside(tag, loop)
        self._taken[(loop, found.signal)] = tag
        self._places[owner] = self._beside(owner, loop)
        self.second |= {other: here for other, at in self.second.items() if at[1:] == here[1:]} | {owner: here}
        return here

    def _beside(self, tag: str, loop: str) -> Place:
        self._others.setdefault(loop, []).append(tag)
        return Place(tag, loop, "OTHER")

    def _equal_less(self, tag: str) -> tuple[tuple[int, tuple[int, int]], int, str]:
        """Rank by which no two tags are equal."""
        return self._rank(tag), len(tag), tag

    def _by_name(self, tag: str) -> Place:
        """A set point or a mode of another number than PV and OP is another loop's: none is better than a wrong one."""
        found = place(tag, self._stem)
        number = number_of(tag) if found.signal in OPTIONAL else ""
        if not number:
            return found
        loop = self._spelling.get(found.loop.casefold(), found.loop)
        beside = (self._taken.get((loop, "PV")), self._taken.get((loop, "OP")))
        if any(other and number_of(other) == number for other in beside):
            return found
        self.of_other_number.append(tag)
        return Place(tag, found.loop, "OTHER")

    def place_beside(self, tag: str, loop: str) -> None:
        """A further signal of a loop that its name does not tell; a mapping may say otherwise."""
        mapped = self._mapping is not None and self._mapping.find(tag) is not None
        if tag not in self._places and not mapped:
            self._places[tag] = self._beside(tag, loop)

    def attach_bare(self, tags: Sequence[str]) -> None:
        """In a file of one loop without tags, the other columns belong to that loop; of one loop it is where PV and OP
        have no tag, or no other loop's have one."""
        places = [place(tag, "") for tag in tags]
        bare = {found.signal for found in places if found.loop == ""}
        if not bare.issuperset(AUDITED) and any(found.loop and found.signal in AUDITED for found in places):
            return
        if self._is_of_named_loops(tags):
            return
        for tag, loop, _ in places:
            if loop != "":
                self.place_beside(tag, self._stem)

    def _is_of_named_loops(self, tags: Sequence[str]) -> bool:
        """Whether several loops have PV and OP by their tags, or one beside names that lack theirs, as `.PV`: the
        nameless loop is one more then. A single one may be what is measured beside the loop of the file."""
        pairs = sum(loop.loop != "" and bool(loop.pv and loop.op) for loop in group(tags, self._mapping))
        lacking = any(tag.strip()[:1] in tuple(SEPARATORS) and place(tag, "").loop == "" for tag in tags)
        return pairs > 1 or (pairs == 1 and lacking)

    @property
    def tags(self) -> int:
        return len(self._places)

    @property
    def placed(self) -> tuple[str, ...]:
        return tuple(self._places)

    def loops(self) -> tuple[LoopTags, ...]:
        names = dict.fromkeys([loop for loop, _ in self._taken] + list(self._others))
        return tuple(
            LoopTags(
                loop,
                self._taken.get((loop, "PV")),
                self._taken.get((loop, "OP")),
                self._taken.get((loop, "SP")),
                self._taken.get((loop, "MODE")),
                tuple(self._others.get(loop, ())),
            )
            for loop in names
        )


def group(tags: Iterable[str], mapping: TagMapping | None = None, stem: str = "") -> tuple[LoopTags, ...]:
    """The loops of a list of tags."""
    grouping = Grouping(stem, mapping)
    grouping.place_all(tags)
    return grouping.loops()


def signals_of(names: Iterable[str]) -> Mapping[Signal, str]:
    """Which of a table's names, as it has them, tells which signal of its one loop: the one with PV and OP, one without
    a name before others. None does where several may be meant."""
    names = list(names)
    written = {without_controls(name): name for name in reversed(names)}
    loops = [loop for loop in group(names) if loop.pv or loop.op or loop.sp]
    loops = [loop for loop in loops if loop.pv and loop.op] or loops
    loops = [loop for loop in loops if loop.loop == ""] or loops
    if len(loops) > 1:
        return {}
    words = {signal: written[tag] for loop in loops for signal, tag in _signals(loop).items() if tag is not None}
    letters = {signal: name for name in reversed(names) if (signal := _LETTERS.get(without_unit(name).strip().upper()))}
    beside = AUDITED & letters.keys() - words.keys()
    return words | {signal: name for signal, name in letters.items() if beside and signal not in words}


def _signals(loop: LoopTags) -> dict[Signal, str | None]:
    return {"PV": loop.pv, "OP": loop.op, "SP": loop.sp, "MODE": loop.mode}
