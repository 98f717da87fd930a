"""Loops whose PV came to stand together, in words: when, of which unit, and what to look at before any of them."""

import math

from app.counting import counted
from app.engine.plant_wide.stood_together import StoodTogether
from app.services.telling.naming import NAMED, named

READS_THEM = "what reads them all (I/O card, multiplexer, gateway, the historian's interface)"
LOOK_AT = {True: READS_THEM, False: f"whether their unit is down, then at {READS_THEM}"}
"""Where they came to stand in one scan, and where one after the other."""


def with_others(group: StoodTogether, tag: str) -> str:
    """The reason that one of the group has, as a sentence begins."""
    count = len(group.stands) - 1
    others = [stand.tag for stand in group.stands[: NAMED + 1] if stand.tag != tag]
    return f"PV of {counted(count, 'other loop')} froze {when(group)} ({named(others, count)}): {look(group)}"


def of_all(group: StoodTogether) -> str:
    """What happened, of the whole group, for the one place that tells of it."""
    return f"PV of {len(group.stands):,} loops froze {when(group)}"


def look(group: StoodTogether) -> str:
    return f"look first at {LOOK_AT[group.at_once]}"


def when(group: StoodTogether) -> str:
    """ "within 20 minutes, all of U3"."""
    unit = "" if group.unit is None else f", all of {group.unit}"
    count, at_once = len(group.stands), group.in_one_scan
    if at_once == count:
        return f"in one scan{unit}"
    of_them = f", {at_once:,} of the {count:,} in one scan" if group.at_once else ""
    minutes = math.ceil(group.span_s / 60.0)
    return f"within {'a minute' if minutes <= 1 else f'{minutes} minutes'}{of_them}{unit}"
