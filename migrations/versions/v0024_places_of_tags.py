"""What somebody said of a tag holds for later files, and is known to have changed; nobody has said anything yet."""

import sqlalchemy as sa
from alembic import op

revision = "0024"
down_revision = "0023"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "kept_tags",
        *_tag(),
        sa.Column("tag", sa.Text(), nullable=False),
        *_place(),
        sa.Column("kept_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("kept_by", sa.Text(), server_default="", nullable=False),
        sa.PrimaryKeyConstraint("file", "name", name=op.f("pk_kept_tags")),
    )
    op.create_table(
        "read_tags",
        *_tag(),
        *_place(),
        sa.Column("unit", sa.Text(), server_default="", nullable=False),
        sa.Column("receipt_number", sa.BigInteger(), nullable=False),
        sa.PrimaryKeyConstraint("file", "name", name=op.f("pk_read_tags")),
    )


def downgrade() -> None:
    op.drop_table("read_tags")
    op.drop_table("kept_tags")


def _tag() -> tuple[sa.Column[str], ...]:
    return sa.Column("file", sa.Text(), nullable=False), sa.Column("name", sa.Text(), nullable=False)


def _place() -> tuple[sa.Column[str], ...]:
    return sa.Column("loop", sa.Text(), nullable=False), sa.Column("signal", sa.Text(), nullable=False)
