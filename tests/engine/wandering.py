"""A loop under a load that wanders for hours, as records of days are, with a healthy valve and with one that sticks."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from app.engine.recording import Recording
from app.engine.simulate import LoopSpec, Pid, Signal, TwoParameterValve, first_order, simulate_loop

TS = 10.0
FREE = LoopSpec(
    plant=first_order(1.0, 25.0, 8.0),
    controller=Pid(1.2, 25.0),
    load=Signal(value=2.0, noise_sd=2.5, noise_tau_s=6000.0),
    noise=Signal(noise_sd=0.1),
    pv_start=50.0,
    op_start=50.0,
    op_limits=(0.0, 100.0),
    step_s=2.0,
    settle_s=3600.0,
)
STICKY = replace(FREE, valve=TwoParameterValve(8.0, 2.0))


@lru_cache(maxsize=12)
def recorded(spec: LoopSpec, samples: int, seed: int = 7) -> Recording:
    made = simulate_loop(spec, samples * TS, TS, seed).recording("loop")
    return replace(made, pv=np.round(made.pv, 2), op=np.round(made.op, 2), op_range=None)
