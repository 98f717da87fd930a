"""A loop may name who looks after it; none does yet."""

import sqlalchemy as sa
from alembic import op

revision = "0030"
down_revision = "0029"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("loops", sa.Column("owner", sa.Text(), nullable=True))


def downgrade() -> None:
    op.drop_column("loops", "owner")
