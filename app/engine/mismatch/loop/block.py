"""A piece of physics: where it sits in the loop, its parameters, and what it does to the signal that passes it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.engine.mismatch.loop.experiment import Experiment
from app.engine.mismatch.loop.plant import Plant
from app.engine.recording import BoolArray, FloatArray

Place = Literal["valve", "process", "sensor", "disturbance"]
Stage = Literal["valve", "input", "load", "process", "output", "sensor"]
STAGES: tuple[Stage, ...] = ("valve", "input", "load", "process", "output", "sensor")


@dataclass(frozen=True)
class Parameter:
    """A parameter of a block: bounds and scale in its unit.

    log: fitted as a logarithm (positive quantities without a natural zero). linear: the simulation is nearly linear in
    it, so that a scan finds it by least squares from the size `scale`. deviation: of a normal prior around `scale` (of
    its logarithm where log); infinite: none.
    begins: it is where a state stood when the record began, so that another record has its own.
    step: over what a slope is taken, of its logarithm where log, of its scale otherwise; the simulation moves evenly
    with it, however rough the block is. None: as the block is rough or not.
    """

    name: str
    unit: str
    low: float
    high: float
    scale: float = 1.0
    log: bool = False
    linear: bool = False
    deviation: float = np.inf
    begins: bool = False
    step: float | None = None


@dataclass(frozen=True, eq=False)
class Context:
    """What a block may look at: the record and the linear plant.

    Never PV as a signal: a block is driven by OP and measured signals.
    """

    record: Experiment
    plant: Plant

    @property
    def time_s(self) -> FloatArray:
        return self.record.time_s


@dataclass(frozen=True, eq=False)
class Block:
    """One form of one effect.

    code: its name in explanations. form: which of its forms. stage: where it acts on the signal. A load enters the
    process beside what the valve lets through; its context holds the plant as the parts of the process altered it.
    parameters: of a context, with bounds that fit the record. starts: rows of parameters to begin the search at.
    apply: (signal (N,) as deviation, values, context) -> signal (N,), for every stage but `process`.
    alter: (plant, values, context) -> plant, for the stage `process`.
    active: (signal before the block (N,), values, context) -> mask (N,) where it acts; None: always.
    penalty: log-likelihood it must gain before it is believed, from clean simulations. rough: the simulation jumps
    with the parameters.
    sensible: whether values, fitted, still are what the code says; None: always. strict: a scan counts no others, which
    would stand where a block belongs that says what it finds. abrupt: shows in a few samples only, as a jump does.
    sum_of: (points (M, P), context) -> what it does at these points, as sums of what others do; None: as none.
    affine: what leaves it answers a sum with the sum of the answers, beside what is there anyway. Of blocks that alter
    the plant alone the plant tells.
    replaces: (signal, plant, values, context) -> PV (N,): the whole process, for a vessel that no altered plant
    describes.
    suits: whether the block can be asked of this plant at all. brings: further codes that it stands for. steps: of a
    descent.
    frees_gain: what it does cannot be told from another gain, so that the given gain says little. distant: a loop with
    it is far from any linear one, so that scans beside a linear fit mislead.
    """

    code: str
    place: Place
    stage: Stage
    condition: str
    parameters: Callable[[Context], tuple[Parameter, ...]]
    starts: Callable[[Context, FloatArray], FloatArray]
    apply: Callable[[FloatArray, FloatArray, Context], FloatArray] | None = None
    alter: Callable[[Plant, FloatArray, Context], Plant] | None = None
    active: Callable[[FloatArray, FloatArray, Context], BoolArray] | None = None
    form: str = ""
    penalty: float = 10.0
    rough: bool = False
    frees_gain: bool = False
    finalists: int = 2
    sensible: Callable[[FloatArray, Context], bool] | None = None
    abrupt: bool = False
    replaces: Callable[[FloatArray, Plant, FloatArray, Context], FloatArray] | None = None
    suits: Callable[[Context], bool] | None = None
    brings: tuple[str, ...] = ()
    steps: int = 6
    distant: bool = False
    sum_of: "Callable[[FloatArray, Context], Sum] | None" = None
    affine: bool = False
    strict: bool = False

    @property
    def name(self) -> str:
        return f"{self.code}/{self.form}" if self.form else self.code


@dataclass(frozen=True, eq=False)
class Part:
    """A block with its parameters' values (P,)."""

    block: Block
    values: FloatArray

    def makes_sense(self, context: Context) -> bool:
        """Whether its values still are what its code says."""
        return self.block.sensible is None or self.block.sensible(self.values, context)


@dataclass(frozen=True, eq=False)
class Sum:
    """What a block does at some points (M), as sums of what others do at the same stage: a pulse is a jump less a later
    one.

    pieces: those others (K), each with as many linear parameters as the block has, and all of these at zero. weights:
    (M, K) how much of each piece is in each point.
    """

    pieces: tuple[Part, ...]
    weights: FloatArray


def values_in(part: Part, context: Context) -> FloatArray:
    """The values (P,) of a part that was fitted in another context, as its block takes them in this one: an overflow
    has one number more beside an integrator than beside a lag. Those it lacks are 0, those it has too many are left
    out.
    """
    count = len(part.block.parameters(context))
    return np.concatenate((part.values[:count], np.zeros(max(count - len(part.values), 0))))


def grid(*axes: FloatArray) -> FloatArray:
    """All combinations of the axes' values, one a row."""
    return np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")], axis=1)


def no_scan(_: Context, __: FloatArray) -> FloatArray:
    """No starting points: of a block that is found by its pattern in PV, and by no scan."""
    return np.zeros((0, 1))
