"""Work that a lost worker held: given out again once its lease has ended, or given up after too many attempts."""

from collections.abc import Mapping
from dataclasses import dataclass

from sqlalchemy import ColumnElement, Connection, Table, update

from app.storage.types import run_out


@dataclass(frozen=True)
class Reopened:
    """What was taken back from lost workers: given out again, or given up."""

    reopened: int
    failed: int


def take_back(
    connection: Connection,
    work: Table,
    claimed: ColumnElement[bool],
    max_attempts: int,
    lease_s: float,
    failed: Mapping[str, object],
    opened: Mapping[str, object] | None = None,
) -> Reopened:
    """Rows of `work` whose lease has ended: those tried `max_attempts` times become `failed`, the others open again.

    claimed: of a row, in the words of the index that finds it. A lease that ends between the two statements is left to
    the next call, where it was the row's last.
    """
    expired = update(work).where(claimed, run_out(work.c.lease_until_s, lease_s))
    nobody = {"owner": None, "lease_until_s": None}
    given_up = connection.execute(
        expired.where(work.c.attempts >= max_attempts).values(state="failed", **nobody, **failed)
    )
    given_out = connection.execute(
        expired.where(work.c.attempts < max_attempts).values(state="open", **nobody, **(opened or {}))
    )
    return Reopened(given_out.rowcount, given_up.rowcount)
