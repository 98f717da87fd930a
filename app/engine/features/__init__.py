"""What a loop's signals look like, in numbers that no unit, offset, sign or time scale changes."""

from app.engine.features.extract import NAMES, Features, Part, extract, observe, observe_parts, parts_of
from app.engine.features.steady import at_rest
from app.engine.features.travel import standing, standing_as_sampled
from app.engine.features.window import PER_CYCLE, ShapeWindow, cycle_samples, shape_windows, spans

__all__ = [
    "NAMES", "PER_CYCLE", "Features", "Part", "ShapeWindow", "at_rest", "cycle_samples", "extract", "observe",
    "observe_parts", "parts_of", "shape_windows", "spans", "standing", "standing_as_sampled",
]  # fmt: skip
