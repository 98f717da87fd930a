"""Loops that oscillate together: found among what the newest verdicts kept of their oscillations."""

from collections.abc import Sequence
from concurrent.futures import Future, wait
from dataclasses import replace

from app.engine.plant_wide.groups import UNNAMED, Group, groups
from app.nanoseconds import NS_PER_S
from app.services.audit_json.swings import candidates
from app.services.backend import Backend
from app.services.found_groups import Groups, State
from app.services.moments import iso_utc, moment_of
from app.services.plant.set_points import set_points_together
from app.services.results import GroupMember, GroupView
from app.storage import verdicts

PATIENCE_S = 0.1
LOOKED_INTO = 20


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


def _state(backend: Backend) -> State:
    with backend.database.read() as connection:
        return verdicts.newest_state(connection)


def _begun(backend: Backend, state: State) -> Future[Groups]:
    return backend.found_groups.of(state, lambda: _worked_out(backend))


def _worked_out(backend: Backend) -> Groups:
    with backend.database.read() as connection:
        rows = verdicts.swings(connection)
    units = {row.tag: row.unit for row in rows}
    found = [_view(number, group, units) for number, group in enumerate(groups(candidates(rows)), 1)]
    return tuple(_asked_of_set_points(backend, found))


def _asked_of_set_points(backend: Backend, found: Sequence[GroupView]) -> list[GroupView]:
    """The groups that nothing within shakes, and not chance either, with whether their set points move together: of the
    first LOOKED_INTO, because samples are read for it."""
    asked = [group.id for group in found if group.source is None and not unnamed(group)][:LOOKED_INTO]
    return [
        replace(group, set_points_together=set_points_together(backend, [member.loop for member in group.members]))
        if group.id in asked
        else group
        for group in found
    ]


def groups_of(found: Groups | None, tag: str) -> list[GroupView]:
    """Those that the loop belongs to; none where they are not known yet."""
    return [group for group in found or () if any(member.loop == tag for member in group.members)]


def told_apart(groups: Sequence[GroupView]) -> tuple[list[GroupView], list[GroupView]]:
    """Groups that something may shake together, and those that may well share their period by chance."""
    return [group for group in groups if not unnamed(group)], [group for group in groups if unnamed(group)]


def surely_together(found: Groups | None) -> list[GroupView]:
    """For a list that has no room to say of a group that it may be chance: without those that the engine tells as such,
    though something may shake them."""
    return [group for group in found or () if not group.by_chance]


def unnamed(group: GroupView) -> bool:
    """Whether no source is named because the loops may well share their period by chance."""
    return group.chance_probability > UNNAMED


def _view(number: int, group: Group, units: dict[str, str | None]) -> GroupView:
    members = [
        GroupMember(
            s.tag, units[s.tag], s.stiction_probability, round(s.score, 3), s.coherence, s.lag_s, _moment(s.onset_s)
        )
        for s in group.suspects
    ]
    return GroupView(
        str(number),
        round(group.period_s, 3),
        group.in_step,
        group.by_chance,
        group.chance_probability,
        group.source,
        members,
    )


def _moment(seconds: float | None) -> str | None:
    return None if seconds is None else iso_utc(moment_of(round(seconds) * NS_PER_S))
