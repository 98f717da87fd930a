"""Loops that oscillate together: found among what the newest verdicts kept of their oscillations."""

import threading
from collections.abc import Sequence
from typing import Any

from app.engine.plant_wide import IN_STEP, UNNAMED, Group, groups
from app.services.auditing.swings import candidates
from app.services.backend import Backend
from app.services.moments import iso_utc, moment_of
from app.services.results import GroupMember, GroupView
from app.storage import verdicts

# Found once for a state of the verdicts: who asks again, for a page or a dashboard, gets the same answer at once.
_found: dict[tuple[Any, ...], tuple[GroupView, ...]] = {}
_finding = threading.Lock()
IN_STEP_FROM = IN_STEP
KEPT = 8
PATIENCE_S = 0.1


def plant_groups(backend: Backend) -> tuple[GroupView, ...]:
    """Groups in step first, the larger ones first; no samples are read."""
    with backend.database.read() as connection:
        state = (str(backend.database.url), *verdicts.newest_state(connection))
        known = _found.get(state)
        if known is not None:
            return known
        rows = verdicts.swings(connection)
    with _finding:
        if state not in _found:
            units = {row.tag: row.unit for row in rows}
            while len(_found) >= KEPT:
                _found.pop(next(iter(_found)))
            _found[state] = tuple(
                _view(number, found, units) for number, found in enumerate(groups(candidates(rows)), 1)
            )
        return _found[state]


def soon(backend: Backend, wait_s: float = PATIENCE_S) -> tuple[GroupView, ...] | None:
    """The groups if they are known within `wait_s`; None while a large plant's are still being worked out."""
    looking = threading.Thread(target=plant_groups, args=(backend,), name="groups", daemon=True)
    looking.start()
    looking.join(wait_s)
    return None if looking.is_alive() else plant_groups(backend)


def groups_of(backend: Backend, tag: str) -> list[GroupView]:
    """Those that the loop belongs to, as far as they are known by now."""
    return [group for group in soon(backend) or () if any(member.loop == tag for member in group.members)]


def told_apart(groups: Sequence[GroupView]) -> tuple[list[GroupView], list[GroupView]]:
    """Groups that something may shake together, and those that may well share their period by chance."""
    return [group for group in groups if not unnamed(group)], [group for group in groups if unnamed(group)]


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
    return None if seconds is None else iso_utc(moment_of(round(seconds) * 1_000_000_000))
