"""Old uploads are dropped: their stretches are found by an index, and what was counted of them stays counted."""

import sqlalchemy as sa
from alembic import op

revision = "0017"
down_revision = "0016"
branch_labels = None
depends_on = None

THERE = sa.text("upload_id IS NOT NULL")


def upgrade() -> None:
    op.create_index("ix_series_upload", "series", ["upload_id"], sqlite_where=THERE, postgresql_where=THERE)
    op.create_table(
        "tallies",
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("dropped", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("name", name=op.f("pk_tallies")),
    )


def downgrade() -> None:
    op.drop_table("tallies")
    op.drop_index("ix_series_upload", table_name="series")
