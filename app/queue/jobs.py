"""What can be asked of a worker. Each job has a queue of its own; `turns` says in which order they are looked into."""

import hashlib

from sqlalchemy import make_url

from app.settings import Settings
from app.sqlite_files import file_of

READ_UPLOAD = "loopaudit.read_upload"
AUDIT_CHUNK = "loopaudit.audit_chunk"
EXPLAIN = "loopaudit.explain"
DELIVER = "loopaudit.deliver"
SWEEP = "loopaudit.sweep"

MOST_WAITING = 2000
"""More doorbells of a queue than this ring for nobody. Without a worker, or behind hours of work, which is announced
again and again, they must fill no disk and no memory of Redis."""

FORGOTTEN_AFTER_S = 900.0
"""For the same reason RabbitMQ, which is not asked how many wait, drops a doorbell that nobody heard for so long."""

KIND_OF = {SWEEP: "control", READ_UPLOAD: "reading", AUDIT_CHUNK: "audit", EXPLAIN: "explain", DELIVER: "deliver"}


def queue_names(settings: Settings) -> dict[str, str]:
    """The queue of each job, which no plant and database of other names has on the same broker."""
    told = f"{_database(settings)}\n{settings.plant}"
    own = hashlib.sha256(told.encode()).hexdigest()[:10]
    return {job: f"loopaudit-{own}-{kind}" for job, kind in KIND_OF.items()}


def _database(settings: Settings) -> str:
    """The name of the database on its server, or its file. Host, port and user are left out: processes on several
    machines may write them differently, and must meet all the same."""
    url = make_url(settings.resolved_database_url)
    if url.get_backend_name() == "sqlite":
        return str(file_of(url).resolve())
    return str(url.query.get("dbname") or url.database or url.username or "")
