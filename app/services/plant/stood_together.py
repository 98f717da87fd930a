"""Loops whose PV came to stand together, as lists tell of them: once, by the weightiest of those that are listed."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace

from app.engine.plant_wide.stood_together import SHUT_DOWN_S, Stand, StoodTogether
from app.services.backend import Backend
from app.services.moments import seconds_of
from app.services.stating.shelving import Shelf
from app.services.telling.reasons import SINCE, TOGETHER_SINCE, extra_in
from app.services.telling.standing_wording import look, of_all
from app.services.telling.wording import STOOD_TOGETHER
from app.storage import unanswered as stored
from app.storage.unanswered import StoodRow


@dataclass(frozen=True)
class Together:
    """Loops that are told of as one, the weightiest first, which speaks for all. unit: None where they are of several.
    since: when the first of them came to stand (ISO 8601, UTC); words: what happened; look: what to look at first."""

    loops: tuple[str, ...]
    unit: str | None
    since: str
    words: str
    look: str

    @property
    def others(self) -> tuple[str, ...]:
        return self.loops[1:]


@dataclass(frozen=True)
class AsOne:
    """by_tag: those that are told of as one, by the tag of the loop that speaks for them. ids: of all of them, by
    tag."""

    by_tag: Mapping[str, Together]
    ids: Mapping[str, int] = field(default_factory=dict)

    @property
    def others(self) -> frozenset[str]:
        """The tags of those that are in no list for themselves."""
        return frozenset(tag for one in self.by_tag.values() for tag in one.others)

    @property
    def left_out(self) -> tuple[int, ...]:
        """Their ids."""
        return tuple(self.ids[tag] for one in self.by_tag.values() for tag in one.others)

    def among(self, tags: Container[str]) -> "AsOne":
        """In a list that has only these loops: of each group the weightiest of them speaks, if for itself alone."""
        listed = [tuple(tag for tag in one.loops if tag in tags) for one in self.by_tag.values()]
        groups = zip(self.by_tag.values(), listed, strict=True)
        return AsOne({some[0]: replace(one, loops=some) for one, some in groups if some}, self.ids)

    def of(self, tag: str) -> Together | None:
        """Those that this loop is one of."""
        return next((one for one in self.by_tag.values() if tag in one.loops), None)


ALONE = AsOne({})
"""No two loops came to stand together."""


def as_one(
    backend: Backend, shelved: Shelf | None = None, audit_id: int | None = None, since_ns: int | None = None
) -> AsOne:
    """By the newest verdicts, or those of a run. What is left out of lists for being shelved (None: nothing is) is not
    among those that are told of as one; since_ns: loops with a sample as new as that and those without one, which are
    listed apart, are not either."""
    with backend.database.read() as connection:
        rows = stored.stood_together(connection, STOOD_TOGETHER, audit_id)
    left_out = frozenset(() if shelved is None else shelved.left_out)
    groups = _listed_alike([row for row in rows if row.id not in left_out], since_ns)
    ids = {row.tag: row.id for group in groups for row in group}
    return AsOne({group[0].tag: _told(group) for group in groups}, ids)


def _listed_alike(rows: Sequence[StoodRow], since_ns: int | None) -> list[list[StoodRow]]:
    """Those of one group that are listed in one place, in the order of the rows."""
    parts: dict[tuple[bool, float], list[StoodRow]] = {}
    for row in rows:
        old = since_ns is not None and (row.end_ns is None or row.end_ns < since_ns)
        parts.setdefault((old, seconds_of(_field(row, TOGETHER_SINCE))), []).append(row)
    groups: list[list[StoodRow]] = []
    of_old = None
    for (old, since_s), part in sorted(parts.items(), key=lambda item: item[0]):
        if old == of_old and _goes_on(groups[-1], part, since_s):
            groups[-1] += part
        else:
            groups.append(list(part))
        of_old = old
    place = {row.id: at for at, row in enumerate(rows)}
    ordered = (sorted(group, key=lambda row: place[row.id]) for group in groups if len(group) > 1)
    return sorted(ordered, key=lambda group: place[group[0].id])


def _goes_on(group: Sequence[StoodRow], part: Sequence[StoodRow], since_s: float) -> bool:
    """Whether a later part is of the group. What runs told of one group may differ in when it began: the loop that came
    to stand first may have been audited later, or be at work by then. What one run told apart stays apart."""
    began_s = min(seconds_of(_field(row, TOGETHER_SINCE)) for row in group)
    last_s = max(seconds_of(_field(row, SINCE)) for row in group)
    apart = {row.audit_id for row in group} & {row.audit_id for row in part}
    return not apart and since_s <= max(began_s + SHUT_DOWN_S, last_s)


def _told(rows: Sequence[StoodRow]) -> Together:
    in_time = sorted((_stand(row) for row in rows), key=lambda stand: (stand.since_s, stand.tag))
    group = StoodTogether(tuple(in_time))
    since = min((_field(row, TOGETHER_SINCE) for row in rows), key=seconds_of)
    return Together(tuple(row.tag for row in rows), group.unit, since, of_all(group), look(group))


def _stand(row: StoodRow) -> Stand:
    return Stand(row.tag, seconds_of(_field(row, SINCE)), 0.0, row.sampling_interval_s, row.unit)


def _field(row: StoodRow, name: str) -> str:
    value: str = extra_in(row.extra_json)[name]
    return value
