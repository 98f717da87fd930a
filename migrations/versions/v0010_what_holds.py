"""Stretches name their last set point and mode: what holds is found however long ago it changed."""

from typing import Any

import numpy as np
import sqlalchemy as sa
from alembic import op

from app.storage.samples import DAMAGED, Samples, unpack  # which knows every format that was ever stored

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None

COLUMNS = (("sp_ns", sa.BigInteger()), ("sp_last", sa.Float()), ("mode_ns", sa.BigInteger()), ("mode_last", sa.Float()))
BATCH = 500
NEXT = sa.text("SELECT id, packed FROM series WHERE id > :after ORDER BY id LIMIT :most")
TELL = sa.text(
    "UPDATE series SET sp_ns = :sp_ns, sp_last = :sp_last, mode_ns = :mode_ns, mode_last = :mode_last WHERE id = :id"
)


def upgrade() -> None:
    for name, kind in COLUMNS:
        op.add_column("series", sa.Column(name, kind, nullable=True))
    _look_back()
    for begin in ("sp", "mode"):
        there = sa.text(f"{begin}_ns IS NOT NULL")
        op.create_index(
            f"ix_series_{begin}", "series", ["loop_id", f"{begin}_ns"], sqlite_where=there, postgresql_where=there
        )


def downgrade() -> None:
    for begin in ("mode", "sp"):
        op.drop_index(f"ix_series_{begin}", table_name="series")
    for name, _ in reversed(COLUMNS):
        op.drop_column("series", name)


def _look_back() -> None:
    """Of the stretches that are there; what cannot be unpacked is left, it cannot be audited either."""
    connection, after = op.get_bind(), 0
    while rows := connection.execute(NEXT, {"after": after, "most": BATCH}).all():
        after = rows[-1].id
        told = []
        for row in rows:
            try:
                told.append({"id": row.id, **_last_known(unpack(bytes(row.packed)))})
            except DAMAGED:
                continue
        told = [one for one in told if one["sp_ns"] is not None or one["mode_ns"] is not None]
        if told:
            connection.execute(TELL, told)


def _last_known(samples: Samples) -> dict[str, Any]:
    columns: dict[str, Any] = {}
    for name, begin in (("sp", "sp"), ("automatic", "mode")):
        values = samples.signals.get(name, np.array([]))
        known = np.flatnonzero(np.isfinite(values))
        columns[f"{begin}_ns"] = int(samples.time_ns[known[-1]]) if len(known) else None
        columns[f"{begin}_last"] = float(values[known[-1]]) if len(known) else None
    return columns
