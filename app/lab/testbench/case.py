"""One case of the bench: every factor of a simulated loop, and how ordinary and wide cases are drawn."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

PlantKind = Literal["fast_flow", "first_order", "second_order", "dead_time", "underdamped", "level", "lagging_level"]
ControllerKind = Literal["P", "PI", "PID"]
ValveKind = Literal["he", "choudhury", "kano", "one_parameter", "physical"]
LoadKind = Literal["coloured", "sine", "steps"]
SetPointKind = Literal["constant", "few_steps", "many_steps", "sine", "ramp"]
Recorder = Literal["none", "exception", "swinging_door"]
Cause = Literal["stiction", "quiet", "coloured", "sine", "steps", "tight", "set_point", "saturated", "quantised"]

PLANTS: tuple[PlantKind, ...] = (
    "fast_flow", "first_order", "second_order", "dead_time", "underdamped", "level", "lagging_level",
)  # fmt: skip
LEVELS: frozenset[PlantKind] = frozenset({"level", "lagging_level"})
HEALTHY: tuple[Cause, ...] = (
    "quiet", "coloured", "sine", "steps", "tight", "set_point", "saturated", "quantised",
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A loop of known truth, free of units of time and of PV.

    cause: what moves the loop; "stiction" is a sticky valve, all others are healthy.
    size_pct: S of a sticky valve, size of what moves a healthy loop, in per cent of the span of OP. J_ratio: J / S.
    tightness: controller gain as a share of the gain at which the loop would be at the limit of stability.
    noise_share, resolution_share, recorder_share: standard deviation of the measurement noise, resolution of PV and
    deviation band of the historian, each as a share of the standard deviation of the loop's own movement.
    load_share: size of the load's disturbance as a share of size_pct.
    points_per_cycle, cycles: of the oscillation that the loop has without noise.
    """

    cause: Cause
    plant: PlantKind
    controller: ControllerKind
    tightness: float
    size_pct: float
    J_ratio: float
    valve: ValveKind
    noise_share: float
    points_per_cycle: float
    cycles: float
    load: LoadKind
    load_share: float
    set_point: SetPointKind
    resolution_share: float
    recorder: Recorder
    recorder_share: float
    seed: int

    @property
    def sticky(self) -> bool:
        return self.cause == "stiction"


def ordinary(rng: np.random.Generator, cause: Cause) -> Case:
    """A case with nothing extreme about it: what a detector should get right.

    A self-regulating plant: what happens on levels, another story, must not colour the tables of the other factors.
    """
    return Case(
        cause=cause,
        plant=_one_of(rng, ("first_order", "second_order", "dead_time")),
        controller="PI",
        tightness=_uniform(rng, 0.15, 0.5),
        size_pct=log_uniform(rng, 2.0, 10.0),
        J_ratio=_uniform(rng, 0.1, 1.0),
        valve="he",
        noise_share=log_uniform(rng, 0.01, 0.12),
        points_per_cycle=log_uniform(rng, 20.0, 120.0),
        cycles=_uniform(rng, 12.0, 25.0),
        load="coloured",
        load_share=_uniform(rng, 0.02, 0.15),
        set_point="constant",
        resolution_share=0.0,
        recorder="none",
        recorder_share=0.0,
        seed=int(rng.integers(2**31)),
    )


def wide(rng: np.random.Generator, cause: Cause) -> Case:
    """A case with every factor drawn over its whole range at once."""
    return Case(
        cause=cause,
        plant=_one_of(rng, PLANTS),
        controller=_one_of(rng, ("P", "PI", "PI", "PI", "PID")),
        tightness=_uniform(rng, 0.05, 0.9),
        size_pct=log_uniform(rng, 0.5, 30.0),
        J_ratio=_one_of(rng, (0.0, 0.1, 0.3, 0.6, 1.0, 1.3)),
        valve=_one_of(rng, ("he", "he", "choudhury", "kano", "one_parameter", "physical")),
        noise_share=_one_of(rng, (0.0, 0.05, 0.2, 0.5, 1.0)),
        points_per_cycle=log_uniform(rng, 5.0, 500.0),
        cycles=log_uniform(rng, 4.0, 50.0),
        load=_one_of(rng, ("coloured", "sine", "steps")),
        load_share=log_uniform(rng, 0.02, 1.0),
        set_point=_one_of(rng, ("constant", "constant", "constant", "few_steps", "many_steps", "sine")),
        resolution_share=_one_of(rng, (0.0, 0.0, 0.05, 0.3)),
        recorder=_one_of(rng, ("none", "none", "exception", "swinging_door")),
        recorder_share=log_uniform(rng, 0.05, 1.0),
        seed=int(rng.integers(2**31)),
    )


def _one_of(rng: np.random.Generator, choices: tuple[Any, ...]) -> Any:
    return choices[int(rng.integers(len(choices)))]


def _uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is evenly spread; of plain numbers, because NumPy's exp hangs on the processor."""
    return low * float((high / low) ** rng.random())
