"""How large stiction is: S with its intervals, if the record can tell them."""

from app.engine.quantification.config import QuantificationConfig
from app.engine.quantification.quantify import quantify
from app.engine.quantification.size import Interval, StictionSize

__all__ = ["Interval", "QuantificationConfig", "StictionSize", "quantify"]
