"""What other than stiction could make the loop move as it does, each examined in the same windows as stiction."""

from app.engine.rivals.compete import compete
from app.engine.rivals.contest import contest, runner_up, winner
from app.engine.rivals.rival import Rival
from app.engine.rivals.saturation import SATURATED
from app.engine.rivals.set_point import BEHIND_ALL

__all__ = ["BEHIND_ALL", "SATURATED", "Rival", "compete", "contest", "runner_up", "winner"]
