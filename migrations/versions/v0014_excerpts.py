"""Which loop moves another one's set point, and what is kept of OP and SP to find it by."""

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"
branch_labels = None
depends_on = None

OF_VERDICTS = ("moves_set_point_of", "set_point_moved_by")


def upgrade() -> None:
    op.add_column("newest_rows", sa.Column("excerpts_json", sa.Text()))
    for name in OF_VERDICTS:
        op.add_column("verdicts", sa.Column(name, sa.Text()))


def downgrade() -> None:
    for name in reversed(OF_VERDICTS):
        op.drop_column("verdicts", name)
    op.drop_column("newest_rows", "excerpts_json")
