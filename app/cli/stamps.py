"""`--time-zone ZONE`, `--date-order auto|day|month`: how a file's stamps were written where they do not tell it."""

import time
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from app.ingest import IngestOptions


class DateOrder(StrEnum):
    """What stands first in dates such as 03/04/2026; auto: what the file makes likely."""

    auto = "auto"
    day = "day"
    month = "month"


TimeZoneOption = Annotated[
    str,
    typer.Option("--time-zone", envvar="LOOPAUDIT_TIME_ZONE", help="Zone of time stamps that name none (IANA)."),
]
DateOrderOption = Annotated[
    DateOrder,
    typer.Option(
        "--date-order",
        envvar="LOOPAUDIT_DATE_ORDER",
        help="What stands first in dates such as 03/04/2026, where the file leaves it open.",
    ),
]


def read_in(time_zone: str, date_order: DateOrder = DateOrder.auto) -> "IngestOptions":
    """How files are read then, now. Raises DataError("unknown_time_zone") before any of them is opened."""
    from app.ingest import IngestOptions, check_time_zone

    check_time_zone(time_zone)
    day_first = None if date_order is DateOrder.auto else date_order is DateOrder.day
    return IngestOptions(time_zone=time_zone, day_first=day_first, now_ns=time.time_ns())
