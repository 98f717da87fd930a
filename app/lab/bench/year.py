"""A plant with a year of nightly verdicts, made quickly: real verdicts of some loops, copied to all and every night."""

from datetime import UTC, datetime, timedelta

from sqlalchemy import Connection, insert, select

from app.lab.bench.plant import analyse
from app.services.auditing import audits, chunks, warming
from app.services.auditing.audits import LoopFilter
from app.services.backend import Backend
from app.storage.tables import audits as audits_table
from app.storage.tables import loops as loops_table
from app.storage.tables import verdicts

KINDS = 60
FIRST_NIGHT = datetime(2026, 1, 1, 2, 0, tzinfo=UTC)
OWN = ("loop_id", "audit_id", "audited_at")

LOOPS = """
INSERT INTO loops (tag, unit, type, created_at)
SELECT 'XIC' || to_char(n, 'FM00000'), 'AREA' || mod(n, 40), 'flow', now()
FROM generate_series((SELECT count(*) FROM loops), {last}) n
"""
# Filled without indexes and foreign keys, which take most of the time; not logged, because it is thrown away.
BARE = (
    "CREATE TEMP TABLE twin AS SELECT row_number() OVER (ORDER BY loop_id) - 1 AS kind, v.* FROM verdicts v",
    "CREATE UNIQUE INDEX ON twin (kind)",
    "ANALYZE twin",
    "DELETE FROM verdicts",
    "ALTER TABLE verdicts DROP CONSTRAINT fk_verdicts_loop_id",
    "ALTER TABLE verdicts DROP CONSTRAINT fk_verdicts_audit_id",
    "ALTER TABLE verdicts DROP CONSTRAINT pk_verdicts",
    "DROP INDEX ix_verdicts_audit",
    "ALTER TABLE verdicts SET UNLOGGED",
)
VERDICTS = """
INSERT INTO verdicts (loop_id, audit_id, audited_at, {columns})
SELECT l.id, a.id, a.created_at, {copied}
FROM audits a CROSS JOIN loops l JOIN twin t ON t.kind = mod(l.id, (SELECT count(*) FROM twin))
WHERE a.nightly_for IS NOT NULL
"""
INDEXED = (
    "ALTER TABLE verdicts ADD CONSTRAINT pk_verdicts PRIMARY KEY (loop_id, audit_id)",
    "CREATE INDEX ix_verdicts_audit ON verdicts (audit_id)",
    "UPDATE loops SET newest_audit_id = (SELECT max(id) FROM audits)",
    "CREATE TEMP TABLE twin_row AS SELECT t.kind, l.tag, r.*"
    " FROM newest_rows r JOIN twin t ON t.loop_id = r.loop_id JOIN loops l ON l.id = r.loop_id",
    "DELETE FROM newest_rows",
)
ROWS = """
INSERT INTO newest_rows (loop_id, audit_id, form, figures_json, verdict, reliability, likely_cause, table2_reading,
    stiction_probability, health, swing_json, row_json,
    before_audit_id, verdict_before, audited_at, window_end, input_end_ns)
SELECT l.id, l.newest_audit_id, t.form, t.figures_json, t.verdict, t.reliability, t.likely_cause, t.table2_reading,
    t.stiction_probability, t.health, t.swing_json, replace(
    replace(t.row_json, '"' || t.tag || '"', '"' || l.tag || '"'),
    '"audit_id":"' || t.audit_id || '"', '"audit_id":"' || l.newest_audit_id || '"'),
    l.newest_audit_id - 1, t.verdict, a.created_at, t.window_end, t.input_end_ns
FROM loops l JOIN audits a ON a.id = l.newest_audit_id
    JOIN twin_row t ON t.kind = mod(l.id, (SELECT count(*) FROM twin_row))
"""


def fill(backend: Backend, loops: int, nights: int) -> int:
    """Loops up to that number, a run a night, and a verdict of each loop and night: how many verdicts there are.

    The first loops must have samples. Details of verdicts are not made: no route that is measured reads them.
    """
    warming.warm_up()
    _audit_some(backend)
    with backend.database.write() as connection:
        connection.exec_driver_sql("SET LOCAL statement_timeout = 0")
        connection.exec_driver_sql(LOOPS.format(last=loops - 1))
        _add_nights(connection, nights)
        _run(connection, BARE)
        columns = [f'"{column.name}"' for column in verdicts.columns if column.name not in OWN]
        copied = ", ".join(f"t.{name}" for name in columns)
        connection.exec_driver_sql(VERDICTS.format(columns=", ".join(columns), copied=copied))
        _run(connection, INDEXED)
        connection.exec_driver_sql(ROWS)
    analyse(backend)
    with backend.database.read() as connection:
        return connection.exec_driver_sql("SELECT count(*) FROM verdicts").scalar() or 0


def _audit_some(backend: Backend) -> None:
    with backend.database.read() as connection:
        tags = connection.scalars(select(loops_table.c.tag).order_by(loops_table.c.id).limit(KINDS)).all()
    run = audits.start_audit(backend, LoopFilter(tags=tuple(tags)))
    while chunks.audit_chunk(backend, int(run.id), "bench"):
        pass


def _add_nights(connection: Connection, nights: int) -> None:
    done = connection.execute(select(audits_table)).mappings().one()
    days = [FIRST_NIGHT + timedelta(days=day) for day in range(nights)]
    rows = [
        {**done, "id": done["id"] + 1 + n, "created_at": day, "ended_at": day, "nightly_for": f"{day:%Y-%m-%d}"}
        for n, day in enumerate(days)
    ]
    connection.execute(insert(audits_table), rows)
    connection.exec_driver_sql("SELECT setval('audits_id_seq', (SELECT max(id) FROM audits))")


def _run(connection: Connection, statements: tuple[str, ...]) -> None:
    for statement in statements:
        connection.exec_driver_sql(statement)
