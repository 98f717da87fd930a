"""Loops that oscillate together: found among what the newest verdicts kept of their oscillations."""

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass, replace
from typing import Any

from app.engine.plant_wide.groups import UNNAMED, Group, groups, may_be_shaken
from app.nanoseconds import NS_PER_S
from app.services.audit_json.swings import candidates
from app.services.backend import Backend
from app.services.found_groups import Groups, State
from app.services.moments import iso_utc, moment_of
from app.services.outward import EVEN, GroupMemberOut, GroupOut
from app.services.plant.set_points import set_points_together
from app.services.telling.wording import sticks_for_sure
from app.storage import verdicts
from app.storage.verdicts import SwingRow

PATIENCE_S = 0.1
LOOKED_INTO = 20


@dataclass(frozen=True)
class Shown:
    """groups: None where none are known yet. before: as of when they are (ISO 8601, UTC), while newer ones are being
    worked out; None: these are the newest."""

    groups: Groups | None
    before: str | None = None


def plant_groups(backend: Backend) -> Groups:
    """Groups in step first, the larger ones first; samples are read of few loops, and once."""
    return _begun(backend, _state(backend)).result()


def soon(backend: Backend, wait_s: float = PATIENCE_S) -> Groups | None:
    """The groups if they are known within `wait_s`; None while a large plant's are still being worked out, or those of
    a state that has passed: while a run goes on each page would find another one."""
    state = _state(backend)
    if backend.found_groups.only_others_sought(state):
        return None
    finding = _begun(backend, state)
    wait((finding,), wait_s)
    return finding.result() if finding.done() else None


def shown(backend: Backend) -> Shown:
    """What a page shows, which cannot wait: those that were found before where the newest are not known soon."""
    found = soon(backend)
    last = backend.found_groups.last if found is None else None
    return Shown(found) if last is None else Shown(last.groups, iso_utc(last.at))


def _state(backend: Backend) -> State:
    with backend.database.read() as connection:
        return verdicts.newest_state(connection)


def _begun(backend: Backend, state: State) -> Future[Groups]:
    return backend.found_groups.of(state, lambda: _worked_out(backend))


def _worked_out(backend: Backend) -> Groups:
    with backend.database.read() as connection:
        rows = verdicts.swings(connection)
    by_tag = {row.tag: row for row in rows}
    found = [_view(number, group, by_tag) for number, group in enumerate(groups(candidates(rows)), 1)]
    return tuple(_asked_of_set_points(backend, found))


def _asked_of_set_points(backend: Backend, found: Sequence[GroupOut]) -> list[GroupOut]:
    """The groups that nothing within shakes, and not chance either, with whether their set points move together: of the
    first LOOKED_INTO, because samples are read for it."""
    asked = [group.id for group in found if group.source is None and not unnamed(group)][:LOOKED_INTO]
    return [
        replace(group, set_points_together=set_points_together(backend, [member.loop for member in group.members]))
        if group.id in asked
        else group
        for group in found
    ]


def groups_of(found: Groups | None, tag: str) -> list[GroupOut]:
    """Those that the loop belongs to; none where they are not known yet."""
    return [group for group in found or () if any(member.loop == tag for member in group.members)]


def shaken_by(groups: Sequence[GroupOut], row: Mapping[str, Any]) -> str | None:
    """The source that may be what shakes a loop, of the groups that it belongs to. None where its own record tells
    reliably that its valve sticks: nobody is then sent elsewhere first."""
    if sticks_for_sure(row):
        return None
    for group in groups:
        own = next((member for member in group.members if member.loop == row["loop"]), None)
        if own is None or not group.in_step or group.source in (None, own.loop):
            continue
        if may_be_shaken(own.coherence, (own.stiction_probability or 0.0) > EVEN):
            return group.source
    return None


def told_apart(groups: Sequence[GroupOut]) -> tuple[list[GroupOut], list[GroupOut]]:
    """Groups that something may shake together, and those that may well share their period by chance."""
    return [group for group in groups if not unnamed(group)], [group for group in groups if unnamed(group)]


def surely_together(found: Groups | None) -> list[GroupOut]:
    """For a list that has no room to say of a group that it may be chance: without those that the engine tells as such,
    though something may shake them."""
    return [group for group in found or () if not group.by_chance]


def unnamed(group: GroupOut) -> bool:
    """Whether no source is named because the loops may well share their period by chance."""
    return group.chance_probability > UNNAMED


def _view(number: int, group: Group, rows: Mapping[str, SwingRow]) -> GroupOut:
    members = [
        GroupMemberOut(
            s.tag,
            rows[s.tag].unit,
            s.stiction_probability,
            round(s.score, 3),
            s.coherence,
            s.lag_s,
            _moment(s.onset_s),
            measured=not rows[s.tag].unanswered,
        )
        for s in group.suspects
    ]
    return GroupOut(
        id=str(number),
        period_s=round(group.period_s, 3),
        in_step=group.in_step,
        by_chance=group.by_chance,
        chance_probability=group.chance_probability,
        source=group.source,
        members=members,
    )


def _moment(seconds: float | None) -> str | None:
    return None if seconds is None else iso_utc(moment_of(round(seconds) * NS_PER_S))
