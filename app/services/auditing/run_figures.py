"""What a run came to, and how long its loops took."""

from dataclasses import dataclass

from app.services.auditing.audits import get_audit
from app.services.auditing.standing_still import nobody_works
from app.services.backend import Backend
from app.services.outward import AuditOut
from app.storage import run_figures as stored


@dataclass(frozen=True)
class RunFigures:
    """What a run came to: verdicts by kind, and how long its loops took. nobody_works: what is said of it where it
    goes on and no worker does."""

    run: AuditOut
    verdicts: dict[str, int]
    loops: int
    mean_s: float | None
    longest_s: float | None
    total_s: float | None
    slowest: list[tuple[str, float]]
    nobody_works: str = ""


def run_figures(backend: Backend, audit_id: str) -> RunFigures:
    run = get_audit(backend, audit_id)
    with backend.database.read() as connection:
        took = stored.durations(connection, int(run.id))
        slowest = [(row.tag, row.elapsed_s) for row in stored.slowest(connection, int(run.id), 5)]
        counted = stored.verdict_counts(connection, int(run.id))
    waited = "" if run.ended else nobody_works(backend)
    return RunFigures(run, counted, took.loops, took.mean, took.longest, took.total, slowest, waited)
