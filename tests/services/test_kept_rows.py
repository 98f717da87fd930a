"""A plant that was laid down is the plant that was made, also for what is written next."""

from sqlalchemy import select

from app.services.backend import Backend
from app.storage.tables import metadata
from tests.conftest import empty_tables
from tests.services.audited_plant import AddLoops, audited
from tests.services.kept_rows import made_once


def rows(backend: Backend) -> dict[str, list[tuple]]:
    with backend.database.read() as connection:
        found = {table.name: connection.execute(select(table)).all() for table in metadata.sorted_tables}
    return {name: sorted(map(tuple, some), key=repr) for name, some in found.items() if some}


def test_the_second_time_its_rows_are_those_of_the_first(backend: Backend, add_loops: AddLoops) -> None:
    def make() -> dict[str, int]:
        return add_loops("A", "B", unit="U1") | {"run": audited(backend)}

    given = made_once(backend, "kept", make)
    kept = dict(given)
    first = rows(backend)
    assert {"loops", "series", "audits", "audit_items", "verdicts", "newest_rows"} <= set(first)
    if not backend.database.is_sqlite:
        empty_tables(backend.settings.database_url)
    given.clear()  # what one test does to it is not told to the next
    assert made_once(backend, "kept", make) == kept
    assert rows(backend) == first
    assert audited(backend) == kept["run"] + 1
