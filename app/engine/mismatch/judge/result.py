"""What an explanation says, as frozen results."""

from dataclasses import dataclass
from typing import Literal

from app.engine.evidence import Reason
from app.engine.mismatch.fit.closed_loop import ClosedLoop
from app.engine.mismatch.fit.windows import Window
from app.engine.mismatch.judge.holdout import FitMeasures
from app.engine.recording import BoolArray, FloatArray

Verdict = Literal["missing_physics", "consistent", "inconclusive"]


@dataclass(frozen=True)
class Estimate:
    """A parameter with its 95 % interval, in its unit."""

    name: str
    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Effect:
    """A piece of physics that the simulation lacks. gain: log-likelihood (nat) it adds."""

    code: str
    alternatives: tuple[str, ...]
    probability: float
    place: str
    parameters: tuple[Estimate, ...]
    windows: tuple[Window, ...]
    condition: str
    evidence: tuple[Reason, ...]
    gain: float


@dataclass(frozen=True)
class Location:
    """Where recording and simulation differ. frequency_hz is None unless it is at one frequency."""

    block: str | None
    windows: tuple[Window, ...]
    condition: str
    frequency_hz: float | None
    evidence: tuple[Reason, ...] = ()


NOWHERE = Location(None, (), "nowhere", None)


@dataclass(frozen=True, eq=False)
class Traces:
    """Whole-record signals (N,), in the unit of PV: recording and the three simulations; held_out marks what no fit
    has seen.
    """

    time_s: FloatArray
    pv: FloatArray
    given: FloatArray | None
    refitted: FloatArray
    explained: FloatArray
    held_out: BoolArray


@dataclass(frozen=True)
class Improvement:
    """Free-run fitness before and after on the held-out stretch; given is None where no simulation was given."""

    given: FitMeasures | None
    refitted: FitMeasures
    explained: FitMeasures
    held_out: tuple[Window, ...]


@dataclass(frozen=True)
class PartModel:
    """A part of the explained model: its block's name and values."""

    name: str
    code: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class ExplainedModel:
    """Enough to simulate again: the linear plant, the parts, and the means and spans that deviations are taken from.

    It is the model whose free run the held-out figures and the trace are of. rest: (N,) unit of PV, what a given
    simulation held beside a linear model; empty where it was linear. duration_s: of its record, in s, over which sizes
    of what grows are told; None: as long as the one it is simulated along. measured_mids: the means of the signals
    `measured`, one each; empty: those of the record it is simulated along. op_follows_pv: whether a controller set OP
    from PV in its record, so that unnamed terms answer a sample later.
    """

    sampling_interval_s: float
    op_mid: float
    pv_mid: float
    op_span: float
    pv_span: float
    plant: tuple[tuple[str, float], ...]
    parts: tuple[PartModel, ...]
    measured: tuple[str, ...]
    rest: tuple[float, ...] = ()
    duration_s: float | None = None
    measured_mids: tuple[float, ...] = ()
    op_follows_pv: bool = True


@dataclass(frozen=True, eq=False)
class Explanation:
    """The answer: verdict, effects (strongest first), where, how much better, the model."""

    name: str
    verdict: Verdict
    effects: tuple[Effect, ...]
    located: Location
    fit: Improvement
    validation: Improvement | None
    model: ExplainedModel
    refit: tuple[Estimate, ...]
    evidence: tuple[Reason, ...]
    traces: Traces
    closed_loop: ClosedLoop | None
    engine_version: str
