"""What is kept of OP and SP, to find which loop moves another one's set point."""

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.add_column("newest_rows", sa.Column("excerpts_json", sa.Text()))


def downgrade() -> None:
    op.drop_column("newest_rows", "excerpts_json")
