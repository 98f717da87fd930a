"""The newest rows know the verdict before: what changed since last night is asked of one small table."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None

BEFORE = """
UPDATE newest_rows SET (before_audit_id, verdict_before) = (SELECT v.audit_id, v.verdict FROM verdicts v
    WHERE v.loop_id = newest_rows.loop_id AND v.audit_id < newest_rows.audit_id ORDER BY v.audit_id DESC LIMIT 1)
"""
BOARD = (
    *("loop_id", "audit_id", "verdict", "reliability", "likely_cause", "stiction_probability", "health"),
    *("verdict_before", "before_audit_id"),
)


def upgrade() -> None:
    with op.batch_alter_table("newest_rows") as table:
        table.add_column(sa.Column("before_audit_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite")))
        table.add_column(sa.Column("verdict_before", sa.Text()))
    op.execute(BEFORE)
    # What the pages ask of all loops is read from here: 2 MB, not the hundred of rows with their texts.
    op.create_index("ix_newest_rows_board", "newest_rows", list(BOARD))


def downgrade() -> None:
    op.drop_index("ix_newest_rows_board", table_name="newest_rows")
    with op.batch_alter_table("newest_rows") as table:
        table.drop_column("verdict_before")
        table.drop_column("before_audit_id")
