"""All rivals of one record, ranked."""

from app.engine.features import Features
from app.engine.oscillation import Oscillation
from app.engine.recording import UniformRecord
from app.engine.rivals.backlash import backlash
from app.engine.rivals.disturbance import load_disturbance, no_oscillation, outside_wave
from app.engine.rivals.quantisation import quantised_sensor
from app.engine.rivals.rival import Rival
from app.engine.rivals.saturation import saturated_op
from app.engine.rivals.scene import Scene
from app.engine.rivals.sensor_fault import spiking_sensor, sticking_sensor
from app.engine.rivals.set_point import set_point_following
from app.engine.rivals.tuning import aggressive_controller, pure_sines, sluggish_controller, tight_tuning

# The nearest cause first: what instruments do to the loop, what is asked of it, what it does by itself, what comes from
# outside. Of two that stand out the nearer explains the farther: a saturated loop swings, a ringing one is shaken.
_NEAREST_FIRST = (
    quantised_sensor, spiking_sensor, sticking_sensor, saturated_op, set_point_following, backlash, tight_tuning,
    aggressive_controller, outside_wave, pure_sines, sluggish_controller, load_disturbance, no_oscillation,
)  # fmt: skip


def compete(record: UniformRecord, oscillation: Oscillation, features: Features) -> tuple[Rival, ...]:
    """The rival explanations of one record: first those that stand out, the nearest first, then the others by strength.

    All use the same windows as stiction, so that their explained shares can be compared with it. Rivals whose
    assumptions do not hold come last.
    """
    scene = Scene(record, oscillation, features)
    rivals = [rival(scene) for rival in _NEAREST_FIRST]
    standing = [rival for rival in rivals if rival.stands_out]
    others = sorted((r for r in rivals if not r.stands_out), key=lambda r: (not r.applies, -r.strength))
    return (*standing, *others)
