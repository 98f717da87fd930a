"""The newest rows know of which record their verdicts are: how many are set apart is asked of one small table."""

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0034"
down_revision = "0033"
branch_labels = None
depends_on = None

COLUMNS: dict[str, sa.types.TypeEngine[Any]] = {
    "audited_at": sa.DateTime(timezone=True),
    "window_end": sa.DateTime(timezone=True),
    "input_end_ns": sa.BigInteger(),
}
COPY = """
UPDATE newest_rows SET (audited_at, window_end, input_end_ns) = (SELECT v.audited_at, v.window_end, v.input_end_ns
    FROM verdicts v WHERE v.loop_id = newest_rows.loop_id AND v.audit_id = newest_rows.audit_id)
"""
BOARD = (
    *("loop_id", "audit_id", "verdict", "reliability", "likely_cause", "stiction_probability", "health"),
    *("verdict_before", "before_audit_id"),
)


def upgrade() -> None:
    op.drop_index("ix_newest_rows_board", table_name="newest_rows")
    for name, kind in COLUMNS.items():
        op.add_column("newest_rows", sa.Column(name, kind))
    op.execute(COPY)
    op.create_index("ix_newest_rows_board", "newest_rows", [*BOARD, *COLUMNS])


def downgrade() -> None:
    op.drop_index("ix_newest_rows_board", table_name="newest_rows")
    with op.batch_alter_table("newest_rows") as table:
        for name in reversed(COLUMNS):
            table.drop_column(name)
    op.create_index("ix_newest_rows_board", "newest_rows", list(BOARD))
