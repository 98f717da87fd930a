"""The plant's loops as they are known: one by its tag, or a list of them."""

from app.errors import NotFoundError
from app.services.backend import Backend
from app.services.cursors import decode, page_of
from app.services.moments import iso_utc, moment_of
from app.services.outward import LoopOut
from app.services.results import Page
from app.storage import loops
from app.storage.loops import SETTABLE, ListFilter, LoopRow

__all__ = ["RETIRED", "ListFilter", "OneLoop", "find", "get_loop", "list_loops", "spelling", "unknown", "view_of"]

RETIRED: dict[str, bool | None] = {"true": True, "false": False, "any": None}
"""Which loops are asked for: those that are retired, those that are not, or both."""

OneLoop = str | LoopRow
"""A loop by its tag, or as it was found: a page asks the database for it once."""


def list_loops(
    backend: Backend,
    limit: int = 100,
    cursor: str | None = None,
    wanted: ListFilter | None = None,
) -> Page[LoopOut]:
    """Loops in the order of their tags; `search` of the filter is a part of the tag, the description or the owner."""
    after = decode(cursor, (str,))
    with backend.database.read() as connection:
        rows = loops.page(connection, limit + 1, after[0] if after else None, wanted)
    return page_of(rows, limit, view_of, lambda row: (row.tag,))


def get_loop(backend: Backend, tag: str) -> LoopOut:
    return view_of(find(backend, tag))


def find(backend: Backend, loop: OneLoop) -> LoopRow:
    """Raises NotFoundError for a tag that no loop has."""
    if isinstance(loop, LoopRow):
        return loop
    with backend.database.read() as connection:
        row = loops.by_tag(connection, loop)
    if row is None:
        raise unknown(loop)
    return row


def spelling(backend: Backend, tag: str) -> str | None:
    """The tag as its loop has it, which may be spelled in other letters, great or small; None: there is no such loop,
    or several are meant."""
    with backend.database.read() as connection:
        return loops.as_spelled(connection, [tag]).get(tag)


def unknown(tag: str) -> NotFoundError:
    return NotFoundError("unknown_loop", f"there is no loop {tag!r}")


def view_of(row: LoopRow) -> LoopOut:
    own = {name: getattr(row, name) for name in ("tag", *SETTABLE)}
    return LoopOut(**own, samples_to=None if row.newest_ns is None else iso_utc(moment_of(row.newest_ns)))
