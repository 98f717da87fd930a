"""The database, opened for a command."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from app.cli.configuration import load_settings
from app.cli.messages import say

if TYPE_CHECKING:
    from app.services.backend import Backend
    from app.settings import Settings


@contextmanager
def opened(
    settings: "Settings | None" = None, *, new: bool = False, migrates: bool | None = None
) -> "Iterator[Backend]":
    """The database of the settings (without them, of this process's); it is made, and that said, where it may be
    `new`. migrates: whether it is brought to this version's tables; None: where it is the embedded one. Where it is
    not, RequestError("no_tables") or ("older_tables") asks for `loopaudit migrate`; ("database_away") where it is away.
    """
    from app.services.backend import Backend
    from app.services.database_errors import away_in_words
    from app.services.upkeep.tables import migrate, refuse_missing, refuse_other_tables

    settings = settings or load_settings()
    makes = migrates if migrates is not None else not settings.database_url
    if not new:
        refuse_missing(settings)
    elif makes:
        tell_missing(settings)
    if makes:
        migrate(settings)
    backend = Backend.open(settings)
    try:
        with away_in_words():
            refuse_other_tables(backend.database)
            yield backend
    finally:
        backend.close(parting_s=0.0)  # what the command did not wait for it does not wait for at its end


def tell_missing(settings: "Settings") -> None:
    """Where the settings of the service were forgotten, what is made in another folder is of no use to it. Raises
    RequestError("not_mounted")."""
    from app.services.upkeep.tables import database_files, refuse_unmounted

    refuse_unmounted(settings)
    for file in database_files(settings):
        if not file.is_file():
            where = file.parent.absolute()
            say(f"loopaudit: there is no database in {where} yet: a new one is made there (LOOPAUDIT_DATA_DIR)")
