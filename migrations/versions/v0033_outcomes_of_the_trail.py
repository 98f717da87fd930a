"""The trail holds no outcome but those that are told.

No release has written another one. Should a row have one all the same, it is kept beside what else is known of it, and
the outcome is not known.
"""

import json

import sqlalchemy as sa
from alembic import op

revision = "0033"
down_revision = "0032"
branch_labels = None
depends_on = None

KNOWN = ("done", "refused", "failed", "not_known")
CHECK = "outcome IN ('done', 'refused', 'failed', 'not_known')"
TRAIL = sa.table("trail", sa.column("id"), sa.column("outcome"), sa.column("detail_json"))


def upgrade() -> None:
    _set_others_apart(op.get_bind())
    with op.batch_alter_table("trail") as table:
        table.create_check_constraint(op.f("ck_trail_outcome"), CHECK)


def downgrade() -> None:
    with op.batch_alter_table("trail") as table:
        table.drop_constraint(op.f("ck_trail_outcome"), type_="check")


def _set_others_apart(connection: sa.Connection) -> None:
    others = connection.execute(sa.select(TRAIL).where(TRAIL.c.outcome.not_in(KNOWN))).all()
    for row in others:
        kept = json.dumps({"outcome": row.outcome, "detail": row.detail_json}, sort_keys=True)
        changed = sa.update(TRAIL).where(TRAIL.c.id == row.id)
        connection.execute(changed.values(outcome="not_known", detail_json=kept))
