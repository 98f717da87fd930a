"""What a loop's signals look like, in numbers that no unit, offset, sign or time scale changes."""

from app.engine.features.extract import NAMES, Features, extract
from app.engine.features.window import ShapeWindow, cycle_samples, shape_windows

__all__ = ["NAMES", "Features", "ShapeWindow", "cycle_samples", "extract", "shape_windows"]
