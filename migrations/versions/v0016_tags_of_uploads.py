"""The tags of an upload get a column of their own: a list of uploads does not read them, megabytes each."""

import json
from collections.abc import Iterator
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0016"
down_revision = "0015"
branch_labels = None
depends_on = None

BATCH = 10  # of megabytes each
SIGNALS = ("pv", "op", "sp", "mode")
UPLOADS = sa.table("uploads", sa.column("id"), sa.column("summary_json"), sa.column("tags_json"))
SUMMARY, TAGS = UPLOADS.c.summary_json, UPLOADS.c.tags_json


def upgrade() -> None:
    op.add_column("uploads", sa.Column("tags_json", sa.Text()))
    for upload_id, told in _rows(SUMMARY):
        summary = json.loads(told)
        if isinstance(summary.get("tags"), list):
            tags = summary.pop("tags")
            summary.setdefault("tags_found", sum(map(_tags_of, tags)))
            _tell(upload_id, summary_json=json.dumps(summary), tags_json=json.dumps(tags))


def downgrade() -> None:
    for upload_id, told, summary in _rows(TAGS, SUMMARY):
        tags = json.loads(told)
        if isinstance(tags, list):
            _tell(upload_id, summary_json=json.dumps({**json.loads(summary), "tags": tags}))
    op.drop_column("uploads", "tags_json")


def _rows(*columns: sa.ColumnClause[Any]) -> Iterator[Any]:
    """Of the uploads that have the first of the columns, a few in memory at a time."""
    after = 0
    while rows := op.get_bind().execute(_next(after, *columns)).all():
        after = rows[-1].id
        yield from rows


def _next(after: int, *columns: sa.ColumnClause[Any]) -> sa.Select[Any]:
    there = sa.select(UPLOADS.c.id, *columns).where(columns[0].is_not(None), UPLOADS.c.id > after)
    return there.order_by(UPLOADS.c.id).limit(BATCH)


def _tell(upload_id: int, **values: str) -> None:
    op.get_bind().execute(sa.update(UPLOADS).where(UPLOADS.c.id == upload_id).values(values))


def _tags_of(loop: dict[str, Any]) -> int:
    """Uploads that were read long ago do not say how many tags they have."""
    return sum(loop[signal] is not None for signal in SIGNALS) + len(loop["others"])
