"""All rivals, the strongest first."""

from app.engine.features import Features
from app.engine.oscillation import Oscillation
from app.engine.recording import UniformRecord
from app.engine.rivals import instrument, linear
from app.engine.rivals.rival import Rival


def compete(record: UniformRecord, oscillation: Oscillation, features: Features) -> tuple[Rival, ...]:
    """The rival explanations of one record, the strongest first."""
    rivals = (
        instrument.saturated_op(features),
        instrument.quantised_sensor(features),
        linear.set_point(record),
        linear.disturbance(features, oscillation),
        linear.tight_tuning(features, oscillation),
        linear.quiet(oscillation),
    )
    return tuple(sorted(rivals, key=lambda rival: -rival.strength))
