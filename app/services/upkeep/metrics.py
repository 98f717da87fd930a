"""What Prometheus is told: collected from the database, so that every worker is counted."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

from app.services.backend import Backend
from app.services.data_folder import free_bytes
from app.services.moments import seconds_of
from app.services.plant.arrivals import Arrivals, arrivals
from app.storage import figures
from app.storage.figures import EndedRun, Figures


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


def metrics(backend: Backend) -> tuple[Metric, ...]:
    with backend.database.read() as connection:
        found = figures.collect(connection)
    return (*_states(found), *_work(found), *_reach(arrivals(backend)), *_kept(found, free_bytes(backend.settings)))


def _states(found: Figures) -> tuple[Metric, ...]:
    """How many loops, uploads and items of runs there are, by what became of them."""
    return (
        _gauge("loopaudit_loops", "Loops of the plant, without those that are retired.", (Sample(found.loops),)),
        _gauge(
            "loopaudit_loops_retired", "Loops that are retired: not audited, not counted.", (Sample(found.retired),)
        ),
        _gauge("loopaudit_uploads", "Uploads by state.", _by("state", found.uploads)),
        _gauge(
            "loopaudit_open_run_items",
            "Loops in runs that have not ended, by state.",
            _by("state", found.waiting.items),
        ),
        _gauge(
            "loopaudit_failed_items",
            "Loops that failed in the newest nightly run that ended, by code.",
            _by("code", found.failures),
        ),
        _gauge(
            "loopaudit_failed_items_last_day",
            "Loops that failed in all runs that ended within the last 24 hours, by code.",
            _by("code", found.failures_day),
        ),
        _gauge("loopaudit_verdicts", "Loops by their newest verdict.", _by("verdict", found.verdicts)),
    )


def _work(found: Figures) -> tuple[Metric, ...]:
    """What waits, for how long, and how long an audit takes."""
    return (
        _gauge(
            "loopaudit_oldest_open_run_age_seconds",
            "Age of the oldest run that has not ended; 0: none. Old while no worker claims is an alarm.",
            (Sample(found.waiting.oldest_open_s),),
        ),
        _gauge(
            "loopaudit_audit_mean_seconds",
            "Mean engine time of a loop's audit over the newest verdicts.",
            _one(found.audit_seconds),
        ),
        _gauge("loopaudit_queue_depth", "What waits for a worker, by kind.", _by("kind", _waiting(found))),
        _gauge(
            "loopaudit_oldest_unread_upload_age_seconds",
            "Age of the oldest upload that has not been read; 0: none.",
            (Sample(found.waiting.oldest_unread_s),),
        ),
    )


def _reach(found: Arrivals) -> tuple[Metric, ...]:
    """How far the records reach."""
    newest_s = None if found.recorded_to is None else seconds_of(found.recorded_to)
    return (
        _gauge(
            "loopaudit_newest_sample_timestamp_seconds",
            "When the newest sample was recorded. Old while uploads go on is an alarm: the export stands still.",
            _one(newest_s),
        ),
        _gauge(
            "loopaudit_loops_behind",
            "Loops that got no sample for two days or more before the newest one.",
            (Sample(found.behind),),
        ),
    )


def _kept(found: Figures, free: int) -> tuple[Metric, ...]:
    """What is kept and what there is room for, what has been done, and who may ask."""
    return (
        Metric(
            "loopaudit_upload_bytes_total",
            "counter",
            "Bytes of all uploads as they came.",
            (Sample(found.uploads_bytes),),
        ),
        _gauge("loopaudit_explanations", "Explanations by state.", _by("state", found.explanations)),
        _gauge(
            "loopaudit_data_folder_free_bytes",
            "Room left on the volume of the data folder: exports, and the database where it is SQLite.",
            (Sample(free),),
        ),
        *_ended("run", "the newest ended run of any kind", found.last_run),
        *_ended("night", "the newest ended nightly run", found.last_night),
        _gauge("loopaudit_active_keys", "Keys that are neither revoked nor expired.", (Sample(found.active_keys),)),
    )


def _ended(name: str, words: str, run: EndedRun | None) -> Iterator[Metric]:
    took, ended = (None, None) if run is None else (run.took_s, run.ended_s)
    yield _gauge(f"loopaudit_last_{name}_duration_seconds", f"How long {words} took.", _one(took))
    yield _gauge(f"loopaudit_last_{name}_ended_timestamp_seconds", f"When {words} ended.", _one(ended))


def _gauge(name: str, help_: str, samples: Iterable[Sample]) -> Metric:
    return Metric(name, "gauge", help_, tuple(samples))


def _one(value: float | None) -> tuple[Sample, ...]:
    return () if value is None else (Sample(value),)


def _waiting(found: Figures) -> dict[str, int]:
    return {
        "upload": found.uploads.get("received", 0),
        "loop": found.waiting.items.get("open", 0),
        "explanation": found.explanations.get("open", 0),
    }


def _by(label: str, counts: Mapping[str, int]) -> Iterable[Sample]:
    return (Sample(count, {label: key}) for key, count in sorted(counts.items()))
