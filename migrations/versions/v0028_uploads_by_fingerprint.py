"""Uploads are found by their bytes: each that comes asks for the others of the same bytes, in its transaction."""

from alembic import op

revision = "0028"
down_revision = "0027"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_index("ix_uploads_fingerprint", "uploads", ["fingerprint"])


def downgrade() -> None:
    op.drop_index("ix_uploads_fingerprint", table_name="uploads")
