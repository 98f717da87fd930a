"""An upload that found the disk full knows for how long it waits before it is tried again."""

import sqlalchemy as sa
from alembic import op

revision = "0018"
down_revision = "0017"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("uploads", sa.Column("pause_s", sa.Float()))


def downgrade() -> None:
    op.drop_column("uploads", "pause_s")
