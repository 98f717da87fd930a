"""What every service works with: the settings, the database and the queue of one process."""

from dataclasses import dataclass, field
from functools import cached_property

from app.queue import Queue
from app.services.data_folder import NewFolder
from app.services.found_groups import PARTING_S, FoundGroups
from app.services.moments import PlantClock
from app.settings import Settings
from app.storage import Database
from app.storage.row_texts import RowTexts


@dataclass(frozen=True)
class Backend:
    """Opened once a process, after any fork; safe to use from several threads."""

    settings: Settings
    database: Database
    queue: Queue
    row_texts: RowTexts = field(default_factory=RowTexts)
    found_groups: FoundGroups = field(default_factory=FoundGroups)

    @classmethod
    def open(cls, settings: Settings, *, worker: bool = False, looks_only: bool = False) -> "Backend":
        """`worker`: statements may take longer than those of an API. `looks_only`: a data folder that is missing is
        not made."""
        limit_s = settings.worker_statement_timeout_s if worker else settings.statement_timeout_s
        database = Database(settings.resolved_database_url, statement_timeout_s=limit_s, pool_size=settings.pool_size)
        backend = cls(settings, database, Queue(settings))
        if not looks_only:
            backend.new_folder.make()
        return backend

    @cached_property
    def new_folder(self) -> NewFolder:
        return NewFolder(self.settings, self.database)

    @cached_property
    def clock(self) -> PlantClock:
        return PlantClock(self.settings.time_zone)

    def close(self, parting_s: float = PARTING_S) -> None:
        """parting_s: how long a search for groups that goes on is waited for, in seconds."""
        self.found_groups.close(parting_s)
        self.database.close()
        self.queue.close()
