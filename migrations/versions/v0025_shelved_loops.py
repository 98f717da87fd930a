"""A note can shelve its loop until a time; nothing is shelved yet."""

import sqlalchemy as sa
from alembic import op

revision = "0025"
down_revision = "0024"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("notes", sa.Column("shelved_until", sa.DateTime(timezone=True), nullable=True))
    op.add_column("notes", sa.Column("shelved_as", sa.Text(), nullable=True))


def downgrade() -> None:
    op.drop_column("notes", "shelved_as")
    op.drop_column("notes", "shelved_until")
