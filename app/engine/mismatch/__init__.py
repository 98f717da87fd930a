"""Where a simulation and a recording differ: located, named, modelled and judged on data that no fit has seen."""

from app.engine.mismatch.explain import ENGINE_VERSION, Comparison, LinearSimulation, explain, locate
from app.engine.mismatch.result import Explanation

__all__ = ["ENGINE_VERSION", "Comparison", "Explanation", "LinearSimulation", "explain", "locate"]
