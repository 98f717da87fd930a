"""What else than stiction could make the loop move as it does, each seen in the same windows as stiction."""

from app.engine.rivals.compete import compete
from app.engine.rivals.contest import contest, runner_up, winner
from app.engine.rivals.periodic import held_out_fundamental
from app.engine.rivals.rival import Rival

__all__ = ["Rival", "compete", "contest", "held_out_fundamental", "runner_up", "winner"]
