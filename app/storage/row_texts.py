"""The rows of the reliability table as they are sent, kept in memory by the verdict that they belong to."""

from collections.abc import Mapping, Sequence

from sqlalchemy import Connection

from app.storage.verdicts import SentRow, Settled, texts

MOST_KEPT = 20_000  # the largest answer once: 56 MB

Stamp = tuple[int, Settled, str]


class RowTexts:
    """What one process has read of the newest rows: while a night runs, only the rows of new verdicts are read again.

    A row is written with its verdict, may be reworded when its run ends, and says the same as long as its loop's newest
    verdict is of the same run: of the same number, begun and ended at the same time. Safe to use from several threads:
    every entry is set whole.
    """

    def __init__(self) -> None:
        self._kept: dict[int, tuple[Stamp, bytes]] = {}

    def of(
        self, connection: Connection, rows: Sequence[SentRow], settled: Mapping[int, Settled], form: str
    ) -> dict[int, bytes]:
        """The stored JSON of these rows by `loop_id`. One is left out where it is of another form, or where a newer
        verdict has followed it.

        settled: when the rows' runs were begun and ended.
        """
        stamps: dict[int, Stamp] = {number: (number, times, form) for number, times in settled.items()}
        found: dict[int, bytes] = {}
        missing: list[SentRow] = []
        for row in rows:
            kept = self._kept.get(row.loop_id)
            if kept is not None and kept[0] == stamps.get(row.audit_id):
                found[row.loop_id] = kept[1]
            else:
                missing.append(row)
        if missing:
            read = texts(connection, [row.loop_id for row in missing], form)
            fresh = {row.loop_id: text for row in missing if (text := read.get(row.key)) is not None}
            settled_rows = [row for row in missing if row.loop_id in fresh and row.audit_id in stamps]
            self._keep({row.loop_id: (stamps[row.audit_id], fresh[row.loop_id]) for row in settled_rows})
            found |= fresh
        return found

    def __len__(self) -> int:
        return len(self._kept)

    def _keep(self, fresh: dict[int, tuple[Stamp, bytes]]) -> None:
        if len(self._kept.keys() | fresh.keys()) > MOST_KEPT:
            self._kept.clear()
        if len(fresh) <= MOST_KEPT:
            self._kept.update(fresh)
