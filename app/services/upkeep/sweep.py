"""The sweep, every few seconds: finds what lost workers held and what was lost on its way, and does what is due."""

import logging
from collections.abc import Callable, Iterable
from functools import partial
from typing import TypeVar

from sqlalchemy.exc import SQLAlchemyError

from app.services.auditing import audits as audit_runs
from app.services.auditing.calling import call_workers
from app.services.auditing.ending import end_if_complete
from app.services.auditing.nightly import announce_explanations, nightly_if_due
from app.services.backend import Backend
from app.services.database_errors import DATABASE_AWAY
from app.services.digests.deliveries import announce_digests
from app.services.intake.drafts import drafts, is_held
from app.services.intake.uploads import is_seen
from app.services.results import SweepReport
from app.services.upkeep.retention import older_than, retain_if_due
from app.storage import audits, explanations, items, uploads

DRAFT_LIFE_S = 24 * 3600

T = TypeVar("T")

log = logging.getLogger("loopaudit.upkeep")


def sweep(backend: Backend) -> SweepReport:
    """Gives the work of lost workers to others, ends runs that are complete, rings again for what nobody works on,
    begins the night and drops what is old. Each of these is done whatever became of the others.

    May run at any time, and twice at once.
    """
    return sum(in_turn(backend, [partial(duty, backend) for duty in DUTIES]), SweepReport())


def in_turn(backend: Backend, actions: Iterable[Callable[[], T]]) -> list[T]:
    """What each of them gives. The first fault is raised once all had their turn, and further ones are logged; where
    the database does not answer, none of the rest would do better."""
    given: list[T] = []
    faults: list[Exception] = []
    for action in actions:
        try:
            given.append(action())
        except Exception as error:  # noqa: BLE001 - what fails each time must not keep all else from being done
            faults.append(error)
            if isinstance(error, DATABASE_AWAY) and not answers(backend):
                break
    for further in faults[1:]:
        log.error("a further duty of the sweep failed", exc_info=further)
    if faults:
        raise faults[0]
    return given


def answers(backend: Backend) -> bool:
    """Whether the database does, at the moment."""
    try:
        backend.database.answers()
    except SQLAlchemyError:
        return False
    return True


def take_back_loops(backend: Backend) -> SweepReport:
    """Whoever was lost has no successor: for each another is called."""
    with backend.database.write() as connection:
        taken = items.reopen_expired(connection, backend.settings.max_attempts, backend.settings.lease_s)
    in_turn(backend, [partial(call_workers, backend, run, workers) for run, workers in taken.lost.items()])
    return SweepReport(reopened=taken.reopened, failed=taken.failed)


def take_back_explanations(backend: Backend) -> SweepReport:
    with backend.database.write() as connection:
        explanations.reopen_expired(connection, backend.settings.max_attempts, backend.settings.lease_s)
    return SweepReport()


def end_runs(backend: Backend) -> SweepReport:
    with backend.database.read() as connection:
        complete = audits.complete(connection)
    ended = in_turn(backend, [partial(end_if_complete, backend, audit_id) for audit_id in complete])
    return SweepReport(ended=sum(ended))


def announce_uploads(backend: Backend) -> SweepReport:
    settings = backend.settings
    _look_for_unseen(backend)
    with backend.database.write() as connection:
        uploads.give_up(connection, settings.max_reading_attempts, settings.lease_s)
        unread = uploads.to_announce(connection, settings.stalled_s, settings.lease_s)
    for upload_id in unread:
        backend.queue.read_upload(upload_id)
    return SweepReport(announced=len(unread))


def _look_for_unseen(backend: Backend) -> None:
    """Files that workers did not see and that are here now, as on a share that came back, wait no longer than others.
    Others' pause they keep: where another worker does not see them still, it would be asked by each sweep of this one,
    which is busy, and never this one by it."""
    with backend.database.read() as connection:
        unseen = uploads.unseen(connection, longer_than_s=backend.settings.stalled_s)
    here = [upload_id for upload_id, fingerprint in unseen.items() if is_seen(backend, fingerprint)]
    if here:
        with backend.database.write() as connection:
            uploads.seen_again(connection, here)


def announce_runs(backend: Backend) -> SweepReport:
    with backend.database.write() as connection:
        stalled = audits.to_announce(connection, backend.settings.stalled_s)
    for audit_id in stalled:
        audit_runs.announce(backend, audit_id)
    return SweepReport(announced=len(stalled))


def explain_the_worst(backend: Backend) -> SweepReport:
    return SweepReport(announced=announce_explanations(backend))


def send_digests(backend: Backend) -> SweepReport:
    return SweepReport(announced=announce_digests(backend))


def begin_night(backend: Backend) -> SweepReport:
    run = nightly_if_due(backend)
    return SweepReport(nightly=run.id if run else None)


def make_folder(backend: Backend) -> SweepReport:
    backend.new_folder.make_once_told()
    return SweepReport()


def drop_what_is_old(backend: Backend) -> SweepReport:
    retain_if_due(backend)
    return SweepReport()


def drop_old_drafts(backend: Backend) -> SweepReport:
    """What is left of uploads that broke off with their process."""
    for draft in drafts(backend.settings):
        if older_than(draft, DRAFT_LIFE_S) and not is_held(draft):
            draft.unlink(missing_ok=True)
    return SweepReport()


DUTIES = (
    take_back_loops,
    take_back_explanations,
    end_runs,
    announce_uploads,
    announce_runs,
    explain_the_worst,
    send_digests,
    begin_night,
    make_folder,
    drop_what_is_old,
    drop_old_drafts,
)
