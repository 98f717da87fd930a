"""Uploads are numbered as they are received, and their stretches with them: the later one holds.

What is stored already keeps the order in which it was read, before all that comes.
"""

import sqlalchemy as sa
from alembic import op

revision = "0020"
down_revision = "0019"
branch_labels = None
depends_on = None

UNREAD = sa.text("state IN ('received', 'reading')")
FIRST = sa.text("INSERT INTO numbers (name, last) SELECT 'uploads', max(id) FROM uploads HAVING max(id) IS NOT NULL")
WAITING = sa.text("UPDATE uploads SET receipt_number = id WHERE state IN ('received', 'reading')")


def upgrade() -> None:
    for table in ("uploads", "series"):
        op.add_column(table, sa.Column("receipt_number", sa.BigInteger(), nullable=False, server_default="0"))
    op.create_table(
        "numbers",
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("last", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("name", name=op.f("pk_numbers")),
    )
    op.execute(FIRST)
    op.execute(WAITING)
    _index_unread("receipt_number")


def downgrade() -> None:
    _index_unread("id")
    op.drop_table("numbers")
    for table in ("series", "uploads"):
        op.drop_column(table, "receipt_number")


def _index_unread(column: str) -> None:
    op.drop_index("ix_uploads_unread", table_name="uploads")
    op.create_index("ix_uploads_unread", "uploads", [column], sqlite_where=UNREAD, postgresql_where=UNREAD)
