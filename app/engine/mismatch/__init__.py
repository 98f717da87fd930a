"""Where a simulation and a recording differ: located, named, modelled and judged on data that no fit has seen."""

from app.engine.mismatch.comparison import Comparison, LinearSimulation
from app.engine.mismatch.explain import explain, locate
from app.engine.mismatch.result import Explanation

__all__ = ["Comparison", "Explanation", "LinearSimulation", "explain", "locate"]
