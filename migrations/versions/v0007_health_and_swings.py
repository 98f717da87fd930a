"""A health number to sort by, and what is kept of an oscillation to compare loops by."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None

OF_VERDICTS = (("oscillation_strength", sa.Float()), ("health", sa.Float()), ("health_parts", sa.Text()))


def upgrade() -> None:
    for name, kind in OF_VERDICTS:
        op.add_column("verdicts", sa.Column(name, kind, nullable=True))
    op.add_column("newest_rows", sa.Column("swing_json", sa.Text(), nullable=True))


def downgrade() -> None:
    op.drop_column("newest_rows", "swing_json")
    for name, _ in reversed(OF_VERDICTS):
        op.drop_column("verdicts", name)
