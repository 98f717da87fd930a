"""Terms that name nothing, one by one: how PV may answer OP beside a linear model, by products, powers, directions and
hysteresis of OP and of the model's own free run. Never of PV, whose noise they would copy.

Sources: products of lagged inputs, after Billings, Voon 1986, doi 10.1080/00207178608933593; play operators, after
Visintin, Differential Models of Hysteresis, doi 10.1007/978-3-662-11557-2.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from app.engine.mismatch.loop.block import Block, Context, Parameter, Part
from app.engine.mismatch.loop.plant import lag
from app.engine.mismatch.physics.generic import CODE, SPEEDS, acting
from app.engine.mismatch.physics.scales import slowness
from app.engine.recording import FloatArray
from app.engine.valve import two_parameter_he

_BANDS = (0.08, 0.2, 0.4)  # shares of a span
_TURN = 2.0


@dataclass(frozen=True, eq=False)
class Drives:
    """What a term may be made of: OP as it reaches PV and the model's free run, (N,) as shares of their spans."""

    context: Context
    free_run: FloatArray

    @cached_property
    def u(self) -> FloatArray:
        record = self.context.record
        return acting(record.op_deviation / record.op_span, self.context)

    @cached_property
    def s(self) -> FloatArray:
        return self.free_run / self.context.record.pv_span

    def late(self, signal: FloatArray, speed: float) -> FloatArray:
        """A signal (N,) behind a lag of so many times the process' slowest."""
        return lag(signal, speed * slowness(self.context), self.context.record.sampling_interval_s)

    @cached_property
    def time(self) -> FloatArray:
        """(N,) from -1 at the first instant to 1 at the last of the record that sizes are told of."""
        return 2.0 * self.context.time_s / self.context.record.reference_duration_s - 1.0

    @cached_property
    def rate(self) -> FloatArray:
        """How fast the free run moves, over its usual speed."""
        moved = self.s - self.late(self.s, SPEEDS[0])
        return moved / (float(np.std(moved)) + 1e-12)

    @cached_property
    def push(self) -> FloatArray:
        """How far OP is ahead of a slow copy of itself, over what is usual."""
        ahead = self.u - self.late(self.u, SPEEDS[1])
        return ahead / (float(np.std(ahead)) + 1e-12)


@dataclass(frozen=True)
class _Shape:
    """One way to answer OP. dynamic: by how fast it moves; multiplicative: as a product of two signals; memory: by what
    was before, beyond what a lag keeps of it; timed: by when in its record it is.
    """

    make: Callable[[Drives], FloatArray]
    dynamic: bool = False
    multiplicative: bool = False
    memory: bool = False
    timed: bool = False


def _product(one: str, other: str, speed: float) -> _Shape:
    """A drive times a lagged one."""
    return _Shape(lambda d: getattr(d, one) * d.late(getattr(d, other), speed), True, True, True)


def _linear(speed: float) -> _Shape:
    return _Shape(lambda d: d.late(d.u, speed), dynamic=True, memory=True)


def _by_play(drive: str, band: float) -> _Shape:
    """By how much a play (He's model with J = 0) holds a drive back: what it lets through is nearly the drive."""

    def held_back(d: Drives) -> FloatArray:
        moved = np.ascontiguousarray(getattr(d, drive))
        return two_parameter_he(moved, np.array([band]), np.zeros(1), moved[:1])[0] - moved

    return _Shape(held_back, memory=True)


def _beyond(level: float) -> _Shape:
    return _Shape(lambda d: np.maximum(d.s - level, 0.0))


_LINEAR = {f"lag_{speed:g}": _linear(speed) for speed in SPEEDS}
_BENT = {
    "op_2": _Shape(lambda d: d.u**2),
    "op_3": _Shape(lambda d: d.u**3),
    "pv_2": _Shape(lambda d: d.s**2),
    "pv_3": _Shape(lambda d: d.s**3),
    "op_times_pv": _Shape(lambda d: d.u * d.s, True, True),
    **{f"op_times_lag_{speed:g}": _product("u", "u", speed) for speed in SPEEDS[1:]},
    **{f"pv_times_lag_{speed:g}": _product("s", "s", speed) for speed in SPEEDS[1:3]},
    "pv_times_op_lag_3": _product("s", "u", 3.0),
    "pv_speed": _Shape(lambda d: np.abs(d.rate), True),
    "pv_speed_2": _Shape(lambda d: d.rate**2, True),
    "pv_speed_bent": _Shape(lambda d: d.rate * np.abs(d.rate), True),
    "pv_rate_times_pv": _Shape(lambda d: d.rate * d.s, True, True),
    "pv_speed_times_pv": _Shape(lambda d: np.abs(d.rate) * d.s, True, True),
    "pv_direction": _Shape(lambda d: np.tanh(_TURN * d.rate), True),
    "pv_direction_times_pv": _Shape(lambda d: np.tanh(_TURN * d.rate) * d.s, True, True),
    "op_speed": _Shape(lambda d: np.abs(d.push), True),
    "op_speed_2": _Shape(lambda d: d.push**2, True),
    "op_speed_bent": _Shape(lambda d: d.push * np.abs(d.push), True),
    "op_rate_times_op": _Shape(lambda d: d.push * d.u, True, True),
    "op_speed_times_op": _Shape(lambda d: np.abs(d.push) * d.u, True, True),
    "op_rate_times_pv": _Shape(lambda d: d.push * d.s, True, True),
    "op_times_time": _Shape(lambda d: d.u * d.time, False, True, timed=True),
    "pv_times_time": _Shape(lambda d: d.s * d.time, False, True, timed=True),
    **{f"op_play_{band:g}": _by_play("u", band) for band in _BANDS},
    **{f"pv_play_{band:g}": _by_play("s", band) for band in _BANDS},
    **{f"pv_beyond_{level:g}": _beyond(level) for level in (-0.25, 0.0, 0.25)},
}
# What acts before the lag passes that; what an integrator makes of it is lasting.
_LAGS = {"_lagged": 1.0, "_lasting": 8.0}


def _behind(shape: _Shape, speed: float) -> _Shape:
    """The same before a lag: what it makes passes that."""
    return _Shape(
        lambda d: d.late(shape.make(d), speed), shape.dynamic, shape.multiplicative, shape.memory, shape.timed
    )


SHAPES = (
    _LINEAR
    | _BENT
    | {name + way: _behind(shape, speed) for way, speed in _LAGS.items() for name, shape in _BENT.items()}
)
PRICE = 8.5  # nat a term: half the logarithm of the samples for its size, and which of them it is
_FORM = "terms:"


def made_of(names: tuple[str, ...]) -> Block:
    """A generic block that adds these terms to the free run; its condition says of what kind they are."""

    def parameters(context: Context) -> tuple[Parameter, ...]:
        span = context.record.pv_span
        return tuple(Parameter(name, "PV", -20.0 * span, 20.0 * span, 0.1 * span, linear=True) for name in names)

    def add(signal: FloatArray, values: FloatArray, context: Context) -> FloatArray:
        drives, out = Drives(context, signal), signal
        for name, value in zip(names, values, strict=True):
            out = out + value * SHAPES[name].make(drives)
        return out

    return Block(
        CODE,
        "process",
        "output",
        kind_of(names),
        parameters,
        lambda _, __: np.zeros((1, len(names))),
        apply=add,
        form=_FORM + "+".join(names),
        penalty=PRICE * len(names),
        frees_gain=True,
    )


def kind_of(names: tuple[str, ...]) -> str:
    """Of which kind terms are, the first of them the strongest."""
    shapes, first = [SHAPES[name] for name in names], SHAPES[names[0]]
    speed = "dynamic" if any(shape.dynamic for shape in shapes) else "static"
    way = "multiplicative" if first.multiplicative else "additive"
    place = "before the lag" if names[0].endswith(tuple(_LAGS)) else "behind the lag"
    memory = "with memory" if any(shape.memory for shape in shapes) else "without memory"
    return f"while OP moves: {speed}, {way}, {place}, {memory}"


def untimed(part: Part) -> Part | None:
    """A part without those of its terms that are of moments of one record; None where nothing is left of it."""
    if not part.block.name.startswith(f"{CODE}/{_FORM}"):
        return part
    names = part.block.form.removeprefix(_FORM).split("+")
    kept = [k for k, name in enumerate(names) if not SHAPES[name].timed]
    if len(kept) == len(names):
        return part
    return Part(made_of(tuple(names[k] for k in kept)), part.values[kept]) if kept else None


def of_name(name: str) -> Block | None:
    """The block of terms with this name; None where it is none."""
    if not name.startswith(f"{CODE}/{_FORM}"):
        return None
    names = tuple(name.removeprefix(f"{CODE}/{_FORM}").split("+"))
    return made_of(names) if all(known in SHAPES for known in names) else None
