"""A repair that was written down in error can be withdrawn; the note stays, with who withdrew it and when."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("notes", sa.Column("withdrawn_at", sa.DateTime(timezone=True), nullable=True))
    op.add_column("notes", sa.Column("withdrawn_by", sa.Text(), server_default="", nullable=False))


def downgrade() -> None:
    op.drop_column("notes", "withdrawn_by")
    op.drop_column("notes", "withdrawn_at")
