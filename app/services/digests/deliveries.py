"""The nightly digest on its way: planned once a run and receiver, sent at least once, tried again, in the end given up.

A receiver that is away costs its own row some tries, and nobody else anything.
"""

import hashlib
import json
import logging
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import timedelta
from functools import cache, partial

import httpx

from app.errors import LoopauditError
from app.services.access import trail
from app.services.access.identity import SCHEDULE, Identity
from app.services.backend import Backend
from app.services.cursors import identifier
from app.services.digests.digest import Digest
from app.services.digests.mailing import send_mail
from app.services.digests.making import digest_of, ended_run
from app.services.digests.sending import Mail, NotSentError, Post, shown
from app.services.digests.telling import as_html, as_json, as_text, subject
from app.services.digests.webhooks import checked_address, send_webhook
from app.services.heartbeat import Heartbeat
from app.services.moments import iso_utc
from app.services.outward import TrailOutcome
from app.storage import deliveries
from app.storage.audits import newest_night
from app.storage.deliveries import DeliveryClaim, DeliveryRow

YOUNG = timedelta(hours=24)
LONGEST_ERROR = 500
LISTED = 20
ACTION = "digest.send"

log = logging.getLogger("loopaudit.digest")


@dataclass(frozen=True)
class DeliveryView:
    """`receiver` as it may be shown; `state` is open, claimed, done or failed, `reason` why it is not done. `before`:
    it had been delivered before somebody asked for it by hand."""

    audit_id: str
    receiver: str
    state: str
    attempts: int
    ended_at: str | None
    reason: str | None
    before: bool = False


def announce_digests(backend: Backend) -> int:
    """Plans the digest of the newest night once its run has ended, takes back what lost workers had, and rings for all
    that is due. A night that ended long ago is not told of: who sets a receiver up waits for the next one."""
    with backend.database.write() as connection:
        deliveries.reopen_expired(connection, backend.settings.digest_attempts, backend.settings.lease_s)
        run = newest_night(connection, at_most_old=YOUNG)
        if run is not None:
            deliveries.plan(connection, run, backend.settings.digest_receivers)
        waiting = deliveries.due(connection)
    backend.queue.deliver(min(waiting, backend.settings.fan_out))
    return waiting


def send_now(backend: Backend, owner: str, audit_id: str, *, by: Identity, again: bool = False) -> list[DeliveryView]:
    """For whoever sends a digest by hand (`by`): this run's to every receiver that has not got it, those given up too,
    each tried once; what fails is tried again by the service. `again`: also to those who have it, with an id of its own
    that it keeps, because mail servers drop what they know by its id."""
    ended_run(backend, audit_id)
    run, receivers = identifier(audit_id), backend.settings.digest_receivers
    with backend.database.write() as connection:
        deliveries.plan(connection, run, receivers)
        deliveries.reopen_failed(connection, run, receivers)
        if again:
            deliveries.reopen_done(connection, run, receivers, f"-{time.time_ns()}")
        had = {row.receiver for row in deliveries.of_run(connection, run) if row.state == "done"}
    made = cache(partial(digest_of, backend))
    for receiver in receivers:
        deliver_next(backend, owner, (run, receiver), made, by)
    with backend.database.read() as connection:
        rows = [row for row in deliveries.of_run(connection, run) if row.receiver in receivers]
    return [replace(_view(row), before=row.receiver in had) for row in rows]


def deliver_next(
    backend: Backend,
    owner: str,
    this: tuple[int, str] | None = None,
    made: Callable[[str], Digest] | None = None,
    by: Identity = SCHEDULE,
) -> bool:
    """Sends the digest whose turn it is, or `this` run's to this receiver; False where there is none. Sent and not
    marked is sent again, with the same id. made: gives the digest of a run; None: it is made anew. by: whom the trail
    names."""
    with backend.database.write() as connection:
        claim = deliveries.claim_next(connection, owner, backend.settings.lease_s, this)
    if claim is None:
        return False
    try:
        with Heartbeat(backend, lambda connection, lease_s: deliveries.renew(connection, claim, lease_s)):
            _send(backend, claim, made or partial(digest_of, backend))
    except NotSentError as error:
        _not_sent(backend, claim, by, str(error), final=error.final)
    except LoopauditError as error:
        _not_sent(backend, claim, by, error.message, final=True)
    except Exception as error:  # one receiver's fault must not hold up the others; it is logged and shown
        log.exception("the digest of run %s was not sent to %s", claim.audit_id, shown(claim.receiver))
        _not_sent(backend, claim, by, f"a fault of ours: {type(error).__name__}", final=False)
    else:
        _sent(backend, claim, by)
    return True


def deliveries_of(backend: Backend, audit_id: str) -> list[DeliveryView]:
    with backend.database.read() as connection:
        rows = deliveries.of_run(connection, identifier(audit_id))
    return [_view(row) for row in rows]


def newest_failed(backend: Backend) -> list[DeliveryView]:
    """Those of today's receivers that were given up, of the newest run that was sent to anybody."""
    with backend.database.read() as connection:
        rows = deliveries.newest_failed(connection, backend.settings.digest_receivers, LISTED)
    return [_view(row) for row in rows]


def missing_settings(backend: Backend) -> Iterator[str]:
    """Which settings the receivers that are named still need."""
    settings = backend.settings
    receivers = settings.digest_receivers
    if any(receiver.startswith("mailto:") for receiver in receivers):
        for name in ("digest_smtp_host", "digest_mail_from"):
            if not getattr(settings, name):
                yield f"LOOPAUDIT_{name.upper()}"
    if settings.digest_webhooks and not settings.digest_webhook_secret.get_secret_value():
        yield "LOOPAUDIT_DIGEST_WEBHOOK_SECRET"


def out_of_reach(backend: Backend) -> Iterator[str]:
    """Why what is sent would not get through, as far as names tell: nothing is sent, and nobody is connected to."""
    settings = backend.settings
    if any(receiver.startswith("mailto:") for receiver in settings.digest_receivers):
        try:
            socket.getaddrinfo(settings.digest_smtp_host, settings.digest_smtp_port, type=socket.SOCK_STREAM)
        except (OSError, UnicodeError) as error:
            yield f"the mail server {settings.digest_smtp_host} is not found: {_no_address(error)}"
    for receiver in settings.digest_receivers:
        if receiver.startswith("mailto:"):
            continue
        try:
            checked_address(httpx.URL(receiver), settings.digest_private_webhooks)
        except NotSentError as error:
            yield str(error)
        except (httpx.InvalidURL, OSError, UnicodeError) as error:
            yield f"{shown(receiver)} is not found: {_no_address(error)}"


def _no_address(error: Exception) -> str:
    return getattr(error, "strerror", None) or "this is no name"


def mail_of(digest: Digest, receiver: str, id_suffix: str = "") -> Mail:
    return Mail(delivery_id(digest, receiver, id_suffix), subject(digest), as_text(digest), as_html(digest))


def post_of(digest: Digest, receiver: str, id_suffix: str = "") -> Post:
    named = delivery_id(digest, receiver, id_suffix)
    return Post(named, json.dumps({"id": named} | as_json(digest), ensure_ascii=False).encode())


def delivery_id(digest: Digest, receiver: str, id_suffix: str) -> str:
    """Made of the run and the receiver: it is the same at every try, and in no other installation. `id_suffix` makes it
    another one."""
    run = digest.run
    named = json.dumps([digest.plant, run.id, run.created_at, receiver])
    return f"digest-{run.id}-{hashlib.sha256(named.encode()).hexdigest()[:24]}{id_suffix}"


def _send(backend: Backend, claim: DeliveryClaim, made: Callable[[str], Digest]) -> None:
    if claim.receiver not in backend.settings.digest_receivers:
        raise NotSentError("the receiver stands no longer in the settings", final=True)
    missing = list(missing_settings(backend))
    if missing:
        raise NotSentError(f"not set: {', '.join(missing)}")
    digest, to = made(str(claim.audit_id)), (claim.receiver, claim.id_suffix)
    if claim.receiver.startswith("mailto:"):
        send_mail(backend.settings, mail_of(digest, *to), claim.receiver.removeprefix("mailto:"))
    else:
        send_webhook(backend.settings, post_of(digest, *to), claim.receiver)


def _sent(backend: Backend, claim: DeliveryClaim, by: Identity) -> None:
    with backend.database.write() as connection:
        held = deliveries.end(connection, claim, "done", None)
    if held:
        log.info("digest sent", extra={"run": claim.audit_id, "receiver": shown(claim.receiver)})
        _tell(backend, claim, by, "done")


def _not_sent(backend: Backend, claim: DeliveryClaim, by: Identity, reason: str, *, final: bool) -> None:
    given_up = final or claim.attempt >= backend.settings.digest_attempts
    text = reason[:LONGEST_ERROR]
    with backend.database.write() as connection:
        if given_up:
            held = deliveries.end(connection, claim, "failed", text)
        else:
            held = deliveries.try_later(connection, claim, text)
    if not held:
        return  # whoever has it now tells what became of it
    told = {"run": claim.audit_id, "receiver": shown(claim.receiver), "attempt": claim.attempt, "reason": text}
    log.warning("digest given up" if given_up else "digest not sent, tried again later", extra=told)
    if given_up:
        _tell(backend, claim, by, "failed", reason=text)


def _view(row: DeliveryRow) -> DeliveryView:
    ended_at = iso_utc(row.ended_at)
    return DeliveryView(str(row.audit_id), shown(row.receiver), row.state, row.attempts, ended_at, row.error_text)


def _tell(backend: Backend, claim: DeliveryClaim, by: Identity, outcome: TrailOutcome, **detail: str) -> None:
    subject_ = f"/v1/audits/{claim.audit_id}"
    trail.record(backend, by, ACTION, subject_, outcome, receiver=shown(claim.receiver), **detail)
