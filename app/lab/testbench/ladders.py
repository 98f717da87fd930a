"""The factors of the bench, each a ladder of levels from harmless to hopeless."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from app.lab.testbench.case import HEALTHY, LEVELS, Case, Cause, ordinary, wide

WIDE = "everything at once"


@dataclass(frozen=True)
class Level:
    """One level of a factor: its label and the fields of a case that it sets."""

    label: str
    sets: tuple[tuple[str, Any], ...]


@dataclass(frozen=True)
class Ladder:
    """One factor. healthy: whether it is tried on healthy loops too, and not on sticky ones only."""

    name: str
    levels: tuple[Level, ...]
    healthy: bool = True


@dataclass(frozen=True)
class Planned:
    """A case and the place in the tables that it is for."""

    factor: str
    level: str
    case: Case


@dataclass(frozen=True)
class Design:
    """How many loops there are: `sticky` and `healthy` on each level of each ladder, `wide` of each kind at once."""

    sticky: int = 8
    healthy: int = 8
    wide: int = 100
    seed: int = 1


def _numbers(name: str, field: str, values: tuple[float, ...], text: str = "{:g}", healthy: bool = True) -> Ladder:
    return Ladder(name, tuple(Level(text.format(value), ((field, value),)) for value in values), healthy)


def _names(name: str, field: str, values: tuple[str, ...], healthy: bool = True) -> Ladder:
    return Ladder(name, tuple(Level(value.replace("_", " "), ((field, value),)) for value in values), healthy)


def _controllers() -> Ladder:
    levels = [Level(f"{kind} on flow", (("controller", kind), ("plant", "first_order"))) for kind in ("PI", "PID")]
    levels += [Level(f"{kind} on level", (("controller", kind), ("plant", "level"))) for kind in ("P", "PI", "PID")]
    return Ladder("controller", tuple(levels))


def _level_gains() -> Ladder:
    gains = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9)
    levels = tuple(Level(f"{gain:g}", (("plant", "level"), ("tightness", gain))) for gain in gains)
    return Ladder("controller gain on a level, of the ultimate gain", levels)


def _recorders() -> Ladder:
    levels = [Level("none", (("recorder", "none"),))]
    for kind, text in (("swinging_door", "swinging door"), ("exception", "exception")):
        for share in (0.05, 0.2, 0.5, 1.0):
            levels.append(Level(f"{text} {share:g}", (("recorder", kind), ("recorder_share", share))))
    return Ladder("historian compression, of PV's and OP's movement", tuple(levels))


def _loads() -> Ladder:
    levels = [Level("none", (("load_share", 0.0),))]
    for kind in ("coloured", "sine", "steps"):
        for share in (0.3, 1.0, 3.0):
            levels.append(Level(f"{kind} {share:g}", (("load", kind), ("load_share", share))))
    return Ladder("load disturbance, of S", tuple(levels), healthy=False)


LADDERS: tuple[Ladder, ...] = (
    _names("plant", "plant",
           ("fast_flow", "first_order", "second_order", "dead_time", "underdamped", "level", "lagging_level")),
    _controllers(),
    _numbers("controller gain, of the ultimate gain", "tightness", (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9)),
    _level_gains(),
    _numbers("noise, of PV's movement", "noise_share", (0.0, 0.05, 0.1, 0.2, 0.35, 0.5, 1.0)),
    _numbers("S, % of span", "size_pct", (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0), healthy=False),
    _numbers("J / S", "J_ratio", (0.0, 0.1, 0.25, 0.5, 0.75, 1.0, 1.5), healthy=False),
    _names("valve model", "valve", ("he", "choudhury", "kano", "one_parameter", "physical"), healthy=False),
    _numbers("samples a cycle", "points_per_cycle", (5.0, 8.0, 12.0, 25.0, 60.0, 150.0, 500.0)),
    _numbers("cycles in the record", "cycles", (3.0, 5.0, 8.0, 15.0, 30.0, 60.0)),
    _recorders(),
    _loads(),
    _numbers("resolution of PV, of its movement", "resolution_share", (0.0, 0.05, 0.2, 0.5, 1.0, 2.0)),
    _names("set point", "set_point", ("constant", "few_steps", "many_steps", "ramp", "sine")),
)  # fmt: skip


def plan(design: Design) -> Iterator[Planned]:
    """All cases of a design. The loops of one ladder are the same on each of its levels but for the factor."""
    for k, ladder in enumerate(LADDERS):
        for sticky, count in ((True, design.sticky), (False, design.healthy if ladder.healthy else 0)):
            for repeat in range(count):
                case = ordinary(_rng(design, k, sticky, repeat), _cause(sticky, repeat, k))
                yield from (Planned(ladder.name, level.label, _on(case, level)) for level in ladder.levels)
    for j, cause in enumerate(HEALTHY):
        for repeat in range(design.sticky):
            rng = _rng(design, len(LADDERS) + j, False, repeat)
            yield Planned("what moves a healthy loop", cause.replace("_", " "), ordinary(rng, cause))
    for repeat in range(design.wide):
        for sticky in (True, False):
            rng = _rng(design, 99, sticky, repeat)
            yield Planned(WIDE, "sticky" if sticky else "healthy", wide(rng, _cause(sticky, repeat, 0)))


def _on(case: Case, level: Level) -> Case:
    moved = replace(case, **dict(level.sets))
    # A valve that sticks under P control of a plant without integral comes to rest; there is nothing to see.
    if moved.controller == "P" and moved.plant not in LEVELS:
        return replace(moved, controller="PI")
    return moved


def _cause(sticky: bool, repeat: int, shift: int) -> Cause:
    return "stiction" if sticky else HEALTHY[(repeat + shift) % len(HEALTHY)]


def _rng(design: Design, ladder: int, sticky: bool, repeat: int) -> np.random.Generator:
    return np.random.default_rng([design.seed, ladder, int(sticky), repeat])
