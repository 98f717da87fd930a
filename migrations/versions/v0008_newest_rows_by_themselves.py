"""The newest rows carry what is filtered and sorted by most, and the key figures: no verdict is looked up for them."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None

KEPT = ("verdict", "reliability", "likely_cause", "table2_reading")
MEASURED = ("stiction_probability", "health")
MISSING = """
INSERT INTO newest_rows (loop_id, audit_id, form, row_json)
SELECT v.loop_id, v.audit_id, '', '' FROM loops l JOIN verdicts v ON v.loop_id = l.id AND v.audit_id = l.newest_audit_id
WHERE NOT EXISTS (SELECT 1 FROM newest_rows n WHERE n.loop_id = l.id)
"""
COPY = """
UPDATE newest_rows SET {name} = (SELECT v.{name} FROM verdicts v
    WHERE v.loop_id = newest_rows.loop_id AND v.audit_id = newest_rows.audit_id)
"""


def upgrade() -> None:
    op.execute("DELETE FROM newest_rows WHERE audit_id NOT IN (SELECT id FROM audits)")
    with op.batch_alter_table("newest_rows") as table:
        table.add_column(sa.Column("figures_json", sa.Text(), server_default="{}", nullable=False))
        for name in KEPT:
            table.add_column(sa.Column(name, sa.Text(), nullable=True))
        for name in MEASURED:
            table.add_column(sa.Column(name, sa.Float(), nullable=True))
        table.create_foreign_key(op.f("fk_newest_rows_audit_id"), "audits", ["audit_id"], ["id"], ondelete="CASCADE")
    if op.get_bind().dialect.name == "postgresql":
        # All rows are read at once: inside of their table, as they are, that is one pass.
        op.execute("ALTER TABLE newest_rows ALTER COLUMN row_json SET STORAGE EXTERNAL")
        op.execute("ALTER TABLE newest_rows SET (toast_tuple_target = 8160)")
    op.execute(MISSING)
    for name in (*KEPT, *MEASURED):
        op.execute(COPY.format(name=name))


def downgrade() -> None:
    if op.get_bind().dialect.name == "postgresql":
        op.execute("ALTER TABLE newest_rows RESET (toast_tuple_target)")
        op.execute("ALTER TABLE newest_rows ALTER COLUMN row_json SET STORAGE EXTENDED")
    with op.batch_alter_table("newest_rows") as table:
        table.drop_constraint(op.f("fk_newest_rows_audit_id"), type_="foreignkey")
        for name in (*KEPT, *MEASURED, "figures_json"):
            table.drop_column(name)
