"""Work that a lost worker held: given out again once its lease has ended, or given up after too many attempts."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

from sqlalchemy import Column, ColumnElement, Connection, Table, literal, update

from app.storage.types import run_out


@dataclass(frozen=True)
class Reopened:
    """What was taken back from lost workers: given out again, or given up. lost: how many workers each run has lost by
    it, where it is of runs."""

    reopened: int
    failed: int
    lost: Mapping[int, int] = field(default_factory=dict)


def take_back(
    connection: Connection,
    work: Table,
    claimed: ColumnElement[bool],
    max_attempts: int,
    lease_s: float,
    failed: Mapping[str, object],
    opened: Mapping[str, object] | None = None,
    run: Column[int] | None = None,
) -> Reopened:
    """Rows of `work` whose lease has ended: those tried `max_attempts` times become `failed`, the others open again.
    Each keeps its owner until it has another: by owners the lost workers are counted.

    claimed: of a row, in the words of the index that finds it. A lease that ends between the two statements is left to
    the next call, where it was the row's last. run: the column that tells whose the row is.
    """
    owned = (literal(0) if run is None else run, work.c.owner)
    expired = update(work).where(claimed, run_out(work.c.lease_until_s, lease_s)).returning(*owned)
    given_up = connection.execute(
        expired.where(work.c.attempts >= max_attempts).values(state="failed", lease_until_s=None, **failed)
    ).all()
    given_out = connection.execute(
        expired.where(work.c.attempts < max_attempts).values(state="open", lease_until_s=None, **(opened or {}))
    ).all()
    lost = Counter(audit_id for audit_id, _ in {*map(tuple, given_up), *map(tuple, given_out)})
    return Reopened(len(given_out), len(given_up), {} if run is None else lost)
