"""What a worker does for an explanation: claims one, compares recording and simulation, writes if it still may."""

import logging
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from sqlalchemy.exc import SQLAlchemyError

from app.engine.evidence import Reason
from app.engine.mismatch import Comparison, Explanation, explain, locate
from app.engine.mismatch.compare.narrowing import span_to_explain
from app.engine.mismatch.judge.result import Location
from app.errors import DataError, LoopauditError
from app.nanoseconds import NS_PER_S
from app.services.auditing.limits import TimeLimitError, time_limit
from app.services.auditing.recordings import origin_ns, recording_of
from app.services.backend import Backend
from app.services.damage import damage_in_words
from app.services.database_errors import DATABASE_AWAY, no_room
from app.services.explaining.explanations import newest_samples
from app.services.explaining.line import explanation_line, location_line
from app.services.explaining.simulations import comparison_with, kind_of
from app.services.explaining.trace_table import stored_columns
from app.services.explaining.trigger import trigger_of
from app.services.heartbeat import Heartbeat
from app.services.patience import patiently
from app.storage import explanations, loops, series
from app.storage.documents import Document, pack_document, unpack_document
from app.storage.explanations import ExplanationClaim
from app.storage.loops import LoopRow
from app.storage.samples import Samples

LONGEST_TEXT = 2000

log = logging.getLogger("loopaudit.explaining")


@dataclass(frozen=True, eq=False)
class Task:
    """A claimed explanation with what the engine needs; `simulation` is None for our own linear loop.

    as_judged: whether only what an audit judges of a long record is explained. damage: what of the stored samples
    cannot be read, in words.
    """

    claim: ExplanationClaim
    loop: LoopRow
    samples: Samples | None
    simulation: Document | None
    as_judged: bool
    damage: str = ""


@dataclass(frozen=True)
class Ending:
    state: str
    values: dict[str, Any]


def explain_next(backend: Backend, owner: str, *, watchdog: bool = False) -> bool:
    """Works out the explanation whose turn it is and rings for a successor; False where none waits.

    May run twice or late: it then finds nothing to do.
    """
    lease_s = backend.settings.lease_s
    claim = patiently(lambda: _claim(backend, owner), lease_s)
    if claim is None:
        return False
    try:
        with Heartbeat(backend, lambda connection, lease_s: explanations.renew(connection, claim, lease_s)):
            ending = _isolated(backend, claim, watchdog)
        others_wait = patiently(lambda: _end(backend, claim, ending), lease_s)
    except DATABASE_AWAY as error:
        if no_room(error):
            _wait_for_room(backend, claim)
        raise
    if others_wait:
        backend.queue.explain(1)
    return True


def _wait_for_room(backend: Backend, claim: ExplanationClaim) -> None:
    """Nobody is called: others would find no room either; a sweep does so after a while."""
    log.error("no room on the disk to write explanation %s: it waits, make room", claim.explanation_id)
    with suppress(*DATABASE_AWAY), backend.database.write() as connection:  # which may find no room either
        explanations.wait_for_room(connection, claim, backend.settings.stalled_s)


def _claim(backend: Backend, owner: str) -> ExplanationClaim | None:
    with backend.database.write() as connection:
        return explanations.claim_next(connection, owner, backend.settings.lease_s)


def _end(backend: Backend, claim: ExplanationClaim, ending: Ending) -> bool:
    """Writes how it ended, if the claim still holds; whether others wait."""
    with backend.database.write() as connection:
        explanations.end(connection, claim, ending.state, ending.values)
        return explanations.any_waiting(connection)


def _load(backend: Backend, claim: ExplanationClaim) -> Task:
    with backend.database.read() as connection:
        row = explanations.claimed(connection, claim)
        loop = loops.by_ids(connection, [row.loop_id])[row.loop_id]
        start_ns, end_ns = row.window_start_ns or 0, row.window_end_ns or 0
        found = series.readable(connection, loop.id, start_ns, end_ns, backend.settings.hold_days)
        packed = explanations.packed_simulation(connection, row.id)
    simulation = None if packed is None else unpack_document(packed)
    damage = damage_in_words(found.damaged, backend.clock)
    return Task(claim, loop, found.samples, simulation, row.as_judged, damage)


def _isolated(backend: Backend, claim: ExplanationClaim, watchdog: bool) -> Ending:
    """How the explanation ends, whatever happens in it or is wrong with what it is made of. Raises where the database
    stays away, which is no fault of the explanation.
    """
    limit_s = backend.settings.explanation_limit_s
    try:
        task = patiently(lambda: _load(backend, claim), backend.settings.lease_s)
        return _explained(backend, task, limit_s, watchdog)
    except DATABASE_AWAY:
        raise
    except LoopauditError as error:
        return _failed(error.code, error.message)
    except TimeLimitError:
        return _failed("time_limit", f"the explanation took longer than {limit_s:g} s; take a shorter window")
    except MemoryError:
        return _failed("memory", "the explanation needed more memory than there is")
    except Exception as error:  # one explanation's fault must not take the worker with it; it is logged and shown
        log.exception("explanation %s failed", claim.explanation_id)
        return _failed("fault", f"{type(error).__name__}: {error}")


def _explained(backend: Backend, task: Task, limit_s: float, watchdog: bool) -> Ending:
    if task.samples is None or not len(task.samples):
        if task.damage:
            raise DataError("damaged_samples", task.damage)
        raise DataError("no_samples", "the loop has no samples in the window")
    started = time.perf_counter()
    with time_limit(limit_s, watchdog=watchdog):
        judged = _judged(task, task.samples)
        samples = newest_samples(judged, backend.settings.explanation_samples)
        said = (Reason("samples_damaged", task.damage),) if task.damage else ()
        comparison = comparison_with(task.loop, samples, task.simulation, said)
        first = locate(comparison)
    _tell_first(backend, task.claim, first)
    with time_limit(limit_s, watchdog=watchdog):
        explanation = explain(comparison)
    line = explanation_line(explanation, time.perf_counter() - started, kind_of(task.simulation))
    answer = answer_of(explanation, comparison, line, _start_ns(samples))
    codes = ";".join(effect.code for effect in explanation.effects)
    values = {"verdict": explanation.verdict, "effects": codes, "packed": pack_document(answer)}
    window = {"window_start_ns": int(samples.time_ns[0]), "window_end_ns": int(samples.time_ns[-1])}
    explained = window | {"as_judged": judged is not task.samples}
    return Ending("done", values | explained | {"error_code": None, "error_text": None})


def _judged(task: Task, samples: Samples) -> Samples:
    """What an audit judges of the samples, where that is asked for and is less than all."""
    span = span_to_explain(recording_of(task.loop, samples)) if task.as_judged else None
    if span is None:
        return samples
    first_ns, last_ns = (origin_ns(samples) + round(at_s * NS_PER_S) for at_s in span)
    first, after = np.searchsorted(samples.time_ns, first_ns), np.searchsorted(samples.time_ns, last_ns, side="right")
    return samples.part(slice(int(first), int(after)))


def _tell_first(backend: Backend, claim: ExplanationClaim, first: Location) -> None:
    """Where the two differ, told before it is known why. Should it not arrive, the whole answer will."""
    packed = pack_document(Document({"line": {"located": location_line(first)}}))
    with suppress(SQLAlchemyError), backend.database.write() as connection:
        explanations.note_first(connection, claim, packed)


def answer_of(explanation: Explanation, comparison: Comparison, line: dict[str, Any], start_ns: int) -> Document:
    """The line, what the residual depends on, and the traces; residuals are left out, they are differences."""
    header, columns = stored_columns(explanation)
    trigger = trigger_of(explanation, comparison)
    time_ns = np.round(explanation.traces.time_s * NS_PER_S).astype(np.int64)
    told = {
        "line": line,
        "header": header,
        "start_ns": start_ns,
        "trigger": trigger.label,
    }
    return Document(told, Samples(time_ns, {**columns, "trigger": trigger.values}))


def _start_ns(samples: Samples) -> int:
    """The instant of an explanation's second 0: the first sample with PV and OP."""
    return int(samples.time_ns[np.argmax(np.isfinite(samples.signals["pv"]) & np.isfinite(samples.signals["op"]))])


def _failed(code: str, text: str) -> Ending:
    return Ending("failed", {"error_code": code, "error_text": text[:LONGEST_TEXT], "packed": None})
