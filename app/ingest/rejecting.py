"""Counting what cannot be used: exactly by code, listed up to a limit."""

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import repeat
from types import MappingProxyType
from typing import Self

from app.ingest.model import Reject, Rejects

TEXT_LIMIT = 200


class RejectLog:
    """Collects rejects while a file is read."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._counts: Counter[str] = Counter()
        self._listed: list[Reject] = []

    def add(self, code: str, text: str, line: int | None = None, tag: str = "") -> None:
        self.add_many(code, (line,), (text,), tag)

    def add_many(
        self,
        code: str,
        lines: Sequence[int | None],
        texts: Iterable[str],
        tags: str | Iterable[str | None] = "",
        more: int = 0,
    ) -> None:
        """`texts` and `tags` may be generators: only as many are made as are listed. A single tag stands for all.
        more: how many there are beside those in `lines`, not to be listed."""
        if not len(lines) + more:
            return
        self._counts[code] += len(lines) + more
        room = self._limit - len(self._listed)
        if room <= 0:
            return
        each = repeat(tags) if isinstance(tags, str) else tags
        for line, text, tag in zip(lines[:room], texts, each, strict=False):
            number = None if line is None else int(line)
            self._listed.append(Reject(number, code, printable(text), printable(tag or "")))

    def take(self, other: Self) -> None:
        """What another log collected."""
        self._counts.update(other._counts)
        self._listed += other._listed[: max(0, self._limit - len(self._listed))]

    @property
    def codes(self) -> set[str]:
        return set(self._counts)

    def another(self) -> Self:
        """An empty one with the same limit."""
        return type(self)(self._limit)

    def result(self) -> Rejects:
        """Listed in the order of the lines, those without one last: each step of reading finds its own."""
        in_order = sorted(self._listed, key=lambda reject: (reject.line is None, reject.line or 0))
        return Rejects(MappingProxyType(dict(self._counts)), tuple(in_order))


def printable(text: str) -> str:
    """Without control characters (they could forge a line of a log) and cut to a length that a table can show."""
    shown = "".join(
        character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in text[: TEXT_LIMIT + 1]
    )
    return shown if len(shown) <= TEXT_LIMIT else shown[: TEXT_LIMIT - 1] + "…"
