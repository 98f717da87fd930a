"""Digests on their way: one row a run and receiver, claimed for a time, tried again later, then done or failed."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from itertools import count, takewhile

from sqlalchemy import ColumnElement, Connection, Update, and_, case, or_, select, update

from app.counting import counted_times
from app.storage.bulk import insert_new
from app.storage.leases import Reopened, take_back
from app.storage.tables import UNDELIVERED, deliveries
from app.storage.types import clock_s, now, run_out

FIRST_WAIT_S = 60.0
LONGEST_WAIT_S = 3600.0


@dataclass(frozen=True)
class DeliveryRow:
    audit_id: int
    receiver: str
    state: str
    attempts: int
    ended_at: datetime | None
    error_text: str | None


@dataclass(frozen=True)
class DeliveryClaim:
    """The right to send a digest and to say what became of it; `attempt` fences off whoever had it before. `id_suffix`
    is part of the id that it is sent with."""

    audit_id: int
    receiver: str
    attempt: int
    owner: str
    id_suffix: str = ""


COLUMNS = [deliveries.c[name] for name in DeliveryRow.__dataclass_fields__]


def plan(connection: Connection, audit_id: int, receivers: Iterable[str]) -> None:
    """A delivery to each receiver, where there is none of this run yet."""
    rows = [{"audit_id": audit_id, "receiver": receiver} for receiver in receivers]
    if rows:
        connection.execute(insert_new(connection, deliveries), rows)


def reopen_failed(connection: Connection, audit_id: int, receivers: Iterable[str]) -> None:
    """What was given up is sent with the id that it had, and with all its tries."""
    _reopen(connection, audit_id, receivers, "failed")


def reopen_done(connection: Connection, audit_id: int, receivers: Iterable[str], id_suffix: str) -> None:
    """What was delivered is sent once more: at each try, whoever makes it, with an id that ends in `id_suffix`."""
    _reopen(connection, audit_id, receivers, "done", id_suffix=id_suffix)


def _reopen(connection: Connection, audit_id: int, receivers: Iterable[str], state: str, **values: str) -> None:
    wanted = (deliveries.c.receiver.in_(tuple(receivers)), deliveries.c.state == state)
    anew = {"state": "open", "attempts": 0, "next_try_s": None, "ended_at": None, "error_text": None, **values}
    connection.execute(update(deliveries).where(deliveries.c.audit_id == audit_id, *wanted).values(anew))


def of_run(connection: Connection, audit_id: int) -> list[DeliveryRow]:
    query = select(*COLUMNS).where(deliveries.c.audit_id == audit_id).order_by(deliveries.c.receiver)
    return [DeliveryRow(*row) for row in connection.execute(query)]


def newest_failed(connection: Connection, receivers: Iterable[str], limit: int) -> list[DeliveryRow]:
    """Those of these receivers that were given up, of the newest run that was sent to anybody."""
    newest = select(deliveries.c.audit_id).order_by(deliveries.c.audit_id.desc()).limit(1).scalar_subquery()
    failed = (deliveries.c.state == "failed", deliveries.c.receiver.in_(tuple(receivers)))
    query = select(*COLUMNS).where(deliveries.c.audit_id == newest, *failed)
    return [DeliveryRow(*row) for row in connection.execute(query.order_by(deliveries.c.receiver).limit(limit))]


def claim_next(
    connection: Connection, owner: str, lease_s: float, this: tuple[int, str] | None = None
) -> DeliveryClaim | None:
    """The delivery whose turn it is (or `this` run's to this receiver, whenever its turn is), for `lease_s` seconds by
    the database's clock; None: nothing is to be sent now. Those that were tried least come first."""
    wanted = _due()
    if this is not None:
        of_it = (deliveries.c.audit_id == this[0], deliveries.c.receiver == this[1])
        wanted = and_(deliveries.c.state == "open", *of_it)
    picked = connection.execute(
        select(deliveries.c.audit_id, deliveries.c.receiver)
        .where(wanted)
        .order_by(deliveries.c.attempts, deliveries.c.audit_id, deliveries.c.receiver)
        .limit(1)
        .with_for_update(skip_locked=True)
    ).one_or_none()
    if picked is None:
        return None
    claimed = connection.execute(
        update(deliveries)
        .where(deliveries.c.audit_id == picked.audit_id, deliveries.c.receiver == picked.receiver)
        .values(state="claimed", owner=owner, lease_until_s=clock_s() + lease_s, attempts=deliveries.c.attempts + 1)
        .returning(deliveries.c.attempts, deliveries.c.id_suffix)
    ).one()
    return DeliveryClaim(picked.audit_id, picked.receiver, claimed.attempts, owner, claimed.id_suffix or "")


def renew(connection: Connection, claim: DeliveryClaim, lease_s: float) -> bool:
    """Whether the claim still holds; its lease then starts anew."""
    return connection.execute(_held(claim).values(lease_until_s=clock_s() + lease_s)).rowcount == 1


def end(connection: Connection, claim: DeliveryClaim, state: str, error_text: str | None) -> bool:
    """Whether the claim still held, and the delivery has ended so."""
    ended = {"state": state, "ended_at": now(), "error_text": error_text, "next_try_s": None}
    return connection.execute(_held(claim).values(owner=None, lease_until_s=None, **ended)).rowcount == 1


def try_later(connection: Connection, claim: DeliveryClaim, error_text: str) -> bool:
    """Whether the claim still held, and the delivery waits for its next try."""
    later = {"state": "open", "next_try_s": clock_s() + wait_s(claim.attempt), "error_text": error_text}
    return connection.execute(_held(claim).values(owner=None, lease_until_s=None, **later)).rowcount == 1


def wait_s(attempt: int) -> float:
    """After this one: 1, 2, 4 ... minutes, an hour at most."""
    return min(FIRST_WAIT_S * 2 ** (attempt - 1), LONGEST_WAIT_S)


def reopen_expired(connection: Connection, max_attempts: int, lease_s: float) -> Reopened:
    """Takes deliveries back whose lease has ended: they may have been sent, and are sent again with the same id."""
    lost = f"the worker was lost {counted_times(max_attempts)} while it sent this digest"
    failed = {"ended_at": now(), "error_text": lost, "next_try_s": None}
    claimed = UNDELIVERED & (deliveries.c.state == "claimed")
    return take_back(connection, deliveries, claimed, max_attempts, lease_s, failed, {"next_try_s": None})


def due(connection: Connection) -> int:
    """How many could be sent now."""
    return len(connection.execute(select(deliveries.c.receiver).where(_due())).all())


def _due() -> ColumnElement[bool]:
    sooner = takewhile(lambda tries: wait_s(tries) < LONGEST_WAIT_S, count(1))
    longest_s = case({tries: wait_s(tries) for tries in sooner}, value=deliveries.c.attempts, else_=LONGEST_WAIT_S)
    its_turn = or_(deliveries.c.next_try_s.is_(None), run_out(deliveries.c.next_try_s, longest_s))
    return and_(UNDELIVERED, deliveries.c.state == "open", its_turn)


def _held(claim: DeliveryClaim) -> Update:
    return update(deliveries).where(
        deliveries.c.audit_id == claim.audit_id,
        deliveries.c.receiver == claim.receiver,
        deliveries.c.state == "claimed",
        deliveries.c.owner == claim.owner,
        deliveries.c.attempts == claim.attempt,
    )
