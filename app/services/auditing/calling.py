"""Workers are called to a run while others work on it."""

from app.services.backend import Backend
from app.services.patience import patiently
from app.storage import audits


def call_workers(backend: Backend, audit_id: int, workers: int, patience_s: float = 0.0) -> None:
    """For each worker that ends, or was lost, another. They are told of the run by this: it is announced again only
    where that broke off. patience_s: for how long a database that is away is waited for."""
    told = backend.queue.audit_chunks(audit_id, workers)
    patiently(lambda: _note(backend, audit_id, told), patience_s)


def _note(backend: Backend, audit_id: int, told: bool) -> None:
    with backend.database.write() as connection:
        if told:
            audits.note_called(connection, audit_id)
        else:
            audits.note_uncalled(connection, audit_id)
