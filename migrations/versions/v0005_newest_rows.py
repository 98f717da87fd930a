"""The newest row of each loop, ready to be sent; packed columns are not packed a second time."""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None

PACKED = (("series", "packed"), ("verdict_details", "packed"))


def upgrade() -> None:
    op.create_table(
        "newest_rows",
        sa.Column("loop_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("audit_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("form", sa.Text(), nullable=False),
        sa.Column("row_json", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["loop_id"], ["loops.id"], name=op.f("fk_newest_rows_loop_id"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("loop_id", name=op.f("pk_newest_rows")),
    )
    _store("EXTERNAL")


def downgrade() -> None:
    _store("EXTENDED")
    op.drop_table("newest_rows")


def _store(how: str) -> None:
    """PostgreSQL would try to compress what zstd has compressed."""
    if op.get_bind().dialect.name == "postgresql":
        for table, column in PACKED:
            op.execute(f"ALTER TABLE {table} ALTER COLUMN {column} SET STORAGE {how}")
