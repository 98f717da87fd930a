"""`--time-zone ZONE`: in which zone a file's stamps were written that name none."""

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from app.ingest import IngestOptions

TimeZoneOption = Annotated[str, typer.Option("--time-zone", help="Zone of time stamps that name none (IANA).")]


def read_in(time_zone: str) -> "IngestOptions":
    """How files are read then. Raises DataError("unknown_time_zone") before any of them is opened."""
    from app.ingest import IngestOptions, check_time_zone

    check_time_zone(time_zone)
    return IngestOptions(time_zone=time_zone)
