"""Details of verdicts by their run, so that those of old runs are found without reading all."""

from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_index("ix_verdict_details_audit", "verdict_details", ["audit_id"], unique=False)


def downgrade() -> None:
    op.drop_index("ix_verdict_details_audit", table_name="verdict_details")
