"""An upload knows when its content came again: it is kept from then on as long as a new one."""

import sqlalchemy as sa
from alembic import op

revision = "0019"
down_revision = "0018"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("uploads", sa.Column("sent_again_at", sa.DateTime(timezone=True)))


def downgrade() -> None:
    op.drop_column("uploads", "sent_again_at")
