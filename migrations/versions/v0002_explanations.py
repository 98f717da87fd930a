"""Recordings against simulations."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "explanations",
        sa.Column("id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("loop_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("audit_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=True),
        sa.Column("state", sa.Text(), server_default="open", nullable=False),
        sa.Column("asked_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("asked_by", sa.Text(), nullable=True),
        sa.Column("ended_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("attempts", sa.Integer(), server_default="0", nullable=False),
        sa.Column("owner", sa.Text(), nullable=True),
        sa.Column("lease_until_s", sa.Float(), nullable=True),
        sa.Column("announced_s", sa.Float(), nullable=True),
        sa.Column("window_start_ns", sa.BigInteger(), nullable=True),
        sa.Column("window_end_ns", sa.BigInteger(), nullable=True),
        sa.Column("simulation_packed", sa.LargeBinary(), nullable=True),
        sa.Column("verdict", sa.Text(), nullable=True),
        sa.Column("effects", sa.Text(), server_default="", nullable=False),
        sa.Column("error_code", sa.Text(), nullable=True),
        sa.Column("error_text", sa.Text(), nullable=True),
        sa.Column("packed", sa.LargeBinary(), nullable=True),
        sa.CheckConstraint("state IN ('open', 'claimed', 'done', 'failed')", name=op.f("ck_explanations_state")),
        sa.ForeignKeyConstraint(
            ["audit_id"], ["audits.id"], name=op.f("fk_explanations_audit_id"), ondelete="SET NULL"
        ),
        sa.ForeignKeyConstraint(["loop_id"], ["loops.id"], name=op.f("fk_explanations_loop_id"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_explanations")),
        sa.UniqueConstraint("loop_id", "audit_id", name=op.f("uq_explanations_loop_id_audit_id")),
    )
    op.create_index("ix_explanations_loop", "explanations", ["loop_id", "id"], unique=False)
    op.create_index(
        "ix_explanations_unfinished",
        "explanations",
        ["id"],
        unique=False,
        postgresql_where=sa.text("state IN ('open', 'claimed')"),
        sqlite_where=sa.text("state IN ('open', 'claimed')"),
    )
    if op.get_bind().dialect.name == "postgresql":
        # Compressed already.
        op.execute("ALTER TABLE explanations ALTER COLUMN packed SET STORAGE EXTERNAL")


def downgrade() -> None:
    op.drop_index(
        "ix_explanations_unfinished",
        table_name="explanations",
        postgresql_where=sa.text("state IN ('open', 'claimed')"),
        sqlite_where=sa.text("state IN ('open', 'claimed')"),
    )
    op.drop_index("ix_explanations_loop", table_name="explanations")
    op.drop_table("explanations")
