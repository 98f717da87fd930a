"""Where a simulation and a recording differ: located, named, modelled and judged on data that no fit has seen."""

from app.engine.mismatch.compare.comparison import Comparison, LinearSimulation, at_interval
from app.engine.mismatch.compiling import compile_kernels
from app.engine.mismatch.explanation import explain
from app.engine.mismatch.judge.result import Explanation
from app.engine.mismatch.judge.validation import simulate_again
from app.engine.mismatch.location import locate
from app.engine.mismatch.loop.law import Controller

__all__ = [
    "Comparison",
    "Controller",
    "Explanation",
    "LinearSimulation",
    "at_interval",
    "compile_kernels",
    "explain",
    "locate",
    "simulate_again",
]
