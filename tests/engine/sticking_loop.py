"""What the tests of stems are about: a PI loop around a lag whose valve may stick, under a load and noise."""

from app.engine.mismatch import Comparison
from app.engine.recording import FloatArray
from app.engine.simulate import LoopSpec, Pid, Signal, SimulatedLoop, TwoParameterValve, first_order, simulate_loop

TS, SAMPLES = 5.0, 1440
STARTED = ((0.0, 1.0),)  # a load that steps once, so that the loop begins to swing
Steps = tuple[tuple[float, float], ...]


def loop(
    seed: int,
    S: float,
    J: float,
    load: Steps = STARTED,
    noise: float = 0.1,
    Kc: float = 1.0,
    samples: int = SAMPLES,
    scans: int = 1,
) -> SimulatedLoop:
    """scans: of the controller a sample."""
    spec = LoopSpec(
        plant=first_order(1.0, 20.0, 2.0),
        controller=Pid(Kc, 20.0, 0.0),
        valve=TwoParameterValve(S, J),
        load=Signal(steps=load),
        noise=Signal(noise_sd=noise),
        pv_start=50.0,
        op_start=50.0,
        op_limits=(0.0, 100.0),
        step_s=TS / scans,
    )
    return simulate_loop(spec, samples * TS, TS, seed)


def compared(made: SimulatedLoop, **measured: FloatArray) -> Comparison:
    return Comparison("FIC1", TS, made.op, made.pv, made.sp, tuple(measured.items()))
