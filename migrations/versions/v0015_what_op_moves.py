"""What a loop's OP moves, where somebody states it: a valve of its own, or the set point of another loop."""

import sqlalchemy as sa
from alembic import op

revision = "0015"
down_revision = "0014"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("loops", sa.Column("moves_valve", sa.Boolean()))


def downgrade() -> None:
    op.drop_column("loops", "moves_valve")
