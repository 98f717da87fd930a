"""A digest that somebody sends once more keeps its new id whoever sends it; what was sent so far keeps the old one."""

import sqlalchemy as sa
from alembic import op

revision = "0023"
down_revision = "0022"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("deliveries", sa.Column("id_suffix", sa.Text()))


def downgrade() -> None:
    op.drop_column("deliveries", "id_suffix")
