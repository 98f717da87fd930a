"""What a worker does for a run: claims loops by the chunk, audits each for itself, writes by the chunk."""

import logging
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

from app.engine.audit import audit
from app.engine.audit_config import AuditConfig
from app.engine.plant_wide.excerpts import excerpts_of
from app.errors import DataError, LoopauditError
from app.logs import about
from app.services.audit_json.rows import new_verdict
from app.services.auditing.calling import call_workers
from app.services.auditing.ending import end_if_complete
from app.services.auditing.limits import TimeLimitError, time_limit
from app.services.auditing.recordings import origin_ns, recording_of
from app.services.auditing.repairs import Window, windows_since_repair
from app.services.backend import Backend
from app.services.database_errors import DATABASE_AWAY, commit_lost, no_room
from app.services.moments import PlantClock, latest_ns, moment_of
from app.services.patience import patiently
from app.storage import audits, items, loops, series, verdict_writing
from app.storage.audits import AuditRow
from app.storage.items import Claim, Failure
from app.storage.leases import Reopened
from app.storage.loops import LoopRow
from app.storage.tables import UNFINISHED
from app.storage.types import now
from app.storage.verdict_writing import NewVerdict

log = logging.getLogger("loopaudit.audit")


@dataclass(frozen=True, eq=False)
class Work:
    """A claimed loop with what the engine needs. window: None where it could not be had together with the others."""

    claim: Claim
    loop: LoopRow
    window: Window | None


@dataclass(frozen=True)
class Result:
    """One of the two."""

    claim: Claim
    verdict: NewVerdict | None = None
    failure: Failure | None = None


def audit_chunk(
    backend: Backend, audit_id: int, owner: str, *, watchdog: bool = False, calls_successor: bool = True
) -> int:
    """Audits open loops of the run for a while and rings for a successor where some are left; returns how many it
    began. calls_successor: False where the caller goes on by itself.

    May run twice, late, or for a run that has ended: it then finds nothing to do.
    """
    lease_s = backend.settings.lease_s
    run = patiently(lambda: _run(backend, audit_id), lease_s)
    if run is None or run.state not in UNFINISHED:
        return 0
    config = _config_of(run)
    until = time.monotonic() + backend.settings.chunk_budget_s
    done, replaced = 0, False
    with about(run=audit_id):
        while claims := _claim(backend, audit_id, owner, calls_successor):
            try:
                begun, replaced = _work_off(backend, run, config, claims, until, watchdog)
            except DATABASE_AWAY as error:
                if no_room(error):
                    _give_back(backend, claims)
                raise
            done += begun
            if replaced or time.monotonic() > until:
                break
        if not patiently(lambda: end_if_complete(backend, audit_id), lease_s) and calls_successor and not replaced:
            _call_successor(backend, audit_id)
        log.info("loops audited", extra={"loops": done})
    return done


def _run(backend: Backend, audit_id: int) -> AuditRow | None:
    with backend.database.read() as connection:
        return audits.by_id(connection, audit_id)


def _config_of(run: AuditRow) -> AuditConfig:
    """Its own, or where another version planned it, with settings that are none any more, this version's: each verdict
    names the configuration that it was made with, and a run that was open over an upgrade ends."""
    try:
        return AuditConfig.from_json(run.config_json)
    except DataError as error:
        log.warning("another version planned this run; it goes on by this version's settings: %s", error.message)
        return AuditConfig()


def _claim(backend: Backend, audit_id: int, owner: str, calls: bool) -> list[Claim]:
    """Looks for loops of lost workers first: while workers are busy, no sweep has its turn. Whoever was lost has no
    successor, and another is called; who calls nobody leaves what others lost of other runs to a sweep."""
    settings = backend.settings

    def claim() -> tuple[Reopened, list[Claim]]:
        of = None if calls else audit_id
        with backend.database.write() as connection:
            taken = items.reopen_expired(connection, settings.max_attempts, settings.lease_s, of)
            claims = items.claim(connection, audit_id, owner, settings.chunk_loops, settings.lease_s)
            if claims:
                audits.set_running(connection, audit_id)
        return taken, claims

    taken, claims = patiently(claim, settings.lease_s)
    for run, workers in taken.lost.items() if calls else ():
        call_workers(backend, run, workers, settings.lease_s)
    return claims


def _work_off(
    backend: Backend, run: AuditRow, config: AuditConfig, claims: Sequence[Claim], until: float, watchdog: bool
) -> tuple[int, bool]:
    """Writes what is done before the lease of the rest grows old, and renews the rest; leaves where none of it holds
    any more, as in a run that was cancelled. At the time `until` it hands back what it has not begun: loops that take
    long must not outlast the task. How many it began, and whether it was taken for lost: another was called then."""
    lease_s = backend.settings.lease_s
    started, results, begun = time.monotonic(), [], 0
    waiting = patiently(lambda: _load(backend, run, config, claims), lease_s)
    while waiting:
        results.append(_isolated(backend, waiting.pop(), run, config, watchdog))
        begun += 1
        over = time.monotonic() > until
        if over or time.monotonic() - started > lease_s / 4:
            held = _write(backend, results, [work.claim for work in waiting], hands_back=over)
            if over or not held:
                return begun, not held
            started, results = time.monotonic(), []
    return begun, not _write(backend, results, [])


def _give_back(backend: Backend, claims: Sequence[Claim]) -> None:
    """The disk was full, which is no fault of the loops: this attempt does not count. Nobody is called: a sweep does so
    after a while."""
    log.error("no room on the disk to write verdicts: loops are given back, make room", extra={"loops": len(claims)})
    with suppress(*DATABASE_AWAY), backend.database.write() as connection:  # which may find no room either
        items.hand_back(connection, claims)


def _load(backend: Backend, run: AuditRow, config: AuditConfig, claims: Sequence[Claim]) -> list[Work]:
    with backend.database.read() as connection:
        known = loops.by_ids(connection, [claim.loop_id for claim in claims])
    windows = _windows_together(backend, run, config, known)
    return [Work(claim, known[claim.loop_id], windows.get(claim.loop_id)) for claim in claims]


def _windows_together(
    backend: Backend, run: AuditRow, config: AuditConfig, known: Mapping[int, LoopRow]
) -> Mapping[int, Window]:
    """None at all where one of them cannot be had: each loop then looks for its own."""
    try:
        return _windows(backend, run, config, known)
    except DATABASE_AWAY:
        raise
    except Exception as error:  # noqa: BLE001 - one loop's stretch must not take the run with it; it is looked for again
        log.warning("windows of a chunk are read loop by loop: %s", error)
        return {}


def _windows(backend: Backend, run: AuditRow, config: AuditConfig, known: Mapping[int, LoopRow]) -> dict[int, Window]:
    hold_days, until_ns = backend.settings.hold_days, latest_ns()
    with backend.database.read() as connection:
        samples = series.windows(connection, known, run.window_h, run.window_samples, hold_days, until_ns)
        found = windows_since_repair(connection, known, samples, hold_days, config)
    return {loop_id: found.get(loop_id, Window(None)) for loop_id in known}


def _isolated(backend: Backend, work: Work, run: AuditRow, config: AuditConfig, watchdog: bool) -> Result:
    """Whatever happens in a loop's audit stays with that loop."""
    limit_s = backend.settings.loop_limit_s
    try:
        window = work.window or _own_window(backend, work.loop, run, config)
        with time_limit(limit_s, watchdog=watchdog):
            return Result(work.claim, verdict=_audited(work, window, run, config, backend.clock))
    except DATABASE_AWAY:
        raise
    except LoopauditError as error:
        return _set_aside(work, error.code, error.message)
    except TimeLimitError:
        return _set_aside(work, "time_limit", f"the audit took longer than {limit_s:g} s")
    except MemoryError:
        return _set_aside(work, "memory", "the audit needed more memory than there is")
    except Exception as error:  # noqa: BLE001 - one loop's fault must not take the run with it; it is stored and shown
        return _set_aside(work, "fault", f"{type(error).__name__}: {error}")


def _own_window(backend: Backend, loop: LoopRow, run: AuditRow, config: AuditConfig) -> Window:
    return patiently(lambda: _windows(backend, run, config, {loop.id: loop}), backend.settings.lease_s)[loop.id]


def _audited(work: Work, window: Window, run: AuditRow, config: AuditConfig, clock: PlantClock) -> NewVerdict:
    samples = window.samples
    if samples is None or not len(samples):
        raise LoopauditError("no_samples", "the loop has no samples in the window")
    started = time.perf_counter()
    recording, origin = recording_of(work.loop, samples), moment_of(origin_ns(samples))
    found = window.told(audit(recording, config), clock)
    return new_verdict(
        found,
        recording=recording,
        loop_id=work.loop.id,
        audit_id=run.id,
        origin=origin,
        audited_at=now(),
        elapsed_s=time.perf_counter() - started,
        input_ns=(int(samples.time_ns[0]), int(samples.time_ns[-1])),
        begun=run.created_at,
        newest_ns=run.newest_ns,
        clock=clock,
        held_ns=samples.held_ns,
        kept=excerpts_of(recording, origin.timestamp()),
    )


def _set_aside(work: Work, code: str, text: str) -> Result:
    log.warning("loop failed", extra={"loop": work.loop.tag, "code": code, "text": text})
    return Result(work.claim, failure=Failure(work.claim, code, text))


def _write(backend: Backend, results: Sequence[Result], waiting: Sequence[Claim], *, hands_back: bool = False) -> bool:
    """Verdicts of claims that still hold, once; what was lost to another worker is left to it. Those that wait are
    renewed, or handed back. False where none of all these held any more, as far as is known: after a commit whose
    answer was lost, what was written holds none."""
    in_doubt: list[Exception] = []
    new = [result.verdict for result in results if result.verdict is not None]

    def write() -> bool:
        with backend.database.write() as connection:
            held = items.finish(connection, [result.claim for result in results if result.verdict is not None])
            verdict_writing.add(connection, [verdict for verdict in new if verdict.loop_id in held])
            items.fail(connection, [result.failure for result in results if result.failure is not None])
            if hands_back:
                kept = items.hand_back(connection, waiting)
            else:
                kept = items.renew(connection, waiting, backend.settings.lease_s)
        return bool(held or kept) or not (new or waiting)

    def noting_doubt() -> bool:
        try:
            return write()
        except DATABASE_AWAY as error:
            in_doubt.extend([error] if commit_lost(error) else [])
            raise

    return patiently(noting_doubt, backend.settings.lease_s) or bool(in_doubt)


def _call_successor(backend: Backend, audit_id: int) -> None:
    """Where loops are left."""
    lease_s = backend.settings.lease_s
    if patiently(lambda: _left(backend, audit_id), lease_s):
        call_workers(backend, audit_id, 1, lease_s)


def _left(backend: Backend, audit_id: int) -> int:
    with backend.database.read() as connection:
        return audits.progress(connection, [audit_id])[audit_id].open
