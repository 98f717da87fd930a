"""A loop of one lag with a simulation that is a little off, under the moves of `open_loop`."""

from functools import partial

from app.engine.mismatch import LinearSimulation
from app.engine.mismatch.loop.plant import Plant, run_process
from app.engine.recording import FloatArray
from tests.engine import open_loop

N, TS = 1200, 2.0
TRUE = Plant(K=1.4, tau=30.0, theta=6.0)
GIVEN = LinearSimulation(gain=1.45, time_constants_s=(28.5,), dead_time_s=6.0)
moves, noise = partial(open_loop.moves, N, 60), partial(open_loop.noise, N)


def recorded(v: FloatArray, added: FloatArray | float = 0.0) -> FloatArray:
    return 50.0 + run_process(v, TRUE, TS) + noise() + added
