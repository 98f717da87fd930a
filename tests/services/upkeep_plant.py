"""A plant that was read and audited, for the tests of its upkeep on both databases."""

import os
import time
from datetime import UTC, datetime, timedelta

from sqlalchemy import func, select, update

from app.services.access import keys
from app.services.access.identity import Role
from app.services.auditing.audits import get_audit, start_audit
from app.services.auditing.chunks import audit_chunk
from app.services.backend import Backend
from app.services.intake import uploads
from app.services.intake.reading import read_upload
from app.storage import tables
from app.storage.tables import metadata
from tests.services.kept_rows import made_once

EXPORT = b"DateTime,FIC1.PV,FIC1.OP,FIC1.SP\n" + b"".join(
    f"2026-01-01T{k // 60:02d}:{k % 60:02d}:00Z,{50 + (k % 40) / 20 + k % 3 * 0.1},{40 + k % 40},50\n".encode()
    for k in range(400)
)


def count(backend: Backend, table: str) -> int:
    with backend.database.read() as connection:
        return connection.scalar(select(func.count()).select_from(metadata.tables[table])) or 0


def audited_twice(backend: Backend) -> Backend:
    """The plant with one loop, read from an upload and audited twice; a key; the trail of both."""
    fingerprint = made_once(backend, "one loop, read and audited twice", lambda: _read_and_audited(backend))
    export = backend.settings.uploads_dir / str(fingerprint)
    if not export.exists():
        export.write_bytes(EXPORT)
    return backend


def _read_and_audited(backend: Backend) -> str:
    """What the file of its upload is called."""
    with uploads.receive(backend, filename="plant.csv") as receiving:
        receiving.write(EXPORT)
        receipt = receiving.commit()
    read_upload(backend, int(receipt.upload.id), owner="test")
    for _ in range(2):
        run = start_audit(backend)
        audit_chunk(backend, int(run.id), "test")
        assert get_audit(backend, run.id).state == "done"
    keys.create_key(backend, "me", Role.admin, lifetime=None)
    [export] = backend.settings.uploads_dir.iterdir()
    return export.name


def aged(backend: Backend, days: float) -> None:
    """As if everything had happened that long ago."""
    ago = datetime.now(UTC) - timedelta(days=days)
    with backend.database.write() as connection:
        connection.execute(update(tables.audits).values(ended_at=ago, created_at=ago))
        connection.execute(update(tables.trail).values(at=ago))
        connection.execute(update(tables.uploads).values(received_at=ago, ended_at=ago))
    for file in backend.settings.uploads_dir.iterdir():
        os.utime(file, (time.time() - 86400 * days,) * 2)


def with_settings(backend: Backend, **changes: object) -> Backend:
    return Backend(backend.settings.model_copy(update=changes), backend.database, backend.queue)
