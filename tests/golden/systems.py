"""The paper's simulated systems: I and II of table 1, and the three FOPTD scenarios of figure 10.

The paper gives plants and controllers of I and II and says that the valve is the physical one. What it does not give
is ours, and named here: sampling, the size of stiction against OP, the excitation of system I, and plant, tuning,
noise and disturbance of figure 10. B. Srinivasan, T. Spinner, R. Rengaswamy, Ind. Eng. Chem. Res. 2015, 54, 7476-7488,
doi 10.1021/acs.iecr.5b00939.
"""

from dataclasses import dataclass, replace

from app.engine.simulate import (
    LinearController,
    LoopSpec,
    PhysicalActuator,
    Pid,
    Plant,
    Signal,
    SimulatedLoop,
    TwoParameterValve,
    Wave,
    first_order,
    simulate_loop,
)
from app.engine.valve import CLASSIC


@dataclass(frozen=True)
class Scenario:
    """A loop with its sampling, its seed and the truth about its valve. duration_s, sampling_interval_s in s."""

    name: str
    spec: LoopSpec
    duration_s: float
    sampling_interval_s: float
    stiction: bool
    seed: int = 0

    def simulate(self) -> SimulatedLoop:
        return simulate_loop(self.spec, self.duration_s, self.sampling_interval_s, self.seed)


STATIC_FRICTION_OP = 0.5
"""F_s of the physical valve of systems I and II in units of OP, near the d, S and J that the paper finds."""

_FRICTION_PCT = 100.0 * CLASSIC.F_s / (CLASSIC.k * CLASSIC.travel_m)
_CLASSIC_VALVE = PhysicalActuator(CLASSIC, op_per_pct=STATIC_FRICTION_OP / _FRICTION_PCT)
_SLIPPING_VALVE = replace(_CLASSIC_VALVE, valve=replace(CLASSIC, F_c=0.0))


def system_one(period_s: float = 200.0) -> Scenario:
    """System I: 3/(100 s + 1) with 1/(s + 1) around a sticky physical valve, 2000 samples at 1 s.

    Without integral action and with a constant set point this loop comes to rest; the set point swings by 1 with
    period_s (s), so that there is an oscillation to look at.
    """
    spec = LoopSpec(
        plant=Plant((3.0,), (100.0, 1.0)),
        controller=LinearController((1.0,), (1.0, 1.0)),
        valve=_CLASSIC_VALVE,
        sp=Signal(waves=(Wave(1.0, period_s),)),
        step_s=0.1,
        settle_s=2000.0,
    )
    return Scenario("system_one", spec, duration_s=2000.0, sampling_interval_s=1.0, stiction=True)


def system_two(slip_only: bool = False) -> Scenario:
    """System II: 10/(s + 8) with (0.1 s + 0.1)/s around a sticky physical valve, 1000 samples.

    slip_only: without Coulomb friction the valve has S = J, as the paper identified it; the classic set has S = 11 J,
    cycles ten times as slowly, and is sampled so that both show about as many periods.
    """
    spec = LoopSpec(
        plant=Plant((10.0,), (1.0, 8.0)),
        controller=LinearController((0.1, 0.1), (1.0, 0.0)),
        valve=_SLIPPING_VALVE if slip_only else _CLASSIC_VALVE,
        load=Signal(value=0.75),
        step_s=0.05,
        settle_s=6000.0,
    )
    interval_s = 1.0 if slip_only else 10.0
    name = "system_two_slip_only" if slip_only else "system_two"
    return Scenario(name, spec, duration_s=1000.0 * interval_s, sampling_interval_s=interval_s, stiction=True)


def figure_ten(seed: int = 2) -> tuple[Scenario, Scenario, Scenario]:
    """Figure 10: an FOPTD loop oscillating from aggressive tuning, from stiction, and from a disturbance.

    3 e^(-10 s)/(10 s + 1), PI with Kc = 0.2 and Ti = 10 s (Kc = 0.5 where aggressive, 0.53 being the limit), a little
    noise and a small coloured load; S = J = 1; a sine of period 50 s at the output. 1000 samples at 1 s each.
    """
    calm = LoopSpec(
        plant=first_order(3.0, 10.0, 10.0),
        controller=Pid(0.2, 10.0),
        noise=Signal(noise_sd=0.005),
        load=Signal(value=1.0, noise_sd=0.02, noise_tau_s=10.0),
        step_s=0.1,
        settle_s=500.0,
    )
    specs = (
        ("aggressive_tuning", replace(calm, controller=Pid(0.5, 10.0)), False),
        ("stiction", replace(calm, valve=TwoParameterValve(1.0, 1.0), load=replace(calm.load, value=5.5)), True),
        ("oscillatory_disturbance", replace(calm, upset=Signal(waves=(Wave(1.0, 50.0),))), False),
    )
    first, second, third = (Scenario(name, spec, 1000.0, 1.0, stiction, seed) for name, spec, stiction in specs)
    return first, second, third
