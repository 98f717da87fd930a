"""How every process of the service starts, before it serves, works or keeps the schedule."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.settings import Settings


@contextmanager
def ready_to_work(settings: "Settings", until_parent_ends: bool, *, migrates: bool = False) -> Iterator[None]:
    """Known to who would restore a backup, on tables of this version; migrates: which it makes of older ones."""
    from app import logs
    from app.services.data_folder import tell_if_away
    from app.services.upkeep import presence
    from app.services.upkeep.tables import migrate, refuse_missing, refuse_unmigrated

    logs.configure(settings)
    if until_parent_ends:
        from app.cli.supervisor import stop_with_parent

        stop_with_parent()
    if not migrates:
        refuse_missing(settings)  # first: being at work makes a data folder that is new
    with presence.at_work(settings):
        if migrates:
            migrate(settings)
        else:
            refuse_unmigrated(settings)
        tell_if_away(settings)
        yield
