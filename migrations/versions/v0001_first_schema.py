"""The first schema: uploads, loops, series, audits, verdicts."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None


def upgrade() -> None:
    op.create_table(
        "audits",
        sa.Column("id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("trigger", sa.Text(), nullable=False),
        sa.Column("plant", sa.Text(), nullable=False),
        sa.Column("nightly_for", sa.Text(), nullable=True),
        sa.Column("state", sa.Text(), server_default="planned", nullable=False),
        sa.Column("filter_json", sa.Text(), server_default="{}", nullable=False),
        sa.Column("config_json", sa.Text(), nullable=False),
        sa.Column("config_fingerprint", sa.Text(), nullable=False),
        sa.Column("window_h", sa.Float(), nullable=False),
        sa.Column("window_samples", sa.Integer(), nullable=False),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("ended_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("total", sa.Integer(), nullable=False),
        sa.Column("announced_s", sa.Float(), nullable=True),
        sa.CheckConstraint(
            "state IN ('planned', 'running', 'done', 'partial', 'cancelled')", name=op.f("ck_audits_state")
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_audits")),
        sa.UniqueConstraint("plant", "nightly_for", name=op.f("uq_audits_plant_nightly_for")),
    )
    op.create_index(
        "ix_audits_unfinished",
        "audits",
        ["id"],
        unique=False,
        postgresql_where=sa.text("state IN ('planned', 'running')"),
        sqlite_where=sa.text("state IN ('planned', 'running')"),
    )
    op.create_table(
        "loops",
        sa.Column("id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("tag", sa.Text(), nullable=False),
        sa.Column("unit", sa.Text(), nullable=True),
        sa.Column("type", sa.Text(), nullable=True),
        sa.Column("description", sa.Text(), nullable=True),
        sa.Column("importance", sa.Float(), server_default="1", nullable=False),
        sa.Column("pv_unit", sa.Text(), nullable=True),
        sa.Column("pv_low", sa.Float(), nullable=True),
        sa.Column("pv_high", sa.Float(), nullable=True),
        sa.Column("op_low", sa.Float(), nullable=True),
        sa.Column("op_high", sa.Float(), nullable=True),
        sa.Column("integrating", sa.Boolean(), nullable=True),
        sa.Column("created_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("newest_ns", sa.BigInteger(), nullable=True),
        sa.Column("newest_audit_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=True),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_loops")),
        sa.UniqueConstraint("tag", name=op.f("uq_loops_tag")),
    )
    op.create_table(
        "uploads",
        sa.Column("id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("content_key", sa.Text(), nullable=False),
        sa.Column("fingerprint", sa.Text(), nullable=False),
        sa.Column("filename", sa.Text(), nullable=False),
        sa.Column("content_type", sa.Text(), nullable=True),
        sa.Column("size_bytes", sa.BigInteger(), nullable=False),
        sa.Column("reading_json", sa.Text(), server_default="{}", nullable=False),
        sa.Column("received_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("received_by", sa.Text(), nullable=True),
        sa.Column("state", sa.Text(), server_default="received", nullable=False),
        sa.Column("ended_at", sa.DateTime(timezone=True), nullable=True),
        sa.Column("error_code", sa.Text(), nullable=True),
        sa.Column("error_text", sa.Text(), nullable=True),
        sa.Column("attempts", sa.Integer(), server_default="0", nullable=False),
        sa.Column("owner", sa.Text(), nullable=True),
        sa.Column("lease_until_s", sa.Float(), nullable=True),
        sa.Column("announced_s", sa.Float(), nullable=True),
        sa.Column("summary_json", sa.Text(), nullable=True),
        sa.CheckConstraint("state IN ('received', 'reading', 'done', 'failed')", name=op.f("ck_uploads_state")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_uploads")),
        sa.UniqueConstraint("content_key", name=op.f("uq_uploads_content_key")),
    )
    op.create_index(
        "ix_uploads_unread",
        "uploads",
        ["id"],
        unique=False,
        postgresql_where=sa.text("state IN ('received', 'reading')"),
        sqlite_where=sa.text("state IN ('received', 'reading')"),
    )
    op.create_table(
        "audit_items",
        sa.Column("audit_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("loop_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("state", sa.Text(), server_default="open", nullable=False),
        sa.Column("attempts", sa.Integer(), server_default="0", nullable=False),
        sa.Column("owner", sa.Text(), nullable=True),
        sa.Column("lease_until_s", sa.Float(), nullable=True),
        sa.Column("code", sa.Text(), nullable=True),
        sa.Column("text", sa.Text(), nullable=True),
        sa.CheckConstraint("state IN ('open', 'claimed', 'done', 'failed')", name=op.f("ck_audit_items_state")),
        sa.ForeignKeyConstraint(["audit_id"], ["audits.id"], name=op.f("fk_audit_items_audit_id"), ondelete="CASCADE"),
        sa.ForeignKeyConstraint(["loop_id"], ["loops.id"], name=op.f("fk_audit_items_loop_id"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("audit_id", "loop_id", name=op.f("pk_audit_items")),
    )
    op.create_index(
        "ix_audit_items_claimed",
        "audit_items",
        ["lease_until_s"],
        unique=False,
        postgresql_where=sa.text("state = 'claimed'"),
        sqlite_where=sa.text("state = 'claimed'"),
    )
    op.create_index(
        "ix_audit_items_failed",
        "audit_items",
        ["audit_id", "loop_id"],
        unique=False,
        postgresql_where=sa.text("state = 'failed'"),
        sqlite_where=sa.text("state = 'failed'"),
    )
    op.create_index(
        "ix_audit_items_open",
        "audit_items",
        ["audit_id", "attempts", "loop_id"],
        unique=False,
        postgresql_where=sa.text("state = 'open'"),
        sqlite_where=sa.text("state = 'open'"),
    )
    op.create_table(
        "rejects",
        sa.Column("upload_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("line", sa.BigInteger(), nullable=True),
        sa.Column("code", sa.Text(), nullable=False),
        sa.Column("text", sa.Text(), nullable=False),
        sa.Column("tag", sa.Text(), server_default="", nullable=False),
        sa.ForeignKeyConstraint(["upload_id"], ["uploads.id"], name=op.f("fk_rejects_upload_id"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("upload_id", "number", name=op.f("pk_rejects")),
    )
    op.create_table(
        "series",
        sa.Column("id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("loop_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("start_ns", sa.BigInteger(), nullable=False),
        sa.Column("end_ns", sa.BigInteger(), nullable=False),
        sa.Column("samples", sa.Integer(), nullable=False),
        sa.Column("fingerprint", sa.Text(), nullable=False),
        sa.Column("upload_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=True),
        sa.Column("packed", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(["loop_id"], ["loops.id"], name=op.f("fk_series_loop_id"), ondelete="CASCADE"),
        sa.ForeignKeyConstraint(["upload_id"], ["uploads.id"], name=op.f("fk_series_upload_id"), ondelete="SET NULL"),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_series")),
        sa.UniqueConstraint("loop_id", "fingerprint", name=op.f("uq_series_loop_id_fingerprint")),
    )
    op.create_index("ix_series_loop_end", "series", ["loop_id", "end_ns"], unique=False)
    op.create_table(
        "upload_loops",
        sa.Column("upload_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("loop_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.ForeignKeyConstraint(["loop_id"], ["loops.id"], name=op.f("fk_upload_loops_loop_id"), ondelete="CASCADE"),
        sa.ForeignKeyConstraint(
            ["upload_id"], ["uploads.id"], name=op.f("fk_upload_loops_upload_id"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("upload_id", "loop_id", name=op.f("pk_upload_loops")),
    )
    op.create_table(
        "verdict_details",
        sa.Column("loop_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("audit_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("packed", sa.LargeBinary(), nullable=False),
        sa.ForeignKeyConstraint(
            ["audit_id"], ["audits.id"], name=op.f("fk_verdict_details_audit_id"), ondelete="CASCADE"
        ),
        sa.ForeignKeyConstraint(["loop_id"], ["loops.id"], name=op.f("fk_verdict_details_loop_id"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("loop_id", "audit_id", name=op.f("pk_verdict_details")),
    )
    op.create_table(
        "verdicts",
        sa.Column("loop_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("audit_id", sa.BigInteger().with_variant(sa.Integer(), "sqlite"), nullable=False),
        sa.Column("audited_at", sa.DateTime(timezone=True), nullable=False),
        sa.Column("window_start", sa.DateTime(timezone=True), nullable=True),
        sa.Column("window_end", sa.DateTime(timezone=True), nullable=True),
        sa.Column("input_start_ns", sa.BigInteger(), nullable=True),
        sa.Column("input_end_ns", sa.BigInteger(), nullable=True),
        sa.Column("samples", sa.Integer(), nullable=False),
        sa.Column("sampling_interval_s", sa.Float(), nullable=True),
        sa.Column("verdict", sa.Text(), nullable=False),
        sa.Column("stiction_probability", sa.Float(), nullable=True),
        sa.Column("reliability", sa.Text(), nullable=False),
        sa.Column("yper_pct", sa.Float(), nullable=True),
        sa.Column("yper_raw_pct", sa.Float(), nullable=True),
        sa.Column("table2_reading", sa.Text(), nullable=True),
        sa.Column("stiction_band_pct_of_op_range", sa.Float(), nullable=True),
        sa.Column("likely_cause", sa.Text(), nullable=True),
        sa.Column("engine_version", sa.Text(), nullable=False),
        sa.Column("elapsed_s", sa.Float(), nullable=False),
        sa.Column("oscillation_period_s", sa.Float(), nullable=True),
        sa.Column("oscillation_regularity", sa.Float(), nullable=True),
        sa.Column("filled_share", sa.Float(), nullable=True),
        sa.Column("input_fingerprint", sa.Text(), nullable=False),
        sa.Column("config_fingerprint", sa.Text(), nullable=False),
        sa.Column("reasons", sa.Text(), nullable=False),
        sa.Column("reasons_text", sa.Text(), nullable=False),
        sa.Column("hammerstein_d", sa.Float(), nullable=True),
        sa.Column("hammerstein_S", sa.Float(), nullable=True),
        sa.Column("hammerstein_J", sa.Float(), nullable=True),
        sa.Column("hammerstein_na", sa.Integer(), nullable=True),
        sa.Column("hammerstein_nb", sa.Integer(), nullable=True),
        sa.Column("hammerstein_nc", sa.Integer(), nullable=True),
        sa.Column("hammerstein_rmse", sa.Float(), nullable=True),
        sa.Column("hammerstein_rmse_without_stiction", sa.Float(), nullable=True),
        sa.Column("hammerstein_search_space", sa.Text(), nullable=True),
        sa.Column("hammerstein_widenings", sa.Integer(), nullable=True),
        sa.Column("extra_json", sa.Text(), server_default="{}", nullable=False),
        sa.ForeignKeyConstraint(["audit_id"], ["audits.id"], name=op.f("fk_verdicts_audit_id"), ondelete="CASCADE"),
        sa.ForeignKeyConstraint(["loop_id"], ["loops.id"], name=op.f("fk_verdicts_loop_id"), ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("loop_id", "audit_id", name=op.f("pk_verdicts")),
    )
    op.create_index("ix_verdicts_audit", "verdicts", ["audit_id"], unique=False)
    if op.get_bind().dialect.name == "postgresql":
        # Both are compressed already.
        op.execute("ALTER TABLE series ALTER COLUMN packed SET STORAGE EXTERNAL")
        op.execute("ALTER TABLE verdict_details ALTER COLUMN packed SET STORAGE EXTERNAL")


def downgrade() -> None:

    op.drop_index("ix_verdicts_audit", table_name="verdicts")
    op.drop_table("verdicts")
    op.drop_table("verdict_details")
    op.drop_table("upload_loops")
    op.drop_index("ix_series_loop_end", table_name="series")
    op.drop_table("series")
    op.drop_table("rejects")
    op.drop_index(
        "ix_audit_items_open",
        table_name="audit_items",
        postgresql_where=sa.text("state = 'open'"),
        sqlite_where=sa.text("state = 'open'"),
    )
    op.drop_index(
        "ix_audit_items_failed",
        table_name="audit_items",
        postgresql_where=sa.text("state = 'failed'"),
        sqlite_where=sa.text("state = 'failed'"),
    )
    op.drop_index(
        "ix_audit_items_claimed",
        table_name="audit_items",
        postgresql_where=sa.text("state = 'claimed'"),
        sqlite_where=sa.text("state = 'claimed'"),
    )
    op.drop_table("audit_items")
    op.drop_index(
        "ix_uploads_unread",
        table_name="uploads",
        postgresql_where=sa.text("state IN ('received', 'reading')"),
        sqlite_where=sa.text("state IN ('received', 'reading')"),
    )
    op.drop_table("uploads")
    op.drop_table("loops")
    op.drop_index(
        "ix_audits_unfinished",
        table_name="audits",
        postgresql_where=sa.text("state IN ('planned', 'running')"),
        sqlite_where=sa.text("state IN ('planned', 'running')"),
    )
    op.drop_table("audits")
