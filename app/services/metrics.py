"""What Prometheus is told: collected from the data base, so that every worker is counted."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Literal

from app.services.backend import Backend
from app.storage.figures import figures


@dataclass(frozen=True)
class Sample:
    value: float
    labels: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Metric:
    """One metric with its samples; the unit is at the end of its name."""

    name: str
    kind: Literal["gauge", "counter"]
    help: str
    samples: tuple[Sample, ...]


def metrics(backend: Backend, now: datetime | None = None) -> tuple[Metric, ...]:
    with backend.database.read() as connection:
        found = figures(connection)
    now = now or datetime.now(UTC)
    verdicts = tuple(
        Sample(count, {"verdict": verdict, "reliability": reliability})
        for (verdict, reliability), count in sorted(found.verdicts.items())
    )
    return (
        _gauge("loopaudit_loops", "Loops of the plant.", (Sample(found.loops),)),
        _gauge("loopaudit_uploads", "Uploads by state.", _by("state", found.uploads)),
        _gauge("loopaudit_open_items", "Loops in runs that have not ended, by state.", _by("state", found.open_items)),
        _gauge("loopaudit_failed_items", "Loops that failed in the runs kept, by code.", _by("code", found.failures)),
        _gauge("loopaudit_verdicts", "Loops by their newest verdict and its reliability.", verdicts),
        _gauge(
            "loopaudit_oldest_open_run_age_seconds",
            "Age of the oldest run that has not ended; 0: none waits. Old while no worker claims is an alarm.",
            (Sample(_age_s(found.oldest_open_run, now)),),
        ),
        _gauge(
            "loopaudit_oldest_unread_upload_age_seconds",
            "Age of the oldest upload that is not read yet; 0: none waits.",
            (Sample(_age_s(found.oldest_unread_upload, now)),),
        ),
        _gauge(
            "loopaudit_newest_verdicts_engine_seconds",
            "Engine time behind the newest verdicts of all loops, in seconds.",
            (Sample(found.elapsed_s),),
        ),
    )


def _gauge(name: str, help_: str, samples: Iterable[Sample]) -> Metric:
    return Metric(name, "gauge", help_, tuple(samples))


def _by(label: str, counts: Mapping[str, int]) -> Iterable[Sample]:
    return (Sample(count, {label: key}) for key, count in sorted(counts.items()))


def _age_s(since: datetime | None, now: datetime) -> float:
    return 0.0 if since is None else max(0.0, (now - since).total_seconds())
