"""A run knows who started it; of older ones it is not known."""

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("audits", sa.Column("started_by", sa.Text(), server_default="", nullable=False))


def downgrade() -> None:
    op.drop_column("audits", "started_by")
