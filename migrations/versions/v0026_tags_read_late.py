"""A tag that was read as before is known to have been: an older upload that is read late changes nothing of it."""

import sqlalchemy as sa
from alembic import op

revision = "0026"
down_revision = "0025"
branch_labels = None
depends_on = None

AS_FIRST_READ = sa.text("UPDATE read_tags SET newest_number = receipt_number")


def upgrade() -> None:
    op.add_column("read_tags", sa.Column("newest_number", sa.BigInteger(), server_default="0", nullable=False))
    op.execute(AS_FIRST_READ)


def downgrade() -> None:
    op.drop_column("read_tags", "newest_number")
