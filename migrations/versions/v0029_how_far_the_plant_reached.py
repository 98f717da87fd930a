"""A run knows how far the records of its plant reached when it was planned: so it is decided for good whether what it
says of a loop is of an old record. And an explanation that finds no room on the disk waits for it.

Of runs of before it is what they and those before them were given, as far as that was not ahead of their clock.
"""

import sqlalchemy as sa
from alembic import op

revision = "0029"
down_revision = "0028"
branch_labels = None
depends_on = None

HOUR_S, NS_PER_S = 3600, 1_000_000_000
DATED_NS = 365 * 86_400 * NS_PER_S
BEGUN_S = {
    "postgresql": "extract(epoch FROM a.created_at)",
    "sqlite": "(julianday(a.created_at) - 2440587.5) * 86400.0",
}
REACHED = """
WITH given AS (
    SELECT v.audit_id, max(v.input_end_ns) AS end_ns FROM verdicts v JOIN audits a ON a.id = v.audit_id
    WHERE v.input_end_ns BETWEEN {dated} AND CAST(({begun_s} + {hour_s}) AS BIGINT) * {ns} GROUP BY v.audit_id
), reached AS (
    SELECT a.id, max(given.end_ns) OVER (ORDER BY a.id) AS end_ns FROM audits a LEFT JOIN given ON given.audit_id = a.id
)
UPDATE audits SET newest_ns = reached.end_ns FROM reached WHERE reached.id = audits.id
"""


def upgrade() -> None:
    op.add_column("audits", sa.Column("newest_ns", sa.BigInteger()))
    op.add_column("explanations", sa.Column("pause_s", sa.Float()))
    op.add_column("explanations", sa.Column("waits_since", sa.DateTime(timezone=True)))
    begun_s = BEGUN_S[op.get_bind().dialect.name]
    op.execute(REACHED.format(dated=DATED_NS, begun_s=begun_s, hour_s=HOUR_S, ns=NS_PER_S))


def downgrade() -> None:
    op.drop_column("explanations", "waits_since")
    op.drop_column("explanations", "pause_s")
    op.drop_column("audits", "newest_ns")
