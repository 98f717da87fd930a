"""A key that was rotated names the one that follows it: it is on its way out, and is not rotated again."""

import sqlalchemy as sa
from alembic import op

revision = "0031"
down_revision = "0030"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("keys", sa.Column("followed_by", sa.Text(), nullable=True))


def downgrade() -> None:
    op.drop_column("keys", "followed_by")
