"""The process between valve and sensor: lags, dead time, and the ways in which a real vessel leaves the linear form."""

from dataclasses import dataclass, fields

import numpy as np
from numba import njit

from app.engine.recording import FloatArray

_NO_LIMIT = 1e30
_VESSEL_STEPS = 2
_SWING_STEPS = 4
_TORRICELLI = 0.5  # the exponent of a level by which a vessel empties through an opening
_FAR_APART = 700.0  # exponents of two lags: the exponential of more is soon no number
_HALVED, _TAYLOR_TERMS = 2, 14  # a matrix of 1/4 at most, whose 14th power over 14! is less than a rounding error


@dataclass(frozen=True)
class Plant:
    """tau x' = K v' + b - leak f(x), then a lag tau2, a lag tau3, a zero. Where it swings (damping > 0) there is no
    lag tau2: tau^2 x'' + 2 damping tau x' = K v' + b - leak f(x); below 1 its poles are complex.

    v' and x are deviations from the record's means. Where x integrates (leak = 0) the lag tau2 lies before it: between
    valve and vessel, so that a level stops sharply.

    K: unit of PV per unit of OP (per second where `leak` is 0: an integrator, with tau = 1). tau, tau2, tau3, theta: s.
    b: unit of PV; the offset that the deviations leave. x0: start of x, unit of PV; speed0: that of tau x' where it
    swings, unit of PV.
    leak: 1 for a self-regulating process, 0 for an integrator.
    high, low: where x overflows, unit of PV as deviation. zero: time constant of (1 - zero s), s.
    head: distance of the empty level below the mean for the outflow law f(x) = head / n ((1 + x / head)^n - 1), unit of
    PV; 0 for f(x) = x. exponent: n of that law. damping: ratio, tau being one over the natural frequency; 0: it does
    not swing.
    """

    K: float
    tau: float
    theta: float
    b: float = 0.0
    x0: float = 0.0
    tau2: float = 0.0
    leak: float = 1.0
    tau3: float = 0.0
    high: float = _NO_LIMIT
    low: float = -_NO_LIMIT
    head: float = 0.0
    zero: float = 0.0
    damping: float = 0.0
    speed0: float = 0.0
    exponent: float = _TORRICELLI

    @property
    def states(self) -> tuple[str, ...]:
        """What of it is fitted for where it stands when a record begins; the others are settled."""
        return ("x0", "speed0") if self.damping > 0.0 else ("x0",)

    @property
    def linear(self) -> bool:
        """Whether it has neither limits nor an outflow law."""
        return self.head <= 0.0 and self.high >= _NO_LIMIT and self.low <= -_NO_LIMIT

    def row(self) -> FloatArray:
        """The plant as the kernel reads it."""
        numbers = vars(self)
        return np.array([numbers[name] for name in NUMBERS])

    def changed(self, **values: float) -> "Plant":
        """The same with other values of some fields; past the constructor, in which a search would spend as much time
        as in the kernel.
        """
        other = object.__new__(Plant)
        vars(other).update(vars(self), **values)
        return other


NUMBERS = tuple(field.name for field in fields(Plant))


@njit(cache=True, nogil=True)
def _delay(v: FloatArray, samples: float) -> FloatArray:
    """v later by a number of samples that need not be whole; before the start v held its first value."""
    out = np.empty(len(v))
    whole = int(np.floor(samples))
    share = samples - whole
    n = len(v)
    first = min(max(whole + 1, 0), n)
    last = max(min(n + whole, n), first)
    for t in range(first):
        out[t] = (1.0 - share) * v[max(min(t - whole, n - 1), 0)] + share * v[0]
    now, before, there = v[first - whole : last - whole], v[first - whole - 1 : last - whole - 1], out[first:last]
    for t in range(len(there)):
        there[t] = (1.0 - share) * now[t] + share * before[t]
    out[last:] = v[-1]
    return out


@njit(cache=True, nogil=True)
def _lag(v: FloatArray, tau: float, ts: float) -> FloatArray:
    """v behind a first-order lag, exact for a signal that goes straight from sample to sample; starts settled.

    Not held, as `run_process` holds OP: what comes out of a process does not jump. Behind a signal that was held it is
    half an interval early. Source: the triangle hold of Franklin, Powell, Workman, Digital Control of Dynamic Systems,
    3rd edition 1998, chapter 6.
    """
    if tau <= 1e-9:
        return v.copy()
    out = np.empty(len(v))
    out[0] = v[0]
    stay = np.exp(-ts / tau)
    slope = 1.0 - tau / ts * (1.0 - stay)
    for t in range(1, len(v)):
        out[t] = stay * out[t - 1] + ((1.0 - stay) * v[t - 1] + slope * (v[t] - v[t - 1]))
    return out


@njit(cache=True, nogil=True)
def _outflow(x: float, head: float, exponent: float) -> float:
    if head <= 0.0:
        return x
    level = max(1.0 + x / head, 0.0)
    power = np.sqrt(level) if exponent == _TORRICELLI else level**exponent
    return head / exponent * (power - 1.0)


@njit(cache=True, nogil=True)
def _advance(x: float, drive: float, tau: float, leak: float, head: float, exponent: float, step: float) -> float:
    """x after `step` seconds, the drive held: exact for the linear law, linearised where the step begins otherwise."""
    level = max(1.0 + x / head, 1e-4) if head > 0.0 else 1.0
    rate = leak / (tau * np.sqrt(level)) if exponent == _TORRICELLI else leak / tau * level ** (exponent - 1.0)
    speed = (drive - leak * _outflow(x, head, exponent)) / tau
    if rate * step < 1e-9:
        return x + speed * step
    return x + speed * (1.0 - np.exp(-rate * step)) / rate


@njit(cache=True, nogil=True)
def _first_state(u: FloatArray, p: FloatArray, ts: float) -> FloatArray:
    """x (N,) with the linear law and no limits: one multiplication a sample."""
    K, tau, _, b, x, _, leak = p[:7]
    y = np.empty(len(u))
    stay = np.exp(-leak * ts / tau)
    gain = (1.0 - stay) / leak if leak > 1e-9 else ts / tau
    y[0] = x
    for t in range(1, len(u)):
        x = stay * x + gain * (K * u[t - 1] + b)
        y[t] = x
    return y


@njit(cache=True, nogil=True)
def _two_lags(u: FloatArray, p: FloatArray, ts: float) -> FloatArray:
    """The state of `_first_state` behind a second lag (N,): exact, whichever of the two lags is the shorter, because a
    first lag shorter than the interval does not let its output pass for a ramp.
    """
    K, tau, _, b, x, tau2, leak = p[:7]
    y = np.empty(len(u))
    rate, further_rate = leak / tau, 1.0 / tau2
    stay, further = np.exp(-rate * ts), np.exp(-further_rate * ts)
    apart = (rate - further_rate) * ts
    # (exp(-b) - exp(-a)) / (a - b), in its limit where the two lags are one, or the second is nothing beside the first.
    if apart < -_FAR_APART:
        share = further_rate * ts * stay / -apart
    else:
        share = further_rate * ts * further * (-np.expm1(-apart) / apart if abs(apart) > 1e-9 else 1.0)
    gain = (1.0 - stay) / leak
    level = (1.0 - further - share) / leak
    y[0] = x
    for t in range(1, len(u)):
        drive = K * u[t - 1] + b
        y[t] = further * y[t - 1] + (share * x + level * drive)
        x = stay * x + gain * drive
    return y


@njit(cache=True, nogil=True)
def _bounded_state(u: FloatArray, p: FloatArray, ts: float) -> FloatArray:
    """x (N,) with the linear law and an overflow: what runs over is gone at once."""
    K, tau, _, b, x, _, leak, _, high, low = p[:10]
    y = np.empty(len(u))
    stay = np.exp(-leak * ts / tau)
    gain = (1.0 - stay) / leak if leak > 1e-9 else ts / tau
    x = min(max(x, low), high)
    y[0] = x
    for t in range(1, len(u)):
        x = stay * x + gain * (K * u[t - 1] + b)
        if x > high:
            x = high
        elif x < low:
            x = low
        y[t] = x
    return y


@njit(cache=True, nogil=True)
def _vessel_state(u: FloatArray, p: FloatArray, ts: float) -> FloatArray:
    """x (N,) with the outflow law, in steps within each sample."""
    K, tau, _, b, x, _, leak, _, high, low, head = p[:11]
    y, exponent = np.empty(len(u)), p[14]
    x = min(max(x, low), high)
    y[0] = x
    for t in range(1, len(u)):
        drive = K * u[t - 1] + b
        for _ in range(_VESSEL_STEPS):
            x = min(max(_advance(x, drive, tau, leak, head, exponent, ts / _VESSEL_STEPS), low), high)
        y[t] = x
    return y


@njit(cache=True, nogil=True)
def _behind_actuator(u: FloatArray, tau: float, ts: float) -> FloatArray:
    """Means over each sample (N,) of u, held, behind a first-order lag that was settled at the start: exact."""
    out = np.empty(len(u))
    stay = np.exp(-ts / tau)
    reached = u[0]
    for t in range(len(u)):
        out[t] = u[t] + (reached - u[t]) * tau * (1.0 - stay) / ts
        reached = u[t] + (reached - u[t]) * stay
    return out


@njit(cache=True, nogil=True)
def _slopes(x: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
    """dx/dt (N,) of the first state."""
    K, tau, _, b, _, _, leak, _, _, _, head = p[:11]
    rate = np.empty(len(x))
    for t in range(len(x)):
        rate[t] = (K * u[max(t - 1, 0)] + b - leak * _outflow(x[t], head, p[14])) / tau
    return rate


@njit(cache=True, nogil=True)
def _exponential(a: FloatArray) -> FloatArray:
    """exp(a) of a matrix (3, 3): a Taylor series of what is small after halving, squared again.

    Source: Moler, Van Loan 2003, doi 10.1137/S00361445024180, method 3.
    """
    halved = max(int(np.ceil(np.log2(np.max(np.abs(a)) + 1e-300))) + _HALVED, 0)
    term, whole = np.eye(3), np.eye(3)
    for k in range(1, _TAYLOR_TERMS):
        term = term @ a / (k * 2.0**halved)
        whole += term
    for _ in range(halved):
        whole = whole @ whole
    return whole


@njit(cache=True, nogil=True)
def _swinging(u: FloatArray, p: FloatArray, ts: float) -> FloatArray:
    """x and tau dx/dt (2, N) of what swings, its drive held over each sample: exact for the linear law; in steps within
    each sample, what the law of outflow is off a straight line held over each, otherwise.
    """
    K, tau, _, b, x, _, leak, _, high, low, head, _, damping, speed, exponent = p
    steps = 1 if head <= 0.0 and high > 1e29 and low < -1e29 else _SWING_STEPS
    system = np.array([[0.0, 1.0, 0.0], [-leak, -2.0 * damping, 1.0], [0.0, 0.0, 0.0]])
    move = _exponential(system * (ts / (steps * tau)))
    out = np.empty((2, len(u)))
    x = min(max(x, low), high)
    out[0, 0], out[1, 0] = x, speed
    for t in range(1, len(u)):
        drive = K * u[t - 1] + b
        for _ in range(steps):
            pull = drive - leak * (_outflow(x, head, exponent) - x)
            there = move[0, 0] * x + move[0, 1] * speed + move[0, 2] * pull
            speed = move[1, 0] * x + move[1, 1] * speed + move[1, 2] * pull
            x = min(max(there, low), high)
            if x != there:
                speed = 0.0
        out[0, t], out[1, t] = x, speed
    return out


@njit(cache=True, nogil=True)
def _process(v: FloatArray, p: FloatArray, ts: float) -> FloatArray:
    tau2, tau3, high, low, head, zero = p[5], p[7], p[8], p[9], p[10], p[11]
    u = _delay(v, p[2] / ts)
    if p[12] > 0.0:
        swing = _swinging(u, p, ts)
        return _lag(swing[0] - zero / p[1] * swing[1], tau3, ts)
    integrating = p[6] == 0.0
    if integrating and tau2 > 1e-9:
        u = _behind_actuator(u, tau2, ts)
    behind = tau2 > 1e-9 and not integrating
    linear = not head > 0.0 and high > 1e29 and low < -1e29
    if behind and linear and zero == 0.0:
        y = _two_lags(u, p, ts)
        return _lag(y, tau3, ts) if tau3 > 1e-9 else y
    if head > 0.0:
        x = _vessel_state(u, p, ts)
    elif linear:
        x = _first_state(u, p, ts)
    else:
        x = _bounded_state(u, p, ts)
    y = x
    if behind:
        y = _two_lags(u, p, ts) if linear else _lag(x, tau2, ts)
    if zero != 0.0:
        y = y - zero * ((x - y) / tau2 if behind else _slopes(x, u, p))
    return _lag(y, tau3, ts) if tau3 > 1e-9 else y


def run_process(v: FloatArray, plant: Plant, sampling_interval_s: float) -> FloatArray:
    """PV (N,) in its unit, as deviation, of a valve position v (N,) in the unit of OP, as deviation, held over each
    sample.
    """
    return _process(np.ascontiguousarray(v), plant.row(), sampling_interval_s)


def plant_of(row: FloatArray) -> Plant:
    """The plant that a kernel reads as this row (15,); past the constructor as well."""
    plant = object.__new__(Plant)
    vars(plant).update(zip(NUMBERS, row.tolist(), strict=True))
    return plant


@njit(cache=True, nogil=True)
def _with_rest(pv: FloatArray, rest: FloatArray, most: float, out: FloatArray) -> None:
    """Writes pv (N,) cut to `most` either side, with what is beside it, into out (N,)."""
    for t in range(len(pv)):
        now = pv[t]
        if not abs(now) < most:
            now = -most if now < 0.0 else most
        out[t] = now + rest[t]


@njit(cache=True, nogil=True)
def _processes(v: FloatArray, rows: FloatArray, ts: float, rest: FloatArray, most: float) -> FloatArray:
    out = np.empty((len(rows), len(v)))
    for k in range(len(rows)):
        _with_rest(_process(v, rows[k], ts), rest, most, out[k])
    return out


def run_rows(v: FloatArray, rows: FloatArray, ts: float, rest: FloatArray, most: float) -> FloatArray:
    """What each of some plants (L, 15), as the kernel reads them, makes of v (N,), as `with_rest` has it; (L, N)."""
    return _processes(np.ascontiguousarray(v), rows, ts, rest, most)


def with_rest(pv: FloatArray, rest: FloatArray, most: float) -> FloatArray:
    """pv (N,) with a rest (N,) beside it; where it runs away it is cut to `most`, what is no number to that too."""
    out = np.empty(len(pv))
    _with_rest(np.ascontiguousarray(pv), rest, most, out)
    return out


def delay(v: FloatArray, delay_s: float, sampling_interval_s: float) -> FloatArray:
    """v (N,) later by delay_s seconds, interpolated between samples."""
    return _delay(np.ascontiguousarray(v), delay_s / sampling_interval_s)


def lag(v: FloatArray, tau_s: float, sampling_interval_s: float) -> FloatArray:
    """v (N,), straight between samples, behind a first-order lag of tau_s seconds; settled at the start."""
    return _lag(np.ascontiguousarray(v), tau_s, sampling_interval_s)
