"""Columns without any number that are no signal of a loop, as remarks: left out with a note, not refused row by row."""

from collections.abc import Collection, Mapping

import numpy as np

from app.ingest.columns.plans import ValueColumn
from app.ingest.model import FloatArray
from app.ingest.rejecting import RejectLog

MOST_HELD = 100  # columns whose refusals are held back, each up to the limit of a log
NO_NUMBER = {"not_a_number"}


class WordyColumns:
    """Holds back what is refused of such columns until one of them has a number; `tags`: those that may be one."""

    def __init__(self, tags: Collection[str], log: RejectLog) -> None:
        self._log = log
        self._silent = set(tags)
        self._held: dict[str, RejectLog] = {}

    def log_of(self, tag: str) -> RejectLog:
        """Where what is refused of a column goes."""
        if tag not in self._silent or (tag not in self._held and len(self._held) == MOST_HELD):
            return self._log
        return self._held.setdefault(tag, self._log.another())

    def look(self, values: FloatArray, columns: Mapping[int, ValueColumn]) -> None:
        """values (n, columns) of a chunk, columns by their position: those with a number are columns like any other."""
        asked = [position for position, at in columns.items() if at.tag in self._silent] if self._silent else []
        if not asked:
            return
        found = np.isfinite(values[:, asked]).any(axis=0)
        for position in np.array(asked)[found]:
            tag = columns[int(position)].tag
            self._silent.discard(tag)
            if tag in self._held:
                self._log.take(self._held.pop(tag))

    def settle(self) -> list[str]:
        """When all rows were read: the tags of the columns that hold words alone. What others were refused for, as
        marks that may be decimals, goes to the log."""
        wordy = [tag for tag, held in self._held.items() if held.codes == NO_NUMBER]
        for tag in self._held.keys() - set(wordy):
            self._log.take(self._held[tag])
        self._held = {}
        return wordy
