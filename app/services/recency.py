"""When a record is an old one: of what it was given, a run decides that for good."""

from datetime import datetime, timedelta

from app.services.moments import FIRST_DATED, ns_of, span_ns
from app.storage.set_apart import OldFrom

LATE = timedelta(days=2)
"""Exports come once a day: what has not come for two days is missing."""

OF_THE_PAST = timedelta(days=30)
"""A plant whose newest sample is as old is a collection of records, not a plant at work."""

DATED_NS = ns_of(FIRST_DATED)
OLD_FROM = OldFrom(span_ns(LATE), span_ns(OF_THE_PAST), DATED_NS)


def of_old_record(end_ns: int | None, newest_ns: int | None, begun: datetime) -> bool:
    """Whether a record that ends at `end_ns` was behind the others when its run was `begun`, of whose plant the newest
    sample was at `newest_ns`: what is said of it is of then. How old a record without a date is, is not known. None was
    where all of them were of the past: then nobody asks the plant about today."""
    if end_ns is None or newest_ns is None or newest_ns < ns_of(begun - OF_THE_PAST):
        return False
    return DATED_NS <= end_ns < newest_ns - span_ns(LATE)
