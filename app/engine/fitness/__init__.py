"""Can a recording be audited at all, and how good is it?"""

from app.engine.fitness.assess import Fitness, Whole, assess, refused_as_standing, with_cycles
from app.engine.fitness.config import FitnessConfig

__all__ = ["Fitness", "FitnessConfig", "Whole", "assess", "refused_as_standing", "with_cycles"]
