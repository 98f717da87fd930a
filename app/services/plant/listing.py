"""By what loops are listed: the same for all lists of one answer."""

from dataclasses import dataclass
from datetime import datetime

from app.services.backend import Backend
from app.services.plant.stood_together import ALONE, AsOne, as_one
from app.services.plant.told_until import notes_until
from app.services.stating.shelving import Shelf, shelf


@dataclass(frozen=True)
class Listing:
    """together: loops that are told of as one. since_ns: loops without a sample as new as that are listed apart (None:
    no loop is). audit_id: by the verdicts of that run (None: by the newest ones); notes_until: orders and repairs as
    they were written then (None: by now)."""

    shelf: Shelf
    together: AsOne = ALONE
    since_ns: int | None = None
    audit_id: int | None = None
    notes_until: datetime | None = None

    @property
    def left_out(self) -> tuple[int, ...]:
        """The ids of loops that are in no list for themselves. One that is worse than when it was shelved is listed all
        the same."""
        return (*self.shelf.left_out, *self.together.left_out)


def listing(backend: Backend, since_ns: int | None = None, audit_id: int | None = None) -> Listing:
    """As it stands, or as it stood for that run."""
    until = None
    if audit_id is not None:
        with backend.database.read() as connection:
            until = notes_until(connection, audit_id)
    shelved = shelf(backend, audit_id, until)
    return Listing(shelved, as_one(backend, shelved, audit_id, since_ns), since_ns, audit_id, until)
