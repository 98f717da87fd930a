"""A loop may continue another one under a new tag, and its notes with it; none does yet."""

import sqlalchemy as sa
from alembic import op

revision = "0027"
down_revision = "0026"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("loops", sa.Column("continues", sa.Text(), nullable=True))
    op.add_column("notes", sa.Column("written_of", sa.Text(), nullable=True))


def downgrade() -> None:
    op.drop_column("notes", "written_of")
    op.drop_column("loops", "continues")
